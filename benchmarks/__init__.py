"""Makes the truth clips and the charts: speed-accuracy, stability, size."""
