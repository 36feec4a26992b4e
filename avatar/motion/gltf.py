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
from gsac.avatar.motion.source import LARGEST, MotionError, Source

MAX_BYTES = 256 << 20
MAGIC = 0x46546C67
RATE = 30.0
"""Frames a second at which animations are sampled."""
LONGEST_S = 3600
MOST = 4_000_000
"""Frames times joints."""
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


def _read(data: bytes) -> Source:
    chunk = None
    text = data
    if len(data) >= 20 and struct.unpack_from("<I", data)[0] == MAGIC:
        rest = 20 + struct.unpack_from("<I", data, 12)[0]
        if struct.unpack_from("<I", data, 8)[0] > len(data) or rest > len(data):
            raise ValueError("it ends before it says; was it cut off?")
        text = data[20:rest]
        chunk = data[rest + 8:]
    document = json.loads(text)
    document["asset"]  # noqa: B018
    if not document.get("animations"):
        raise ValueError("it holds no animation")
    nodes = document["nodes"]
    above = [-1] * len(nodes)
    for i, node in enumerate(nodes):
        for child in node.get("children", []):
            if above[child] >= 0:
                raise ValueError(f"nodes[{child}] has two parents")
            above[child] = i
    skin = document["skins"][0] if document.get("skins") else None
    order: list[int] = []

    def visit(i: int, depth: int = 0) -> None:
        if depth > len(nodes):
            raise ValueError("its nodes are not a tree")
        if i not in order:
            if above[i] >= 0:
                visit(above[i], depth + 1)
            order.append(i)

    for i in skin["joints"] if skin else range(len(nodes)):
        visit(i)
    local = np.array([_local(nodes[i]) for i in order])
    parents = np.array([order.index(above[i]) if above[i] >= 0 else -1 for i in order])
    posed = _sample(document, chunk, order, local)
    rest_turns, rest_places = (a[0] for a in place_nodes(local[None], parents))
    if skin and "inverseBindMatrices" in skin:
        rest_turns, rest_places = _bind_pose(_numbers(document, chunk, skin["inverseBindMatrices"]), skin, order, parents,
                                             rest_turns, rest_places)
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


def _numbers(document: dict[str, Any], chunk: bytes | None, i: int) -> np.ndarray:
    """(count, width) of an accessor; normalised integers become -1..1."""
    accessor = document["accessors"][i]
    view = document["bufferViews"][accessor["bufferView"]]
    kind, width, count = np.dtype(TYPES[accessor["componentType"]]), WIDTHS[accessor["type"]], accessor["count"]
    uri = document["buffers"][view["buffer"]].get("uri")
    try:
        data = chunk if uri is None else base64.b64decode(uri.split(";base64,", 1)[1], validate=True)
    except (IndexError, binascii.Error):
        raise ValueError("a buffer lies in another file; save it as .glb") from None
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    stride = view.get("byteStride") or kind.itemsize * width
    if data is None or start < 0 or count < 1 or start + (count - 1) * stride + kind.itemsize * width > len(data):
        raise ValueError(f"accessors[{i}] ends after its buffer; was the file cut off?")
    rows = np.ndarray((count, width), kind.newbyteorder("<"), data, start, (stride, kind.itemsize)).astype(float)
    return rows / np.iinfo(kind).max if accessor.get("normalized") and kind.kind in "iu" else rows


def _sample(document: dict[str, Any], chunk: bytes | None, order: list[int], local: np.ndarray) -> np.ndarray:
    """(T, P, 8) local places, turns and scales of the first animation."""
    animation = document["animations"][0]
    tracks = []
    for channel in animation["channels"]:
        path, node = channel["target"]["path"], channel["target"].get("node")
        if node in order and path in ("translation", "rotation"):
            sampler = animation["samplers"][channel["sampler"]]
            times = _numbers(document, chunk, sampler["input"])[:, 0]
            values = _numbers(document, chunk, sampler["output"])
            if sampler.get("interpolation") == "CUBICSPLINE":
                values = values[1::3]  # the keys themselves; between them linear
            if len(values) != len(times) or (np.diff(times) < 0).any():
                raise ValueError("animations[0] has a sampler whose times and values do not fit")
            tracks.append((order.index(node), path, times, values, sampler.get("interpolation") == "STEP"))
    if not tracks:
        raise ValueError("animations[0] turns no joint of its skeleton")
    end = max(times[-1] for _, _, times, _, _ in tracks)
    if not 0 <= end <= LONGEST_S:
        raise ValueError(f"a motion of {end:g} s; at most {LONGEST_S} are read")
    at = np.arange(int(end * RATE + 1e-6) + 1) / RATE
    if len(at) * len(order) > MOST:
        raise ValueError(f"{len(at)} frames of {len(order)} joints; at most {MOST} in all are read")
    out = np.tile(local, (len(at), 1, 1))
    for joint, path, times, values, step in tracks:
        low = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 1)
        high = np.minimum(low + 1, len(times) - 1)
        share = np.clip((at - times[low]) / np.maximum(times[high] - times[low], 1e-12), 0, 0 if step else 1)[:, None]
        if path == "rotation":
            out[:, joint, 3:7] = quat.mix(values[low], values[high], share)
        else:
            out[:, joint, :3] = (1 - share) * values[low] + share * values[high]
    return out


def _bind_pose(matrices: np.ndarray, skin: dict[str, Any], order: list[int], parents: np.ndarray, turns: np.ndarray,
               places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """turns (P, 4) and places (P, 3) with the skin's joints as they were bound, scaled to the size of the nodes."""
    at = [order.index(i) for i in skin["joints"]]
    bound = np.linalg.inv(matrices[:len(at)].reshape(-1, 4, 4).transpose(0, 2, 1))
    out_turns, out_places = turns.copy(), places.copy()
    columns = bound[:, :3, :3] / np.linalg.norm(bound[:, :3, :3], axis=1, keepdims=True)
    out_turns[at], out_places[at] = Rotation.from_matrix(columns).as_quat(), bound[:, :3, 3]
    pairs = [(j, parents[j]) for j in at if parents[j] in at]
    ours = sum(np.linalg.norm(places[j] - places[p]) for j, p in pairs)
    theirs = sum(np.linalg.norm(out_places[j] - out_places[p]) for j, p in pairs)
    if theirs > 1e-9:
        out_places[at] *= ours / theirs
    return out_turns, out_places
