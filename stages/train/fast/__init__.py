"""Recipe `fast`: one gaussian budget, coarse to fine, on the CPU and on the GPU."""
