"""Recipe `paper`: the published optimisation, on the CPU and on the GPU."""
