"""The gaussians themselves: first colours, merging, what no frame shows, the offset to clothes."""
