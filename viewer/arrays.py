"""The arrays of avatar.gsac as the page holds them, so that they pack small: numbers less what is foretold of them, in planes of
bytes. arrays.js puts every byte back."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterator
from dataclasses import astuple, dataclass, replace

import numpy as np

from gsac.avatar.gsac_file.container import DTYPES, HEADER, GsacError, unpack
from gsac.avatar.gsac_file.write import UNIT

UNIT_QUAT = 32767
"""The whole number that stands for 1 in a quaternion."""
TRIED = 6
"""Effort of zlib when rules are compared."""
LONG = 2048
"""Bytes from which a part is worth codes of its own."""


@dataclass(frozen=True)
class Array:
    """Where an array's numbers lie in the file, and by which of the `RULES` they are foretold."""

    start: int
    """First byte."""
    rows: int
    columns: int
    width: int
    """Bytes a number."""
    rule: str = ""


def pack_arrays(container: bytes) -> tuple[bytes, list[tuple[int, int, int, int, str]]]:
    """avatar.gsac in zlib's form, its arrays packed; and where they lie, as arrays.js takes it. A broken file has none."""
    parts, arrays, end = [], [], 0
    for array in find_arrays(container):
        best, packed = min(_candidates(array, container), key=lambda candidate: len(_compress(candidate[1], TRIED)))
        parts += [container[end:array.start], *packed]
        end = array.start + array.rows * array.columns * array.width
        arrays.append(astuple(best))
    return _compress([*parts, container[end:]], 9), arrays


def find_arrays(container: bytes) -> list[Array]:
    """The arrays in avatar.gsac, as they follow one another; none where the file is broken."""
    try:
        head, _ = unpack(container)
    except GsacError:
        return []
    start, found = HEADER.size + HEADER.unpack_from(container)[2], []
    for entry in head["blocks"].values():
        rows, *columns = entry["shape"] or [1]
        found.append(Array(start + entry["offset"], rows, math.prod(columns), np.dtype(DTYPES[entry["dtype"]]).itemsize))
    return sorted(found, key=lambda array: array.start)


def _candidates(array: Array, container: bytes) -> Iterator[tuple[Array, list[bytes]]]:
    """The array with each rule that can be used on it, as it stands and as one column, and its planes by that rule."""
    count = array.rows * array.columns
    numbers = np.frombuffer(container, f"<u{array.width}", count, array.start)
    for columns in {array.columns or 1, 1}:
        shaped = replace(array, rows=count // columns, columns=columns)
        for rule, foretell in RULES.items():
            left = foretell(numbers.reshape(-1, columns))
            if left is not None:
                yield replace(shaped, rule=rule), _planes(left)


def _planes(numbers: np.ndarray) -> list[bytes]:
    """The first byte of all numbers (rows, columns), column after column, then the second: what is alike lies together."""
    rows, columns = numbers.shape
    planes = np.ascontiguousarray(numbers).view(np.uint8).reshape(rows, columns, numbers.itemsize).transpose(2, 1, 0)
    return [plane.tobytes() for plane in planes]


def _compress(parts: list[bytes], effort: int) -> bytes:
    """The parts, one after the other, in zlib's form; a long one has codes of its own, by how often each byte stands in it."""
    packer, out = zlib.compressobj(effort), []
    for part in parts:
        out.append(packer.compress(part))
        if len(part) > LONG:
            out.append(packer.flush(zlib.Z_BLOCK))
    return b"".join([*out, packer.flush()])


def _fold(difference: np.ndarray) -> np.ndarray:
    """Whole numbers that wrap around, as small ones where they lie near zero on either side: 0, -1, 1, -2 become 0, 1, 2, 3."""
    signed = difference.view(f"<i{difference.itemsize}")
    return (difference << 1) ^ (signed >> (8 * difference.itemsize - 1)).view(difference.dtype)


def _rise(numbers: np.ndarray) -> np.ndarray:
    """Each number less the one above it."""
    return _fold(np.diff(numbers, axis=0, prepend=numbers.dtype.type(0)))


def _share(numbers: np.ndarray) -> np.ndarray | None:
    """The first column less what the others leave of the whole, of skin weights."""
    if numbers.dtype != "<u2" or numbers.shape[1] < 2:
        return None
    return np.column_stack([_fold(numbers[:, 0] + numbers[:, 1:].sum(1, dtype=numbers.dtype) - np.uint16(UNIT)), numbers[:, 1:]])


def _turn(numbers: np.ndarray) -> np.ndarray | None:
    """The length of the first column less what makes the row that of a quaternion; its sign is the lowest bit."""
    if numbers.dtype != "<u2" or numbers.shape[1] != 4:
        return None
    signed = numbers.view("<i2").astype(np.int64)
    rest = UNIT_QUAT ** 2 - (signed[:, 1:] ** 2).sum(1)
    left = _fold(abs(signed[:, 0]) - np.floor(np.sqrt(np.maximum(rest, 0)) + 0.5).astype(np.int64)) << 1 | (signed[:, 0] < 0)
    return np.column_stack([left, numbers[:, 1:]]).astype(numbers.dtype) if left.max(initial=0) <= UNIT else None


RULES: dict[str, Callable[[np.ndarray], np.ndarray | None]] = {
    "": lambda numbers: numbers, "rise": _rise, "share": _share, "turn": _turn}
"""Name -> function of (rows, columns) unsigned numbers that gives what is left of them, or None where it is of no use."""
