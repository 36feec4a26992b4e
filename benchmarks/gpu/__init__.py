"""Measures the CUDA trainer: checks against the CPU path, times, memory, distance to the card's limits."""
