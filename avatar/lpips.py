"""LPIPS: perceptual distance of two images by the features of a network (Zhang et al. 2018, v0.1 of the weights).

Both images run through the network; at each tap, features are normalised to length one in every place, their squared differences
are weighted by channel and averaged over the places; the distance is the sum over the taps. The user brings the weights: the
network's from torchvision, the heads' from the authors' repository.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gsac.avatar.feature_distance import FeatureDistance, Layer
from gsac.avatar.npz import NpzError, read_npz
from gsac.avatar.weight_file import WeightsError, read_weights

if TYPE_CHECKING:
    import torch


NETS = {
    "lpips-vgg": (
        Layer(0, 64), Layer(2, 64, tap=True), Layer(5, 128, pool=2), Layer(7, 128, tap=True), Layer(10, 256, pool=2),
        Layer(12, 256), Layer(14, 256, tap=True), Layer(17, 512, pool=2), Layer(19, 512), Layer(21, 512, tap=True),
        Layer(24, 512, pool=2), Layer(26, 512), Layer(28, 512, tap=True)),
    "lpips-alex": (
        Layer(0, 64, 11, 4, 2, tap=True), Layer(3, 192, 5, 1, 2, pool=3, tap=True), Layer(6, 384, pool=3, tap=True),
        Layer(8, 256, tap=True), Layer(10, 256, tap=True)),
}
"""Name of the model file -> the convolutions of torchvision's vgg16 and alexnet."""
SOURCES = {"lpips-vgg": "torchvision's vgg16 and lpips/weights/v0.1/vgg.pth of the authors",
           "lpips-alex": "torchvision's alexnet and lpips/weights/v0.1/alex.pth of the authors"}
SHIFT, SCALE = (-0.030, -0.088, -0.188), (0.458, 0.448, 0.450)

NETWORK = re.compile(r"(?:.*\.)?(?:features|slice\d)\.(\d+)\.(weight|bias)")
HEAD = re.compile(r"(?:.*\.)?(?:lin|lins\.)(\d)(?:\.model\.\d)?\.weight")


def shapes(name: str) -> dict[str, tuple[int, ...]]:
    """Array -> shape in the file of that name: torchvision's names, and `lin0` to `lin4` for the heads."""
    found, before, taps = {}, 3, 0
    for layer in NETS[name]:
        found[f"features.{layer.number}.weight"] = layer.channels, before, layer.kernel, layer.kernel
        found[f"features.{layer.number}.bias"] = (layer.channels,)
        if layer.tap:
            found[f"lin{taps}"] = (layer.channels,)
            taps += 1
        before = layer.channels
    return found


def gather(name: str, files: Iterable[Path]) -> dict[str, np.ndarray]:
    """The arrays (...) of `shapes(name)` from the user's files: one with all of them, or network and heads apart.

    Arrays may have the names of torchvision, of the `lpips` package, of its head files, or ours. Raises `WeightsError`.
    """
    files, wanted, found = list(files), shapes(name), {}
    for path in files:
        for called, values in read_weights(path).items():
            own = _own_name(called)
            if own not in wanted:
                continue
            if own.startswith("lin") and values.ndim == 4 and values.shape[::2] == (1, 1) and values.shape[3] == 1:
                values = values[0, :, 0, 0]
            if values.shape != wanted[own]:
                raise WeightsError(f"{path}: {called} has shape {values.shape}, {name} has {wanted[own]} there; "
                                   f"{name} is made of {SOURCES[name]}")
            if not np.isfinite(values).all():
                raise WeightsError(f"{path}: {called} is not finite")
            found[own] = values
    missing = [own for own in wanted if own not in found]
    if missing:
        heads = sum(own.startswith("lin") for own in missing)
        lacks = "the heads" if heads == len(missing) else "the network" if not heads else "network and heads"
        raise WeightsError(f"{', '.join(map(str, files))}: {missing[0]} is missing"
                           f"{f' and {len(missing) - 1} more' if len(missing) > 1 else ''}: {lacks} of {name}, which is made of "
                           f"{SOURCES[name]}; both files may be given one after the other")
    return {own: found[own] for own in wanted}


def _own_name(called: str) -> str:
    if network := NETWORK.fullmatch(called):
        return f"features.{network[1]}.{network[2]}"
    if head := HEAD.fullmatch(called):
        return f"lin{head[1]}"
    return called


class Lpips(FeatureDistance):
    """LPIPS by one network."""

    def __init__(self, name: str, arrays: dict[str, np.ndarray]):
        """arrays: name -> array (...) as in `shapes(name)`."""
        super().__init__(NETS[name], SHIFT, SCALE, arrays)

    @classmethod
    def read(cls, name: str, path: Path) -> Lpips:
        """From the store's file. Raises `WeightsError` where its arrays are not those of `shapes(name)`."""
        try:
            arrays = read_npz(path)
        except (OSError, NpzError) as error:
            raise WeightsError(f"{path} cannot be read ({error}); run `gsac models add {name} FILE` again") from error
        if {own: values.shape for own, values in arrays.items()} != shapes(name):
            raise WeightsError(f"{path} does not hold the arrays of {name}; run `gsac models add {name} FILE` again")
        return cls(name, arrays)

    def weigh(self, tap: int, squares: torch.Tensor) -> torch.Tensor:
        """Weighted by channel, averaged over the places; a scalar. squares: (C, h, w)."""
        return (self.weights[f"lin{tap}"][:, None, None] * squares).sum(0).mean()
