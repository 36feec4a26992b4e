"""The bytes of `avatar.gsac`: a fixed header, a JSON head, aligned little-endian blocks (docs/gsac-format.md).

Only bytes are known here; `read.py` and `rigged.py` know what the blocks mean. Nothing in a file is believed before it is checked:
a bad file raises `GsacError` with one `Fault`, and memory stays in proportion to the file's real size.
"""

from __future__ import annotations

import json
import math
import struct
import zlib
from enum import Enum
from pathlib import Path

import numpy as np

from gsac.avatar.artifacts import ArtifactError

MAGIC = b"GSAC\r\n\x1a\n"
VERSION = 1
HEADER = struct.Struct("<8sIIQII")
"""magic, version, bytes of the head, bytes of the file, crc32 of all that follows the header, zero."""
ALIGN = 16
MAX_FILE = 256 << 20
MAX_HEAD = 1 << 20
MAX_BLOCKS = 1024
MAX_DEPTH = 100
"""Lists and tables of the head around one value."""
MAX_AXES = 4
MAX_LENGTH = 1 << 26
DTYPES = {"f32": "<f4", "f16": "<f2", "u8": "u1", "u16": "<u2", "u32": "<u4", "i16": "<i2"}


class Fault(Enum):
    """Kinds of bad files; the readers in all languages use these names."""

    NOT_GSAC = "it does not begin with the GSAC magic bytes"
    VERSION = "its format version is not one that this reader knows"
    TRUNCATED = "it is shorter than its header says"
    OVERSIZED = "it is longer than its header says, or than this reader accepts"
    CHECKSUM = "its content does not match its checksum"
    HEAD = "its head is not the JSON that the format asks for"
    BLOCK = "a block lies outside the file, overlaps another, or has a bad type or shape"
    VALUE = "a value breaks what the format promises"


class GsacError(ArtifactError):
    """A `.gsac` file cannot be read. `fault` names the kind, the message names the file and the place."""

    def __init__(self, fault: Fault, where: str, detail: str) -> None:
        super().__init__(f"{where}: not a usable avatar ({fault.name.lower()}): {fault.value}; {detail}")
        self.fault = fault


