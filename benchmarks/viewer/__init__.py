"""Frame rate of the viewer page against PlayCanvas on the same splats."""
