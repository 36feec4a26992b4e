"""Reads the bindings of a compiled entry point from its SPIR-V."""

from __future__ import annotations

import struct

import numpy as np

MAGIC = 0x07230203
ENTRY_POINT, NAME, MEMBER_NAME, TYPE_POINTER, VARIABLE, DECORATE, MEMBER_DECORATE = 15, 5, 6, 32, 59, 71, 72
IMAGE, SAMPLER = 25, 26
BLOCK, NON_WRITABLE, BINDING, OFFSET = 2, 24, 33, 35
BLOCK_SIZE = 1024
"""Bytes of a parameter block, more than the package's need."""


def _text(words: list[int]) -> str:
    """A string literal."""
    return struct.pack(f"<{len(words)}I", *words).split(b"\0")[0].decode()


class Program:
    """One compiled entry point of the package."""

    def __init__(self, code: bytes) -> None:
        words = struct.unpack(f"<{len(code) // 4}I", code)
        assert words[0] == MAGIC, "not SPIR-V"
        names, members, pointer, kind, binding, offset = {}, {}, {}, {}, {}, {}
        blocks, readonly, opaque = set(), set(), {}
        at = 5
        while at < len(words):
            op, length = words[at] & 0xffff, words[at] >> 16
            w = list(words[at + 1:at + length])
            if op == ENTRY_POINT:
                self.entry = _text(w[2:])
            elif op == NAME:
                names[w[0]] = _text(w[1:])
            elif op == MEMBER_NAME:
                members.setdefault(w[0], {})[w[1]] = _text(w[2:])
            elif op == TYPE_POINTER:
                pointer[w[0]] = w[2]
            elif op == IMAGE:
                opaque[w[0]] = "texture-array" if w[4] else "texture"
            elif op == SAMPLER:
                opaque[w[0]] = "sampler"
            elif op == VARIABLE:
                kind[w[1]] = pointer[w[0]]
            elif op == DECORATE and w[1] == BINDING:
                binding[w[0]] = w[2]
            elif op == DECORATE and w[1] == BLOCK:
                blocks.add(w[0])
            elif op == MEMBER_DECORATE and w[2] == OFFSET:
                offset.setdefault(w[0], {})[w[1]] = w[3]
            elif op == MEMBER_DECORATE and w[1:3] == [0, NON_WRITABLE]:
                readonly.add(w[0])
            at += length
        self.code = code
        self.bindings: dict[int, tuple[str, str | None]] = {}
        """Binding -> (kind of buffer, `texture`, `texture-array` or `sampler`, its name; None for the parameters)."""
        self.parameters: dict[str, int] = {}
        """Parameter -> offset in the parameter block, bytes."""
        for variable, number in binding.items():
            struct_type = kind[variable]
            if struct_type in blocks:
                self.bindings[number] = ("uniform", None)
                self.parameters |= {name: offset[struct_type][i] for i, name in members[struct_type].items()}
            elif struct_type in opaque:
                self.bindings[number] = (opaque[struct_type], names[variable])
            else:
                self.bindings[number] = ("read-only-storage" if struct_type in readonly else "storage", names[variable])

    def uniform(self, values: dict) -> bytes:
        """The parameter block. values: parameter -> int (a uint there), floats, or a matrix by columns."""
        block = bytearray(BLOCK_SIZE)
        for name, place in self.parameters.items():
            raw = np.asarray(values[name], np.uint32 if isinstance(values[name], int) else np.float32).tobytes()
            block[place:place + len(raw)] = raw
        return bytes(block)
