"""Reads the first animation of a glTF 2.0 file: .glb, .vrma, or .gltf with its buffers inside. The viewer's gltf.js follows the
same rules. Every error names the file and the part."""

from __future__ import annotations

import base64
import binascii
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from gsac.avatar.motion import quat
from gsac.avatar.motion.places import place_nodes
from gsac.avatar.motion.source import LARGEST, LONGEST_S, MAX_BYTES, RATE, MotionError, Source, most_frames, too_long

MAGIC = 0x46546C67
MAX_JSON = 32 << 20
MOST_NODES = 10_000
MOST_NUMBERS = 32_000_000
"""Of all accessors that the motion names: they may lie over each other, so that the file's size is no bound."""
TYPES = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}
ODD = (KeyError, IndexError, TypeError, ValueError, AttributeError, RecursionError, struct.error)
"""What Python raises where a document is not built as glTF 2.0 says."""


def read_gltf(path: Path) -> Source:
    """The first animation of the file. Rest: the skin's bind pose where there is one, else the nodes'. Raises MotionError."""
    size = Path(path).stat().st_size
    if size > MAX_BYTES:
        raise MotionError(f"{path}: it has {size} bytes, at most {MAX_BYTES} are read")
    try:
        source = _read(Path(path).read_bytes())
    except ODD as e:
        raise MotionError(f"{path}: {e if type(e) is ValueError else 'it is not the glTF 2.0 of a motion'} "
                          "(expected .glb, .vrma or .gltf with its buffers inside)") from e
    if not all((np.abs(a) <= LARGEST).all() for a in (source.turns, source.places, source.rest_turns, source.rest_places)):
        raise MotionError(f"{path}: a place or turn that is not finite, or beyond {LARGEST:g}")
    return source


class _Document:
    """The JSON of a file and what its accessors name."""

    def __init__(self, data: bytes) -> None:
        text, self.chunk = _split(data)
        if len(text) > MAX_JSON:
            raise ValueError(f"its JSON has {len(text)} bytes, at most {MAX_JSON} are read; save it as .glb")
        self.json: dict[str, Any] = json.loads(text)
        self.buffers: dict[int, bytes | None] = {}
        self.left = MOST_NUMBERS

    def buffer(self, i: int) -> bytes | None:
        if i not in self.buffers:
            uri = self.json["buffers"][i].get("uri")
            try:
                self.buffers[i] = self.chunk if uri is None else base64.b64decode(uri.split(";base64,", 1)[1], validate=True)
            except (IndexError, binascii.Error):
                raise ValueError("a buffer lies in another file; save it as .glb") from None
        return self.buffers[i]

    def numbers(self, i: int) -> np.ndarray:
        """(count, width) of an accessor; normalised integers become -1..1."""
        accessor = self.json["accessors"][i]
        view = self.json["bufferViews"][accessor["bufferView"]]
        kind, width, count = np.dtype(TYPES[accessor["componentType"]]), WIDTHS[accessor["type"]], accessor["count"]
        size, data = kind.itemsize * width, self.buffer(view["buffer"])
        first, start, stride = view.get("byteOffset", 0), accessor.get("byteOffset", 0), view.get("byteStride") or size
        if not all(type(n) is int and n >= 0 for n in (first, start, stride, count)) or stride < size:
            raise ValueError(f"accessors[{i}] has an offset, a stride or a count that glTF does not allow")
        start += first
        if data is None or count < 1 or start + (count - 1) * stride + size > len(data):
            raise ValueError(f"accessors[{i}] ends after its buffer; was the file cut off?")
        self.left -= count * width
        if self.left < 0:
            raise ValueError(f"its accessors hold more than {MOST_NUMBERS} numbers in all; cut the motion")
        with np.errstate(invalid="ignore"):  # what is not finite is found in the motion
            rows = np.ndarray((count, width), kind.newbyteorder("<"), data, start, (stride, kind.itemsize)).astype(float)
        return rows / np.iinfo(kind).max if accessor.get("normalized") and kind.kind in "iu" else rows


def _split(data: bytes) -> tuple[bytes, bytes | None]:
    """JSON and the binary part of a .glb; of a .gltf all of it and None."""
    if len(data) >= 20 and struct.unpack_from("<I", data)[0] == MAGIC:
        rest = 20 + struct.unpack_from("<I", data, 12)[0]
        if struct.unpack_from("<I", data, 8)[0] > len(data) or rest > len(data):
            raise ValueError("it ends before it says; was it cut off?")
        return data[20:rest], data[rest + 8:]
    return data, None


