"""Networks that a user brings as ONNX files, run by onnxruntime: on the GPU where there is one for the CUDA path, its provider is
installed and GSAC_DEVICE allows it, else on the CPU."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gsac.avatar.cuda import stays_on_cpu

if TYPE_CHECKING:
    from onnxruntime import InferenceSession

PREFERRED = ("CUDAExecutionProvider", "CPUExecutionProvider")
"""Providers, best first."""


class NetworkError(ValueError):
    """A brought file is not a network that can be run. The message names it and says what to do."""


def run_checked(run: Callable[[np.ndarray], list[np.ndarray]], ready: np.ndarray, name: str) -> list[np.ndarray]:
    """What the network that was brought under a name makes of an input, arrays (...). Raises NetworkError where it cannot be run on
    it, or gives NaN. run: takes an array (...), gives several (...); ready: (...)."""
    try:
        outputs = run(ready)
    except NetworkError:
        raise
    except Exception as error:  # onnxruntime's and torch's own classes share no narrower base
        said = " ".join(str(error).strip().splitlines()[-3:]) or type(error).__name__
        raise NetworkError(f"model file {name} cannot be run on an input of shape {list(ready.shape)} ({said}); export it for one "
                           f"picture at a time, then `gsac models add {name} FILE --force`") from error
    if any(np.isnan(output).any() for output in outputs):
        raise NetworkError(f"model file {name} gives numbers that are none (NaN); export it again, in 32 bits if it has 16")
    return outputs


def run_session(session: InferenceSession, ready: np.ndarray) -> list[np.ndarray]:
    """All outputs (...) float32 for the one input, in the kind of number that the network takes. ready: (...)."""
    given = session.get_inputs()[0]
    kind = np.float16 if given.type == "tensor(float16)" else np.float32
    return [np.asarray(output, np.float32) for output in session.run(None, {given.name: ready.astype(kind)})]


def open_network(path: Path, name: str, threads: int = 0) -> InferenceSession:
    """Opens the ONNX file that was brought under a name, or the one in a folder where its weights lie beside it.

    threads: of the CPU, which alone is used then; 0: as many as onnxruntime likes, or the GPU. Raises NetworkError where the file
    cannot be read.
    """
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.enable_mem_pattern = False  # a plan for each size of picture, and those of people differ: 150 MB a thread
    here = PREFERRED[-1:] if threads or stays_on_cpu() else onnxruntime.get_available_providers()
    if path.is_dir():
        path = next(path.glob("*.onnx"), path)
    try:
        return onnxruntime.InferenceSession(str(path), options, providers=[p for p in PREFERRED if p in here])
    except Exception as error:  # onnxruntime's own classes share no narrower base
        raise NetworkError(f"model file {name} cannot be read as ONNX ({error}); bring it again with "
                           f"`gsac models add {name} FILE`") from error
