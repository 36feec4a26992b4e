"""Cost of long lists in the kernel `blend`: its time without sorting, and with every tile's list truncated."""

from __future__ import annotations

from functools import cache

import numpy as np

from gsac.avatar.cuda.device import Device
from gsac.avatar.cuda.kernels import KERNELS, compile_source, cubin, source
from gsac.avatar.cuda.trainer import CudaTrainer
from gsac.benchmarks.gpu.timing import kernel_microseconds

LENGTH, SORT = "n = s.tile_count[tile];\n        const Now &now = s.now[b];", "sort(sorted, n);"
CUTS = (384, 256, 128)
"""Lengths of truncated lists."""


@cache
def compile_variants(architecture: str) -> dict[str, bytes]:
    """Machine code of each variant of the kernels."""
    text = source()
    changed = {"unsorted": text.replace(SORT, "")}
    for most in CUTS:
        changed[f"cut at {most}"] = text.replace(LENGTH, LENGTH.replace("s.tile_count[tile]", f"min(s.tile_count[tile], {most})"))
    return {"as it is": cubin(architecture)} | {name: compile_source(other, architecture) for name, other in changed.items()}


def measure(trainer: CudaTrainer, device: Device) -> None:
    """Prints a line. The trainer cannot be used afterwards; the device gets its kernels back."""
    gaussians, codes = trainer.gaussians(), compile_variants(device.architecture)
    lists = trainer.buffers["tile_count"].read()
    lists = lists[lists > 0]
    found = {}
    for name, code in codes.items():
        device.load(code, KERNELS)
        trainer._forget_graph()
        trainer.replace(gaussians)
        found[name] = kernel_microseconds(trainer)["blend"]
    device.load(codes["as it is"], KERNELS)
    print(f"blend, {trainer.count} gaussians, batch {trainer.batch}, lists of {np.median(lists):.0f} (median), "
          f"{np.percentile(lists, 99):.0f} (99 %), {lists.max()} (longest): "
          + ", ".join(f"{name} {us:.1f} us" for name, us in found.items()), flush=True)