def _read(data: bytes) -> Source:
    document = _Document(data)
    document.json["asset"]  # noqa: B018
    if not document.json.get("animations"):
        raise ValueError("it holds no animation")
    nodes = document.json["nodes"]
    skin = document.json["skins"][0] if document.json.get("skins") else None
    for what, count in (("nodes", len(nodes)), ("joints in its skin", len(skin["joints"]) if skin else 0)):
        if count > MOST_NODES:
            raise ValueError(f"{count} {what}; at most {MOST_NODES} are read")
    above = [-1] * len(nodes)
    for i, node in enumerate(nodes):
        for child in node.get("children", []):
            if above[child] >= 0:
                raise ValueError(f"nodes[{child}] has two parents")
            above[child] = i
    order: dict[int, int] = {}  # node -> its index among the joints

    def visit(i: int, depth: int = 0) -> None:
        if depth > len(nodes):
            raise ValueError("its nodes are not a tree")
        if i not in order:
            if above[i] >= 0:
                visit(above[i], depth + 1)
            order[i] = len(order)

    for i in skin["joints"] if skin else range(len(nodes)):
        visit(i)
    local = np.array([_local(nodes[i]) for i in order])
    parents = np.array([order[above[i]] if above[i] >= 0 else -1 for i in order])
    posed = _sample(document, order, local)
    rest_turns, rest_places = (a[0] for a in place_nodes(local[None], parents))
    if skin and "inverseBindMatrices" in skin:
        rest_turns, rest_places = _bind_pose(document.numbers(skin["inverseBindMatrices"]), [order[i] for i in skin["joints"]],
                                             parents, rest_turns, rest_places)
    names = [str(nodes[i].get("name", f"node {i}")) for i in order]
    return Source(RATE, names, parents, rest_turns, rest_places, *place_nodes(posed, parents))


def _local(node: dict[str, Any]) -> list[float]:
    """Place, quaternion and mean scale from the node's parent."""
    if "matrix" in node:
        m = np.array(node["matrix"], float).reshape(4, 4).T
        scale = np.linalg.norm(m[:3, :3], axis=0)
        return [*m[:3, 3], *Rotation.from_matrix(m[:3, :3] / scale).as_quat(), scale.mean()]
    turn = np.array(node.get("rotation", [0, 0, 0, 1]), float)
    return [*node.get("translation", [0, 0, 0]), *(turn / np.linalg.norm(turn)), float(np.mean(node.get("scale", [1, 1, 1])))]


def _sample(document: _Document, order: dict[int, int], local: np.ndarray) -> np.ndarray:
    """(T, P, 8) local places, turns and scales of the first animation."""
    animation = document.json["animations"][0]
    tracks = {}
    for channel in animation["channels"]:
        path, node = channel["target"]["path"], channel["target"].get("node")
        if node in order and path in ("translation", "rotation"):
            sampler = animation["samplers"][channel["sampler"]]
            times = document.numbers(sampler["input"])[:, 0]
            values = document.numbers(sampler["output"])
            if sampler.get("interpolation") == "CUBICSPLINE":
                values = values[1::3]  # the keys themselves; between them linear
            if len(values) != len(times) or not (np.diff(times) >= 0).all():
                raise ValueError("animations[0] has a sampler whose times and values do not fit")
            tracks[order[node], path] = times, values, sampler.get("interpolation") == "STEP"
    if not tracks:
        raise ValueError("animations[0] turns no joint of its skeleton")
    end = max(times[-1] for times, _, _ in tracks.values())
    if not 0 <= end <= LONGEST_S:
        raise ValueError(f"a motion of {end:g} s; at most {LONGEST_S} are read")
    at = np.arange(int(end * RATE + 1e-6) + 1) / RATE
    if len(at) > most_frames(len(order)):
        raise ValueError(too_long(len(at), len(order)))
    out = np.tile(local, (len(at), 1, 1))
    for (joint, path), (times, values, step) in tracks.items():
        low = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 1)
        high = np.minimum(low + 1, len(times) - 1)
        share = np.clip((at - times[low]) / np.maximum(times[high] - times[low], 1e-12), 0, 0 if step else 1)[:, None]
        if path == "rotation":
            out[:, joint, 3:7] = quat.mix(values[low], values[high], share)
        else:
            out[:, joint, :3] = (1 - share) * values[low] + share * values[high]
    return out


def _bind_pose(matrices: np.ndarray, at: list[int], parents: np.ndarray, turns: np.ndarray,
               places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """turns (P, 4) and places (P, 3) with the skin's joints `at` as they were bound, scaled to the size of the nodes.

    matrices: (n, 16) inverse bind matrices, in the order of `at`.
    """
    bound = np.linalg.inv(matrices[:len(at)].reshape(-1, 4, 4).transpose(0, 2, 1))
    out_turns, out_places = turns.copy(), places.copy()
    columns = bound[:, :3, :3] / np.linalg.norm(bound[:, :3, :3], axis=1, keepdims=True)
    out_turns[at], out_places[at] = Rotation.from_matrix(columns).as_quat(), bound[:, :3, 3]
    bound_joints = set(at)
    pairs = [(j, parents[j]) for j in at if parents[j] in bound_joints]
    ours = sum(np.linalg.norm(places[j] - places[p]) for j, p in pairs)
    theirs = sum(np.linalg.norm(out_places[j] - out_places[p]) for j, p in pairs)
    if theirs > 1e-9:
        out_places[at] *= ours / theirs
    return out_turns, out_places
