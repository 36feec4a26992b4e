"""Image losses on the CPU, value and gradient with respect to the image at once.

Images are (H, W, 3) in 0..1. `box` = (top, bottom, left, right), px: the loss is that of the crop alone. `weights` (H, W) >= 0
make every mean a weighted mean over pixels. `spans` (H, 2), px: first and end column of each row outside of which image and target
are the same and no gradient is wanted, so that it costs little time. The gradient of `factor` times the value is added to
`gradient` (H, W, 3) where one is given (losses of one image add up in one array), else to a new array of zeros.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gsac.avatar import sobel as _sobel
from gsac.avatar import ssim as _ssim
from gsac.avatar.numba_kernel import kernel
from gsac.avatar.simd import WIDTH, load, spread, store, total
from gsac.avatar.ssim import MARGIN
from gsac.avatar.threads import Workspace

Box = tuple[int, int, int, int]
"""top, bottom, left, right, px."""


class Loss(NamedTuple):
    """Value and gradient of a loss."""

    value: float
    """Without the factor."""
    gradient: np.ndarray
    """(H, W, 3) of factor times the value, with respect to the image."""


def l2(image: np.ndarray, target: np.ndarray, box: Box | None = None, weights: np.ndarray | None = None, factor: float = 1.0,
       gradient: np.ndarray | None = None, workspace: Workspace | None = None, spans: np.ndarray | None = None) -> Loss:
    """Mean squared difference over pixels and channels.

    image, target, gradient: (H, W, 3); weights: (H, W); spans: (H, 2) int.
    """
    job = _Crop(image, target, box, weights, gradient, workspace, spans)
    sums = np.empty(job.height, job.real)
    tail = job.take("l2_tail", (job.workspace.workers, WIDTH))
    job.workspace.share(_squares, *job.place, job.count, job.shares, job.spans, job.real.type(factor), tail,
                        job.flat_gradient, sums)
    return Loss(float(sums.sum(dtype=np.float64)), job.gradient)


def ssim(image: np.ndarray, target: np.ndarray, box: Box | None = None, weights: np.ndarray | None = None, factor: float = 1.0,
         gradient: np.ndarray | None = None, workspace: Workspace | None = None, spans: np.ndarray | None = None) -> Loss:
    """Mean structural similarity (1 for equal images): 11x11 gaussian window, sigma 1.5, zero padding, data range 1.

    image, target, gradient: (H, W, 3); weights: (H, W); spans: (H, 2) int.
    """
    job = _Crop(image, target, box, weights, gradient, workspace, spans)
    scratch = job.take("ssim_scratch", (job.workspace.workers, _ssim.SCRATCH))
    sums = np.empty((job.height, -(-job.count // _ssim.STRIP)), job.real)
    job.workspace.share(_ssim.similarity, *job.place, job.height, job.count, job.shares, job.spans, job.real.type(factor),
                        scratch, job.flat_gradient, sums)
    return Loss(float(sums.sum(dtype=np.float64)), job.gradient)


def sobel(image: np.ndarray, target: np.ndarray, box: Box | None = None, weights: np.ndarray | None = None, factor: float = 1.0,
          gradient: np.ndarray | None = None, workspace: Workspace | None = None) -> Loss:
    """Mean over pixels and channels of the squared difference of Sobel responses, summed over the two directions.

    image, target, gradient: (H, W, 3); weights: (H, W).
    """
    job = _Crop(image, target, box, weights, gradient, workspace)
    padded = job.take("sobel_difference", (job.height + 2, job.stride))
    across, down = (job.take(name, (job.height + 2, job.stride)) for name in ("sobel_across", "sobel_down"))
    sums = np.empty(job.height, job.real)
    tail = job.take("sobel_tail", (job.workspace.workers, WIDTH))
    job.workspace.share(_sobel.difference, *job.place, job.height, job.count, padded)
    job.workspace.share(_sobel.responses, padded, job.shares, across, down, sums)
    job.workspace.share(_sobel.responses_backward, across, down, job.real.type(factor), job.pitch, job.start, job.count, tail,
                        job.flat_gradient)
    return Loss(float(sums.sum(dtype=np.float64)), job.gradient)


class _Crop:
    """Images, weights and box as the kernels take them: flat arrays, start of the crop, numbers (3 a pixel) of a row."""

    def __init__(self, image: np.ndarray, target: np.ndarray, box: Box | None, weights: np.ndarray | None,
                 gradient: np.ndarray | None, workspace: Workspace | None, spans: np.ndarray | None = None):
        self.real = np.dtype(np.float64 if image.dtype == np.float64 else np.float32)
        self.workspace = workspace or Workspace()
        rows, columns, channels = image.shape
        if channels != 3 or target.shape != image.shape:
            raise ValueError(f"image {image.shape} and target {target.shape} must both be (H, W, 3)")
        top, bottom, left, right = box or (0, rows, 0, columns)
        if not (0 <= top < bottom <= rows and 0 <= left < right <= columns):
            raise ValueError(f"box {box} (top, bottom, left, right) is empty or leaves the {rows}x{columns} image")
        self.gradient = np.zeros(image.shape, self.real) if gradient is None else gradient
        if self.gradient.shape != image.shape or self.gradient.dtype != self.real or not self.gradient.flags.c_contiguous:
            raise ValueError(f"gradient must be a contiguous {self.real} array of shape {image.shape}")
        self.pitch, self.start = 3 * columns, 3 * (top * columns + left)
        self.height, self.count = bottom - top, 3 * (right - left)
        self.stride = -(-self.count // WIDTH) * WIDTH + 2 * MARGIN
        flat = [np.require(a, self.real, ["C", "W"]).reshape(-1) for a in (image, target)]
        self.place = (*flat, self.pitch, self.start)
        self.flat_gradient = self.gradient.reshape(-1)
        self.spans = np.empty((self.height, 2), np.int64)
        self.spans[:] = (0, self.count) if spans is None else np.clip(3 * (spans[top:bottom] - left), 0, self.count)
        self.shares = self._shares(None if weights is None else weights[top:bottom, left:right])

    def _shares(self, weights: np.ndarray | None) -> np.ndarray:
        """(1 or height, stride) share of each number in the mean; zero in the margins."""
        shares = self.take("shares", (1 if weights is None else self.height, self.stride))
        shares[:, :MARGIN] = 0
        shares[:, MARGIN + self.count:] = 0
        if weights is None:
            shares[:, MARGIN:MARGIN + self.count] = 1 / (self.height * self.count)
        else:
            norm = weights / max(3 * float(weights.sum(dtype=np.float64)), 1e-12)
            shares[:, MARGIN:MARGIN + self.count] = np.repeat(norm, 3, axis=1)
        return shares

    def take(self, name: str, shape: tuple[int, ...]) -> np.ndarray:
        return self.workspace.take(name, shape, self.real)


@kernel
def _squares(worker, workers, image, target, pitch, start, count, shares, spans, factor, tails, gradient, sums):
    """spans: (height, 2) first and end number of a row that may differ."""
    real = image.dtype.type
    twice = real(2) * factor
    tail = tails[worker]
    for row in range(worker, len(sums), workers):
        share_row = shares[min(row, len(shares) - 1)]
        value = spread(real(0))
        rest = real(0)
        for i in range(spans[row, 0] // WIDTH * WIDTH, spans[row, 1], WIDTH):
            at = start + row * pitch + i
            part = load(share_row, MARGIN + i)
            if i + WIDTH <= count:
                d = load(image, at) - load(target, at)
                value = value + d * d * part
                store(gradient, at, load(gradient, at) + d * part * twice)
            else:
                store(tail, 0, part)
                for j in range(count - i):
                    e = image[at + j] - target[at + j]
                    rest += e * e * tail[j]
                    gradient[at + j] += e * tail[j] * twice
        sums[row] = total(value) + rest
