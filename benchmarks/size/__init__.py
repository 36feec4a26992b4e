"""Held-out quality against the number of gaussians, and the choice of `train.gaussians: auto`."""
