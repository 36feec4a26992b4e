"""Reads npz files that anybody may have written: what an array says of itself is checked before it is unpacked; no code is run."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Collection
from pathlib import Path
from typing import IO

import numpy as np

MOST_BYTES = 640 << 20
"""Of all arrays that are read from one file, unpacked."""
MOST_MEMBERS = 10_000
SUFFIX = ".npy"
ENCRYPTED = 0x1
"""Bit of a member's flags."""
PLAIN = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""How numpy stores its arrays."""


class NpzError(ValueError):
    """What is wrong with an npz, without the file's name."""


def read_npz(path: Path, names: Collection[str] | None = None, objects: bool = True) -> dict[str, np.ndarray]:
    """Arrays (...) of an npz by name, in the file's order. Raises NpzError, or OSError where the file cannot be read at all.

    names: read no others; one that is not there is left out. objects: an array of Python objects, which is never read, is an error;
    False: it is left out.
    """
    try:
        with zipfile.ZipFile(path) as file:
            return _read_members(file, names, objects)
    except (NpzError, FileNotFoundError, IsADirectoryError, PermissionError):
        raise
    except MemoryError as e:
        raise NpzError("its arrays do not fit into the memory") from e
    except Exception as e:  # zipfile and numpy raise nearly anything on a damaged file
        raise NpzError(str(e) or type(e).__name__) from e


def _read_members(file: zipfile.ZipFile, names: Collection[str] | None, objects: bool) -> dict[str, np.ndarray]:
    members = file.infolist()
    if len(members) > MOST_MEMBERS:
        raise NpzError(f"it holds {len(members)} arrays; at most {MOST_MEMBERS} are read")
    wanted = [m for m in members if names is None or m.filename.removesuffix(SUFFIX) in names]
    total = sum(m.file_size for m in wanted)
    if total > MOST_BYTES:
        raise NpzError(f"its arrays have {total} bytes when unpacked; at most {MOST_BYTES} are read")
    arrays = {}
    for member in wanted:
        name = member.filename.removesuffix(SUFFIX)
        if name == member.filename:
            raise NpzError(f"{name!r} in it is no array ({SUFFIX}); save the arrays alone, with numpy.savez")
        if member.flag_bits & ENCRYPTED or member.compress_type not in PLAIN:
            how = "encrypted" if member.flag_bits & ENCRYPTED else f"packed by method {member.compress_type}"
            raise NpzError(f"array {name} is {how}; save it with numpy.savez or numpy.savez_compressed")
        with file.open(member) as stream:
            holds_objects = _check_header(stream, name, member.file_size)
        if holds_objects and objects:
            raise NpzError(f"array {name} is a pickled object, which may run code when read; save it as a plain array")
        if not holds_objects:
            with file.open(member) as stream:
                arrays[name] = np.lib.format.read_array(stream, allow_pickle=False)
    return arrays


def _check_header(stream: IO[bytes], name: str, size: int) -> bool:
    """Whether the array holds objects. Raises NpzError unless its header says as many bytes as the member has; size: bytes."""
    version = np.lib.format.read_magic(stream)
    if version != (1, 0):  # the others are for structures, and their headers have no bound
        raise NpzError(f"array {name} is of npy version {version[0]}.{version[1]}; save it as a plain array of numbers or text")
    shape, _, dtype = np.lib.format.read_array_header_1_0(stream)
    if dtype.hasobject:
        return True
    if not all(type(n) is int and n >= 0 for n in shape) or math.prod(shape) > MOST_BYTES:
        raise NpzError(f"array {name} says its shape is {shape}; expected lengths, at most {MOST_BYTES} numbers in all")
    says, has = math.prod(shape) * dtype.itemsize, size - stream.tell()
    if says != has:
        raise NpzError(f"array {name} says {says} bytes and has {has}; was the file cut off?")
    return False