def pack(head: dict, blocks: dict[str, np.ndarray], scales: dict[str, float] | None = None) -> bytes:
    """The bytes of a container; the same input gives the same bytes.

    head: JSON-able, without the key `blocks`
    blocks: name -> array (...) of a dtype in `DTYPES`
    scales: name -> factor that turns the stored integers into values
    """
    names = {np.dtype(v): k for k, v in DTYPES.items()}
    table, offset = {}, 0
    for name, array in blocks.items():
        code = names[array.dtype.newbyteorder("<")]
        table[name] = {"offset": offset, "dtype": code, "shape": list(array.shape)}
        if scales and name in scales:
            table[name]["scale"] = scales[name]
        offset = _aligned(offset + array.nbytes)
    text = json.dumps(head | {"blocks": table}, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (_aligned(HEADER.size + len(text)) - HEADER.size - len(text))
    body = bytearray(text)
    for array in blocks.values():
        raw = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<")).tobytes()
        body += raw + b"\0" * (_aligned(len(raw)) - len(raw))
    size = HEADER.size + len(body)
    return HEADER.pack(MAGIC, VERSION, len(text), size, zlib.crc32(body), 0) + bytes(body)


def unpack(data: bytes, where: str = "avatar.gsac") -> tuple[dict, dict[str, np.ndarray]]:
    """Head and blocks of a container.

    Returns the head (its `blocks` table included) and name -> read-only array (...): a view into `data` as stored, or
    float32 where the block carries a scale. Raises `GsacError`.
    """
    def bad(fault: Fault, detail: str) -> GsacError:
        return GsacError(fault, where, detail)

    if len(data) < HEADER.size:
        cut = data and MAGIC.startswith(bytes(data[:8]))
        raise bad(Fault.TRUNCATED if cut else Fault.NOT_GSAC, f"it has {len(data)} bytes")
    magic, version, head_bytes, file_bytes, crc, reserved = HEADER.unpack_from(data)
    if magic != MAGIC:
        raise bad(Fault.NOT_GSAC, f"it begins with {magic!r}")
    if version != VERSION:
        raise bad(Fault.VERSION, f"it has version {version}, this reader knows {VERSION}")
    if len(data) > MAX_FILE or file_bytes > MAX_FILE or len(data) > file_bytes:
        raise bad(Fault.OVERSIZED, f"{len(data)} bytes are there, {file_bytes} are said, {MAX_FILE} are accepted")
    if len(data) < file_bytes:
        raise bad(Fault.TRUNCATED, f"{len(data)} of {file_bytes} bytes are there")
    start = HEADER.size + head_bytes
    if head_bytes > MAX_HEAD or start > file_bytes or start % ALIGN or reserved:
        raise bad(Fault.HEAD, f"the header gives it {head_bytes} bytes")
    if zlib.crc32(memoryview(data)[HEADER.size:]) != crc:
        raise bad(Fault.CHECKSUM, "it was damaged after it was written")
    try:
        head = json.loads(bytes(data[HEADER.size:start]), parse_constant=_refuse)
    except (ValueError, RecursionError) as e:
        raise bad(Fault.HEAD, f"it does not parse ({type(e).__name__})") from e
    if _is_deep(head):
        raise bad(Fault.HEAD, f"it is nested more than {MAX_DEPTH} deep")
    if not isinstance(head, dict) or not isinstance(head.get("blocks"), dict):
        raise bad(Fault.HEAD, "it lacks the table `blocks`")
    if len(head["blocks"]) > MAX_BLOCKS:
        raise bad(Fault.BLOCK, f"it lists {len(head['blocks'])} blocks, {MAX_BLOCKS} are accepted")

    blocks, spans = {}, []
    for name, entry in head["blocks"].items():
        problem = _entry_problem(entry, file_bytes - start)
        if problem:
            raise bad(Fault.BLOCK, f"block {name!r} {problem}")
        dtype, shape = np.dtype(DTYPES[entry["dtype"]]), tuple(entry["shape"])
        count = math.prod(shape)
        array = np.frombuffer(data, dtype, count, start + entry["offset"]).reshape(shape)
        spans.append((entry["offset"], entry["offset"] + count * dtype.itemsize, name))
        if "scale" in entry:
            array = np.asarray(array.astype(np.float32) * np.float32(entry["scale"]))  # a block without axes would be a bare number
        array.flags.writeable = False
        blocks[name] = array
    spans.sort()
    for (_, end, first), (begin, _, second) in zip(spans, spans[1:], strict=False):
        if begin < end:
            raise bad(Fault.BLOCK, f"blocks {first!r} and {second!r} overlap")
    return head, blocks


def read_bytes(path: Path) -> bytes:
    """The file's bytes; a file that is too large is refused before it is read."""
    size = Path(path).stat().st_size
    if size > MAX_FILE:
        raise GsacError(Fault.OVERSIZED, str(path), f"it has {size} bytes, {MAX_FILE} are accepted")
    return Path(path).read_bytes()


def _aligned(n: int) -> int:
    return -(-n // ALIGN) * ALIGN


def _refuse(constant: str) -> float:
    raise ValueError(f"{constant} is not JSON")


def _is_deep(value: object) -> bool:
    """Whether a value lies in more than MAX_DEPTH lists and tables. Level by level: recursion has an end of its own."""
    level = [value]
    for _ in range(MAX_DEPTH + 1):
        level = [inner for outer in level if isinstance(outer, (dict, list))
                 for inner in (outer.values() if isinstance(outer, dict) else outer)]
    return bool(level)


def _entry_problem(entry: object, room: int) -> str | None:
    """Why a row of the block table cannot be believed, or None; room: bytes after the head."""
    if not isinstance(entry, dict):
        return "is not an object"
    shape, offset, scale = entry.get("shape"), entry.get("offset"), entry.get("scale", 1)
    if not isinstance(entry.get("dtype"), str) or entry["dtype"] not in DTYPES:
        return f"has dtype {str(entry.get('dtype'))[:40]!r}, known are {', '.join(DTYPES)}"
    if not isinstance(shape, list) or len(shape) > MAX_AXES or not all(
            type(n) is int and 0 <= n <= MAX_LENGTH for n in shape):
        return "has a shape that is not a short list of lengths"
    if type(offset) is not int or offset < 0 or offset % ALIGN:
        return f"has an offset that is not a multiple of {ALIGN}"
    if type(scale) not in (int, float) or not 0 < abs(scale) < 1e6:
        return "has a scale that is not a plain number"
    size = math.prod(shape) * np.dtype(DTYPES[entry["dtype"]]).itemsize
    if offset + size > room:
        return f"ends at byte {offset + size} of {room}"
    return None
