"""Held-out quality against CPU seconds of training: both recipes, several budgets, curves from checkpoints."""
