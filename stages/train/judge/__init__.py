"""Judges a finished avatar: on held-out frames, in poses never seen, by the parts that no frame shows."""
