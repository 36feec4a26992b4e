"""Decorators that compile our numba kernels.

numba's disk cache checks only size and time of a kernel's file, and nothing of the kernels and constants that it takes from other
files. A digest of them in the kernel's name keeps it from running old code after an edit.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba

SOURCES = ("numba_kernel.py", "draw_rule.py", "simd.py", "binding.py", "losses.py", "ssim.py", "sobel.py",
           "raster/project.py", "raster/tiles.py", "raster/forward.py", "raster/backward.py")
"""Files under this folder that hold kernels or their constants."""


def digest(folder: Path) -> str:
    """Hex digest of the content of `SOURCES` under a folder."""
    return hashlib.sha256(b"\0".join((folder / name).read_bytes() for name in SOURCES)).hexdigest()[:12]


DIGEST = digest(Path(__file__).parent)


def own_kernel(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compiles a kernel that takes nothing from other files of ours, at the first call for each set of types, cached on disk.

    options: of numba.njit.
    """
    def compiled(function: Callable[..., Any]) -> Any:
        function.__qualname__ += f"_{_file_digest(function.__code__.co_filename)}"
        return numba.njit(cache=True, **options)(function)

    return compiled


@cache
def _file_digest(path: str) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()[:12]


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compiles at the first call for each set of types, cached on disk; releases the GIL, fuses a * b + c, x / 0 is inf."""
    function.__qualname__ += f"_{DIGEST}"
    return numba.njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")(function)
