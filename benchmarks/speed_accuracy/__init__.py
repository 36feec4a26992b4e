"""Held-out quality against CPU seconds of training: both recipes, several numbers of steps, curves from checkpoints."""
