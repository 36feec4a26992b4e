"""A network of one input and one output that a user brings, as ONNX or as TorchScript, whichever the file is."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gsac.avatar.cuda import stays_on_cpu
from gsac.avatar.onnx_network import NetworkError, open_network, run_checked, run_session

Shape = list[int | str | None]
"""Lengths; a name or None stands for any length."""


@dataclass(frozen=True)
class BroughtNetwork:
    """An open network."""

    run: Callable[[np.ndarray], np.ndarray]
    """(...) float32 -> its output (...) float32. Raises NetworkError where it cannot be run, or gives NaN."""
    given: Shape | None
    """Of its input; None where the file does not tell, as TorchScript."""
    gives: Shape | None
    """Of its output, likewise."""

    def may_be(self, given: Shape, gives: Shape) -> bool:
        """Whether these may be its shapes, as far as the file tells."""
        return all(told is None or shape_fits(told, wanted) for told, wanted in ((self.given, given), (self.gives, gives)))


def open_brought(path: Path, name: str) -> BroughtNetwork:
    """Opens the file that was brought under a name. Raises NetworkError where it is neither ONNX nor TorchScript."""
    network = _open_torchscript(path, name) if zipfile.is_zipfile(path) else _open_onnx(path, name)
    return replace(network, run=lambda ready: run_checked(lambda given: [network.run(given)], ready, name)[0])


def _open_onnx(path: Path, name: str) -> BroughtNetwork:
    session = open_network(path, name)
    given, gives = session.get_inputs()[0], session.get_outputs()[0]
    return BroughtNetwork(lambda ready: run_session(session, ready)[0], given.shape, gives.shape)


def _open_torchscript(path: Path, name: str) -> BroughtNetwork:
    import torch

    device = "cuda" if torch.cuda.is_available() and not stays_on_cpu() else "cpu"
    try:
        network = torch.jit.load(str(path), map_location=device).eval()
    except (RuntimeError, ValueError) as e:
        raise NetworkError(f"model file {name} is neither ONNX nor TorchScript ({str(e).splitlines()[0]}); weights alone, or what "
                           f"torch.export wrote, do not do; bring it again with `gsac models add {name} FILE`") from e
    kind = next((weight.dtype for weight in network.parameters()), torch.float32)

    def run(ready: np.ndarray) -> np.ndarray:
        with torch.inference_mode():
            out = network(torch.from_numpy(ready).to(device, kind))
        if not isinstance(out, torch.Tensor):
            raise NetworkError(f"model file {name} gives a {type(out).__name__}, not one array")
        return out.float().cpu().numpy()

    return BroughtNetwork(run, None, None)


def shape_fits(told: Shape, wanted: Shape) -> bool:
    """Whether a shape that a file tells may be the wanted one."""
    return len(told) == len(wanted) and all(
        have == want for have, want in zip(told, wanted, strict=True) if isinstance(have, int) and want is not None)
