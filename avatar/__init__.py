"""Shared by the stages: body model, camera, gaussians and their binding, rasterisers, losses, metrics, artifact files."""
