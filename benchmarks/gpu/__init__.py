"""The CUDA trainer: checks against the CPU path, times, memory, and distance to the card's limits."""
