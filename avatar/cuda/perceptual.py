"""LPIPS of a window of the image, for the loss of late steps: value and gradient by torch's convolutions, recorded as a graph.

The kernel `cut_window` fills `Window.images`, `image_gradient` adds `Window.slope`; nothing waits for the host in between.
"""

from __future__ import annotations

from functools import cache

from gsac.avatar.cuda.device import Device
from gsac.avatar.lpips import Lpips

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


class Window:
    """images: (2, height, width, 3), render and target in 0..1; value: scalar LPIPS; slope: (height, width, 3), by the render."""

    def __init__(self, device: Device, network: Lpips, width: int, height: int, precision: str = "bfloat16"):
        """width, height: px; precision: torch's name of the convolutions' type."""
        import torch

        self._torch, self.network = torch, network.to("cuda", getattr(torch, precision))
        self.images = torch.zeros((2, height, width, 3), device="cuda")
        self.slope, self.value = torch.zeros((height, width, 3), device="cuda"), torch.zeros((), device="cuda")
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
        image = self.images[0].detach().requires_grad_()
        value = self.network.compare(image, self.images[1])
        self.slope.copy_(self._torch.autograd.grad(value, image)[0])
        self.value.copy_(value.detach())
