"""The gaussians themselves: first colours, merging, those that no frame shows, the offset to clothes, kernels of a step."""
