"""Reads a pickle of arrays and plain values and runs nothing of it: what it would import is refused, but for numpy's arrays.

Those are put together here from the bytes that the pickle holds, by none of numpy's own unpickling.
"""

from __future__ import annotations

import io
import pickle
from pathlib import Path
from typing import Any

import numpy as np

from gsac.stages.contract import BadInput

MOST_BYTES = 64 << 20
"""Of a file: more is no camera and no pose."""
KINDS = "biuf"
"""Kinds of numbers that arrays may hold."""


def read_pickle(path: Path) -> Any:
    """Its value: numbers, text, lists, dictionaries and arrays (...) of numbers. Raises BadInput for anything else."""
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise BadInput(f"{path}: has {size} bytes; a file of cameras or poses has at most {MOST_BYTES}")
    try:
        return _plain(_Reader(io.BytesIO(path.read_bytes()), encoding="latin1").load(), 0)
    except BadInput:
        raise
    except _RefusedError as e:
        raise BadInput(f"{path}: {e}; a pickle may run any code when it is read, so only plain values and arrays are taken. "
                       "Download the file again from where the data set is given out") from e
    except Exception as e:  # a damaged pickle makes the reader raise nearly anything
        raise BadInput(f"{path}: is no pickle that can be read ({e or type(e).__name__}); download it again") from e


class _RefusedError(Exception):
    """Something that a plain file does not hold."""


class _Kind:
    """Stands for numpy.dtype."""

    def __init__(self, text: Any, *_: Any):
        if not isinstance(text, str) or len(text) > 4 or np.dtype(text).kind not in KINDS:
            raise _RefusedError(f"it holds an array of {text!r}")
        self.kind = np.dtype(text)

    def __setstate__(self, state: tuple) -> None:
        if state[1] in ("<", ">"):
            self.kind = self.kind.newbyteorder(state[1])


class _Array:
    """Stands for numpy.ndarray."""

    values: np.ndarray | None = None

    def __setstate__(self, state: tuple) -> None:
        _, shape, kind, by_columns, data = state
        self.values = _make(data, kind, shape, "F" if by_columns else "C")


def _make(data: Any, kind: Any, shape: tuple[int, ...], order: str = "C") -> np.ndarray:
    data = data.encode("latin1") if isinstance(data, str) else bytes(data) if isinstance(data, (bytes, bytearray)) else None
    if data is None or not isinstance(kind, _Kind):
        raise _RefusedError("it holds an array of no numbers")
    return np.frombuffer(data, kind.kind).reshape(shape, order="F" if order == "F" else "C").copy()


def _from_buffer(data: Any, kind: Any, shape: tuple[int, ...], order: str) -> _Array:
    array = _Array()
    array.values = _make(data, kind, shape, order)
    return array


def _scalar(kind: Any, data: Any) -> Any:
    return _make(data, kind, ())[()].item()


def _encode(text: Any, codec: Any = "latin1") -> bytes:
    if codec != "latin1" or not isinstance(text, str):
        raise _RefusedError(f"it asks for the codec {codec!r}")
    return text.encode("latin1")


STAND_INS: dict[str, Any] = {
    "numpy.ndarray": _Array, "numpy.dtype": _Kind, "_codecs.encode": _encode,
    **{f"numpy.{core}.{name}": what for core in ("core", "_core") for name, what in (
        ("multiarray._reconstruct", lambda *_: _Array()), ("multiarray.scalar", _scalar), ("numeric._frombuffer", _from_buffer))},
}
"""What a pickle of arrays asks for -> what it gets."""


class _Reader(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if f"{module}.{name}" not in STAND_INS:
            raise _RefusedError(f"it asks for {module}.{name}")
        return STAND_INS[f"{module}.{name}"]

    def persistent_load(self, pid: Any) -> Any:
        raise _RefusedError("it points outside of itself")


def _plain(value: Any, depth: int) -> Any:
    if depth > 32:
        raise _RefusedError("it is nested too deep")
    if isinstance(value, _Array) and value.values is not None:
        return value.values
    if isinstance(value, dict):
        return {_plain(key, depth + 1): _plain(inner, depth + 1) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return type(value)(_plain(inner, depth + 1) for inner in value)
    if value is None or isinstance(value, (bool, int, float, str, bytes)):
        return value
    raise _RefusedError(f"it holds a {type(value).__name__.strip('_')}")
