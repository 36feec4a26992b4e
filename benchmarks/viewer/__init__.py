"""The viewer page against PlayCanvas on the same splats."""
