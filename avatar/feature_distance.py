"""Perceptual distance of two images by the features of a convolutional network; which network it is says the subclass.

Both images run through the network; at each tap, features are normalised to length one in every place.
"""

from __future__ import annotations

from copy import copy
from threading import Lock
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

if TYPE_CHECKING:
    import torch

TINY = 1e-10
LEAST_SIDE = 64
"""px; of a smaller image nothing is left after the poolings."""


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


class FeatureDistance:
    """Distance by one network."""

    whole_windows = True
    """Whether a pooling leaves out the last row or column where its window would reach beyond them."""

    def __init__(self, layers: tuple[Layer, ...], shift: tuple[float, ...], scale: tuple[float, ...],
                 arrays: dict[str, np.ndarray]):
        """shift, scale: of red, green, blue, before the first layer; arrays: `features.<number>.weight` (C, c, k, k) and `.bias`
        (C,), and what the subclass weighs by."""
        import torch

        self.layers, self.one_at_a_time, self.precision = layers, Lock(), None
        self.shift, self.scale = (torch.tensor(values, dtype=torch.float64)[:, None, None] for values in (shift, scale))
        self.weights = {own: torch.from_numpy(np.ascontiguousarray(values, np.float32)) for own, values in arrays.items()}

    def weigh(self, tap: int, squares: torch.Tensor) -> torch.Tensor:
        """A tap's part of the distance, a scalar. squares: (C, h, w), of the differences of its features."""
        raise NotImplementedError

    def to(self, device: str, precision: torch.dtype) -> Self:
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
        return sum(self.weigh(k, (x - y) ** 2) for k, (x, y) in enumerate(zip(a, b, strict=True)))

    def _features(self, x) -> list:
        """Of the taps, (C, h, w) each of length one. x: (3, H, W) about -1..1."""
        import torch
        from torch.nn import functional

        exact = x.dtype
        x, taps = ((x - self.shift.to(exact)) / self.scale.to(exact))[None].to(self.precision or exact), []
        for layer in self.layers:
            if layer.pool:
                x = functional.max_pool2d(x, layer.pool, 2, ceil_mode=not self.whole_windows)
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
