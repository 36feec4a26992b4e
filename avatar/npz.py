"""Reads npz files that anybody may have written: what an array says of itself is checked before it is unpacked; no code is run."""

from __future__ import annotations

import io
import math
import struct
import zipfile
from collections.abc import Collection
from pathlib import Path
from typing import IO

import numpy as np

MOST_BYTES = 640 << 20
"""Of all arrays that are read from one file, unpacked."""
MOST_MEMBERS = 10_000
MOST_DIRECTORY = 4 << 20
"""Bytes of a zip's list of members, which is read whole."""
END = struct.Struct("<4s8xI4xH")
"""What ends a zip: its mark, bytes of the list, bytes of the comment after it."""
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
        with open_zip(path) as file:
            return _read_members(file, names, objects)
    except (NpzError, FileNotFoundError, IsADirectoryError, PermissionError):
        raise
    except MemoryError as e:
        raise NpzError("its arrays do not fit into the memory") from e
    except Exception as e:  # zipfile and numpy raise nearly anything on a damaged file
        raise NpzError(str(e) or type(e).__name__) from e


def open_zip(path: Path) -> zipfile.ZipFile:
    """The zip of that path. Raises NpzError where its list of members is larger than MOST_DIRECTORY, else as zipfile does."""
    with open(path, "rb") as file:
        file.seek(max(0, file.seek(0, io.SEEK_END) - END.size - 0xFFFF))
        end = file.read()
    at = end.rfind(b"PK\x05\x06")
    if 0 <= at <= len(end) - END.size:
        size = END.unpack_from(end, at)[1]
        if size > MOST_DIRECTORY:
            raise NpzError(f"its list of arrays has {size} bytes; at most {MOST_DIRECTORY} are read")
    return zipfile.ZipFile(path)


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
    try:
        shape, _, dtype = np.lib.format.read_array_header_1_0(stream)
    except Exception as e:  # the header is Python's text: it raises what its parsers do
        raise NpzError(f"array {name} has a header that cannot be read; was the file damaged?") from e
    if dtype.hasobject:
        return True
    if not all(type(n) is int and n >= 0 for n in shape) or math.prod(shape) > MOST_BYTES:
        raise NpzError(f"array {name} says its shape is {shape}; expected lengths, at most {MOST_BYTES} numbers in all")
    says, has = math.prod(shape) * dtype.itemsize, size - stream.tell()
    if says != has:
        raise NpzError(f"array {name} says {says} bytes and has {has}; was the file cut off?")
    return False
