"""LPIPS: perceptual distance of two images by the features of a network (Zhang et al. 2018, v0.1 of the weights).

Both images run through the network; at each tap, features are normalised to length one in every place, their squared differences
are weighted by channel and averaged over the places; the distance is the sum over the taps. The user brings the weights: the
network's from torchvision, the heads' from the authors' repository.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from copy import copy
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gsac.avatar.npz import NpzError, read_npz
from gsac.avatar.weight_file import WeightsError, read_weights

if TYPE_CHECKING:
    import torch


class Layer(NamedTuple):
    """A convolution and ReLU; the layer's number is torchvision's."""

    number: int
    channels: int
    kernel: int = 3
    stride: int = 1
    padding: int = 1
    pool: int = 0
    """Size of the max pooling before it, stride 2; 0: none."""
    tap: bool = False


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
TINY = 1e-10
LEAST_SIDE = 64
"""px; of a smaller image nothing is left after the poolings."""

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


class Lpips:
    """LPIPS by one network."""

    def __init__(self, name: str, arrays: dict[str, np.ndarray]):
        """arrays: name -> array (...) as in `shapes(name)`."""
        import torch

        self.layers, self.one_at_a_time, self.precision = NETS[name], Lock(), None
        self.shift, self.scale = (torch.tensor(values, dtype=torch.float64)[:, None, None] for values in (SHIFT, SCALE))
        self.weights = {own: torch.from_numpy(np.ascontiguousarray(values, np.float32)) for own, values in arrays.items()}

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

    def to(self, device: str, precision: torch.dtype) -> Lpips:
        """The same network on that device, its convolutions in that precision; for `compare`."""
        import torch

        other = copy(self)
        other.precision, other.shift, other.scale = precision, self.shift.to(device), self.scale.to(device)
        other.weights = {own: w.to(device, precision, memory_format=torch.channels_last if w.ndim == 4 else torch.preserve_format)
                         for own, w in self.weights.items()}
        return other

    def compare(self, image: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
        """Distance of image and target, (H, W, 3) in 0..1, as a scalar on their device; differentiable by the image."""
        import torch

        with torch.no_grad():
            features = self._features(target.permute(2, 0, 1))
        return self._distance(self._features(image.permute(2, 0, 1)), features)

    def distance(self, a: np.ndarray, b: np.ndarray, scaled: bool = True) -> float:
        """Distance of images a and b, (H, W, 3) in 0..1; NaN for images of fewer than LEAST_SIDE px.

        scaled: map them to -1..1, the network's own range; False: leave them in 0..1, as many papers score.
        """
        import torch

        if min(a.shape[:2]) < LEAST_SIDE:
            return float("nan")
        with torch.no_grad(), self.one_at_a_time:  # torch brings its own threads, and the features of two images are large
            return float(self._distance(*(self._features(_tensor(np.asarray(image, np.float32), scaled)) for image in (a, b))))

    def gradient(self, image: np.ndarray, target: np.ndarray, scaled: bool = True) -> tuple[float, np.ndarray]:
        """The distance, and its gradient (H, W, 3) with respect to the image. image, target: (H, W, 3) in 0..1."""
        import torch

        moved = torch.from_numpy(np.ascontiguousarray(image)).requires_grad_()
        value = self._distance(*(self._features(_tensor(image, scaled)) for image in (moved, target)))
        return value.item(), torch.autograd.grad(value, moved)[0].numpy()

    def _distance(self, a, b):
        taps = zip(a, b, strict=True)
        return sum((self.weights[f"lin{k}"][:, None, None] * (x - y) ** 2).sum(0).mean() for k, (x, y) in enumerate(taps))

    def _features(self, x) -> list:
        """Of the taps, (C, h, w) each of length one. x: (3, H, W) about -1..1."""
        import torch
        from torch.nn import functional

        exact = x.dtype
        x, taps = ((x - self.shift.to(exact)) / self.scale.to(exact))[None].to(self.precision or exact), []
        for layer in self.layers:
            if layer.pool:
                x = functional.max_pool2d(x, layer.pool, 2)
            weight, bias = (self.weights[f"features.{layer.number}.{part}"].to(x.dtype) for part in ("weight", "bias"))
            x = functional.relu(functional.conv2d(x, weight, bias, layer.stride, layer.padding))
            if layer.tap:
                # The root's slope at zero is infinite: where all features are zero, so shall the gradient be.
                tap = x[0].to(exact)
                taps.append(tap / (torch.sqrt((tap**2).sum(0) + TINY**2) + TINY))
        return taps


def _tensor(image, scaled: bool):
    """(3, H, W), float32 unless it is float64."""
    import torch

    image = torch.as_tensor(image)
    image = image.permute(2, 0, 1).to(torch.float64 if image.dtype == torch.float64 else torch.float32)
    return 2 * image - 1 if scaled else image
