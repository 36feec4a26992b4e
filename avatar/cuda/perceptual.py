"""LPIPS of windows of the images, for the loss: value and gradient by torch's convolutions, recorded as a graph.

The kernel `cut_window` fills `Windows.images`, `image_gradient` adds `Windows.slopes`; nothing waits for the host in between.
"""

from __future__ import annotations

from functools import cache

from gsac.avatar.cuda.device import Device
from gsac.avatar.feature_distance import FeatureDistance

SIDE = 256
"""px, side of the window at most; a smaller frame is taken whole."""
WARM = 3
"""Runs before the recording, in which libraries choose and load their kernels."""


@cache
def why_not() -> str | None:
    """None where torch can use the GPU, else what is missing and what to do."""
    import torch

    if torch.cuda.is_available():
        return None
    return f"the torch {torch.__version__} that is installed cannot use the GPU; install a build for CUDA from pytorch.org"


class Windows:
    """images: (count, 2, height, width, 3), renders and targets in 0..1; values: (count,) LPIPS; slopes, by the renders:
    (count, height, width, 3)."""

    def __init__(self, device: Device, network: FeatureDistance, size: tuple[int, int, int], precision: str = "bfloat16"):
        """size: count, height and width, px; precision: torch's name of the convolutions' type."""
        import torch

        self._torch, self.network, self.size = torch, network.to("cuda", getattr(torch, precision)), size
        count, height, width = size
        self.images = torch.zeros((count, 2, height, width, 3), device="cuda")
        self.slopes, self.values = torch.zeros((count, height, width, 3), device="cuda"), torch.zeros(count, device="cuda")
        self.stream = torch.cuda.ExternalStream(int(device.stream))
        self._graph = torch.cuda.CUDAGraph()
        # deterministic: one seed gives one avatar
        with torch.backends.cudnn.flags(enabled=True, benchmark=False, deterministic=True, allow_tf32=False):
            with torch.cuda.stream(torch.cuda.Stream()):
                for _ in range(WARM):
                    self._compute()
            torch.cuda.synchronize()
            with torch.cuda.graph(self._graph):
                self._compute()

    def launch(self) -> None:
        """Puts the work into the device's stream."""
        with self._torch.cuda.stream(self.stream):
            self._graph.replay()

    def _compute(self) -> None:
        for (render, target), slope, value in zip(self.images, self.slopes, self.values, strict=True):
            image = render.detach().requires_grad_()
            found = self.network.compare(image, target)
            slope.copy_(self._torch.autograd.grad(found, image)[0])
            value.copy_(found.detach())
