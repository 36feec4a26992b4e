"""The CUDA path of training: every step on the GPU, kernels compiled at first use by NVRTC.

`why_not()` gives the reason why it cannot run here, or None; `trainer.CudaTrainer` is the driver. Importing costs nothing.
"""

from __future__ import annotations

from functools import cache


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
