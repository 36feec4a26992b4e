"""Writes a binary FBX file, version 7.4: a tree of named nodes with typed properties; `fbx.py` gives them their meaning."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field

import numpy as np

VERSION = 7400
MAGIC = b"Kaydara FBX Binary  \x00\x1a\x00"
FILE_ID = bytes.fromhex("28b32aebb624ccc2bfc8b02aa92bfcf1")
CREATED = "1970-01-01 10:00:00:000"
FOOT = bytes.fromhex("fabcab09d0c8d466b176fb831cf7267e"), bytes.fromhex("f85a8c6adef5d97eece90ce3758f290b")
"""Id, time and foot belong together: some readers check them against each other and accept this triple."""
EMPTY = b"\0" * 13
ARRAYS = {np.dtype(kind): code for kind, code in (("<f8", b"d"), ("<f4", b"f"), ("<i4", b"i"), ("<i8", b"l"))}
OPEN = ("AnimationStack", "AnimationLayer")
"""Nodes that readers expect to have a list of children, even an empty one."""
PACKED = 128
"""Least size, bytes, of an array that is compressed."""
LEVEL = 4
"""Of zlib: a hundredth larger than the default, in half the time."""


class Long(int):
    """A 64-bit integer: an id or a time."""


@dataclass
class Node:
    """A named node with its properties and children."""

    name: str
    values: list = field(default_factory=list)
    """bool, int, Long, float, str, bytes, or a numpy array of float32, float64, int32, int64."""
    children: list[Node] = field(default_factory=list)

    def add(self, name: str, *values: object) -> Node:
        """Adds a child and returns it."""
        self.children.append(Node(name, list(values)))
        return self.children[-1]

    def properties(self, *rows: tuple) -> Node:
        """Adds the child `Properties70` and returns it; rows: (name, type, label, flags, values...)."""
        node = self.add("Properties70")
        for row in rows:
            node.add("P", *row)
        return node


def fbx_bytes(nodes: list[Node]) -> bytes:
    """The file's bytes; the same nodes give the same bytes."""
    out = bytearray(MAGIC + struct.pack("<I", VERSION))
    for node in nodes:
        _write(out, node)
    out += EMPTY + FOOT[0] + b"\0" * 4
    out += b"\0" * (16 - len(out) % 16)
    return bytes(out + struct.pack("<I", VERSION) + b"\0" * 120 + FOOT[1])


def _write(out: bytearray, node: Node) -> None:
    start, name = len(out), node.name.encode()
    properties = b"".join(map(_property, node.values))
    out += b"\0" * 12 + bytes([len(name)]) + name + properties
    for child in node.children:
        _write(out, child)
    if node.children or not node.values or node.name in OPEN:
        out += EMPTY
    struct.pack_into("<III", out, start, len(out), len(node.values), len(properties))


def _property(value: object) -> bytes:
    if isinstance(value, np.ndarray):
        raw = value.astype(value.dtype.newbyteorder("<")).tobytes()
        packed = zlib.compress(raw, LEVEL) if len(raw) >= PACKED else raw
        code = ARRAYS[value.dtype.newbyteorder("<")]
        return code + struct.pack("<III", value.size, len(raw) >= PACKED, len(packed)) + packed
    if isinstance(value, bool):
        return b"C" + bytes([value])
    if isinstance(value, Long):
        return b"L" + struct.pack("<q", value)
    if isinstance(value, int):
        return b"I" + struct.pack("<i", value)
    if isinstance(value, float):
        return b"D" + struct.pack("<d", value)
    raw, code = (value, b"R") if isinstance(value, bytes) else (str(value).encode(), b"S")
    return code + struct.pack("<I", len(raw)) + raw
