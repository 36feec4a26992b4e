"""Held-out quality against the number of gaussians, and what `train.gaussians: auto` makes of it."""
