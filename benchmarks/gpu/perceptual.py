"""LPIPS of a window on the GPU: its time, and the error of its gradient against the CPU's, by precision. Weights are random."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from gsac.avatar.cuda import perceptual
from gsac.avatar.cuda.device import Device
from gsac.avatar.cuda.perceptual import SIDE, Windows
from gsac.avatar.lpips import Lpips, shapes

PRECISIONS = ("float32", "float16", "bfloat16")
NAME = "lpips-vgg"


def make_network(seed: int = 0) -> Lpips:
    """The network with random weights that preserve the features' magnitude from layer to layer."""
    rng = np.random.default_rng(seed)

    def weights(name: str, shape: tuple[int, ...]) -> np.ndarray:
        if name.startswith("lin"):
            return rng.random(shape)
        return rng.normal(size=shape) * (0.1 if len(shape) == 1 else np.sqrt(2 / np.prod(shape[1:])))

    return Lpips(NAME, {name: np.float32(weights(name, shape)) for name, shape in shapes(NAME).items()})


def measure(device: Device) -> None:
    """Prints a line for each precision."""
    if why := perceptual.why_not():
        print(f"LPIPS: {why}")
        return
    import torch

    network, rng = make_network(), np.random.default_rng(1)
    image, other = np.float32(rng.random((2, SIDE, SIDE, 3)))
    value, slope = network.gradient(image, other, scaled=False)
    for precision in PRECISIONS:
        began = perf_counter()
        windows = Windows(device, network, (1, SIDE, SIDE), precision)
        made = perf_counter() - began
        windows.images.copy_(torch.from_numpy(np.stack([image, other])))
        torch.cuda.synchronize()
        begin, end, times = device.event(), device.event(), []
        for _ in range(30):
            device.mark(begin)
            windows.launch()
            device.mark(end)
            times.append(device.milliseconds(begin, end))
        own = windows.slopes[0].cpu().numpy()
        off, size = np.linalg.norm(own - slope), np.linalg.norm(slope)
        print(f"LPIPS of {SIDE}x{SIDE}, {precision}: {np.median(times):.2f} ms, ready after {made:.1f} s; value off by "
              f"{abs(float(windows.values) / value - 1):.1e}, slope by {off / size:.1e}, cosine "
              f"{(own * slope).sum() / size / np.linalg.norm(own):.4f}", flush=True)
