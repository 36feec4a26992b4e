"""The CUDA path of training: every step on the GPU, kernels compiled at first use by NVRTC.

`why_not()` gives the reason why it cannot run here, or None; `trainer.CudaTrainer` is the driver. Importing costs nothing.
"""

from __future__ import annotations

import os
from functools import cache

DEVICE = "GSAC_DEVICE"
"""Environment variable: `cpu` or `cuda`, instead of the device that is found."""


@cache
def why_not() -> str | None:
    """None where a GPU can be used, else what is missing and what to do."""
    try:
        from cuda.bindings import driver, nvrtc  # noqa: F401
    except ImportError:
        return 'the CUDA path needs the packages of `pip install -e ".[gpu]"` in the checkout (cuda-bindings, nvidia-cuda-nvrtc)'
    try:
        error, = driver.cuInit(0)
    except RuntimeError as missing:
        return f"there is no NVIDIA driver on this machine ({missing})"
    if error != driver.CUresult.CUDA_SUCCESS:
        return f"there is no NVIDIA GPU that this process may use ({error.name})"
    return None


def stays_on_cpu() -> bool:
    """Whether networks that users bring compute on the CPU: GSAC_DEVICE says so, or says nothing, and there is no GPU for the CUDA
    path. A stage's key names the same device."""
    named = os.environ.get(DEVICE)
    return named == "cpu" or not named and why_not() is not None
