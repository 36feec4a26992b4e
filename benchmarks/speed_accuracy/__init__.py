"""Held-out quality against the seconds from clip to avatar: every preset and the paper's recipe."""
