"""Networks that a user brings as ONNX files, run by onnxruntime: on the GPU where its provider is installed and GSAC_DEVICE allows
it, else on the CPU."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from gsac.avatar.cuda import is_forbidden

if TYPE_CHECKING:
    from onnxruntime import InferenceSession

PREFERRED = ("CUDAExecutionProvider", "CPUExecutionProvider")
"""Providers, best first."""


class NetworkError(ValueError):
    """A brought file is not a network that can be run. The message names it and says what to do."""


def open_network(path: Path, name: str, threads: int = 0) -> InferenceSession:
    """Opens the ONNX file that was brought under a name, or the one in a folder where its weights lie beside it.

    threads: of the CPU; 0: as many as onnxruntime likes. Raises NetworkError where the file cannot be read.
    """
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    here = PREFERRED[-1:] if is_forbidden() else onnxruntime.get_available_providers()
    if path.is_dir():
        path = next(path.glob("*.onnx"), path)
    try:
        return onnxruntime.InferenceSession(str(path), options, providers=[p for p in PREFERRED if p in here])
    except Exception as error:  # onnxruntime's own classes share no narrower base
        raise NetworkError(f"model file {name} cannot be read as ONNX ({error}); bring it again with "
                           f"`gsac models add {name} FILE`") from error
