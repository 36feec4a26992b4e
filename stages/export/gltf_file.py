"""Writes a binary glTF 2.0 file; `gltf_body.py`, `glb.py` and `vrm.py` give it its meaning."""

from __future__ import annotations

import json
import struct

import numpy as np

FLOAT, U16, U32, U8 = 5126, 5123, 5125, 5121
CODES = {np.dtype("<f4"): FLOAT, np.dtype("<u2"): U16, np.dtype("<u4"): U32, np.dtype("u1"): U8}
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
ARRAY_BUFFER, ELEMENT_BUFFER = 34962, 34963


class GltfFile:
    """The binary chunk and its accessors, filled in order."""

    def __init__(self) -> None:
        self.data, self.views, self.accessors = bytearray(), [], []

    def add(self, array: np.ndarray, target: int | None = None, bounds: bool = False) -> int:
        """array: (n,) or (n, width). Returns the accessor's index."""
        array = np.ascontiguousarray(array)
        width = 1 if array.ndim == 1 else array.shape[1]
        view = self.add_bytes(array.tobytes())
        self.views[view] |= {"target": target} if target else {}
        accessor = {"bufferView": view, "componentType": CODES[array.dtype], "count": len(array),
                    "type": KINDS[width]}
        if bounds:
            flat = array.reshape(len(array), width)
            accessor |= {"min": flat.min(0).tolist(), "max": flat.max(0).tolist()}
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def add_sparse(self, count: int, rows: np.ndarray, values: np.ndarray) -> int:
        """(count, 3) float32, zero but for values (n, 3) at rows (n,). Returns the accessor's index."""
        order = np.argsort(rows)
        rows, values = rows[order].astype("<u2" if count <= 1 << 16 else "<u4"), values[order].astype("<f4")
        accessor = {"componentType": FLOAT, "count": count, "type": "VEC3"}
        held = np.vstack([values, np.zeros((int(count > len(rows)), 3), "<f4")])
        accessor |= {"min": held.min(0).tolist(), "max": held.max(0).tolist()}
        if len(rows):
            accessor["sparse"] = {"count": len(rows), "values": {"bufferView": self.add_bytes(values.tobytes())},
                                  "indices": {"bufferView": self.add_bytes(rows.tobytes()), "componentType": CODES[rows.dtype]}}
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def add_bytes(self, raw: bytes) -> int:
        """Returns the bufferView's index."""
        self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(raw)})
        self.data += raw
        self.data += b"\0" * (-len(self.data) % 4)
        return len(self.views) - 1

    def glb(self, document: dict) -> bytes:
        """The file's bytes: the document, whose accessors and views are those that were added, and the binary chunk."""
        document = document | {"buffers": [{"byteLength": len(self.data)}], "bufferViews": self.views,
                               "accessors": self.accessors}
        text = json.dumps(document, sort_keys=True, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        size = 12 + 8 + len(text) + 8 + len(self.data)
        return (struct.pack("<4sII", b"glTF", 2, size) + struct.pack("<I4s", len(text), b"JSON") + text
                + struct.pack("<I4s", len(self.data), b"BIN\0") + bytes(self.data))
