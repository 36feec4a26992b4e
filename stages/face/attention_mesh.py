"""The face network with attention: the mesh, and lips and eyes read again from turned crops of its own features.

Between its trunk and its heads the file has operators that LiteRT lacks: they crop the features about lips and eyes, and bring the
heads' points back (Grishchenko et al., Attention Mesh, 2020). The file is taken apart there, and LiteRT runs both halves.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gsac.avatar.tflite import Network

CROP, BRING_BACK = b"TransformTensorBilinear", b"TransformLandmarks"
"""Operators at the seam."""
SIDE = 16
"""Width of a crop, in samples of the features."""


@dataclass(frozen=True)
class Part:
    """Lips or an eye with its brow."""

    points: np.ndarray
    """(n,) of the mesh, that its head reads again."""
    level: tuple[int, int]
    """The two points that lie level in its crop."""
    margin: float
    """Extent of the crop over that of the points."""

    def crop(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """points: (468, 2) in samples of the features. Returns axes (2, 2) and corner (2,): the crop's place p, in 0..16, lies at
        axes @ p + corner."""
        across = points[self.level[1]] - points[self.level[0]]
        angle = np.arctan2(across[1], across[0])
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        level = points[self.points] @ turn
        low, high = level.min(axis=0), level.max(axis=0)
        axes = turn * (self.margin * (high - low) / SIDE)
        return axes, turn @ (low + high) / 2 - axes @ np.full(2, SIDE / 2)


class AttentionMesh:
    """Runs the network on 192x192 pixels."""

    def __init__(self, path: Path, threads: int | None = None):
        """threads: of each half, as `Network`."""
        trunk, heads, self.parts = take_apart(path)
        self._trunk, self._heads = Network(trunk, threads), Network(heads, threads)
        self.width = self._trunk.width

    def __call__(self, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points (468, 3) px of the input, and the presence before the sigmoid. image: (192, 192, 3) float32 in 0..1."""
        mesh, features, presence = self._trunk(image)
        points = mesh.reshape(-1, 3).astype(np.float64)
        scale = self.width / len(features)
        crops = [part.crop(points[:, :2] / scale) for part in self.parts]
        read = self._heads(*(sample(features, *crop) for crop in crops))
        for part, (axes, corner), own in zip(self.parts, crops, read, strict=True):
            points[part.points, :2] = own @ axes.T + corner * scale
        return points, presence


def sample(features: np.ndarray, axes: np.ndarray, corner: np.ndarray) -> np.ndarray:
    """The features (H, W, C) at the centres of a crop's samples (16, 16, C), bilinear; 0 beyond the outermost centres.

    axes: (2, 2) and corner: (2,), of `Part.crop`.
    """
    height, width = features.shape[:2]
    middle = np.arange(SIDE) + 0.5
    x, y = np.moveaxis(np.stack(np.meshgrid(middle, middle), axis=-1) @ axes.T + corner - 0.5, -1, 0)
    inside = (x >= 0) & (y >= 0) & (x <= width - 1) & (y <= height - 1)
    x, y = np.where(inside, x, 0), np.where(inside, y, 0)
    left, top = np.minimum(x.astype(int), width - 2), np.minimum(y.astype(int), height - 2)
    right, down = ((x - left) * inside)[..., None], (y - top)[..., None]
    upper = features[top, left] * (inside[..., None] - right) + features[top, left + 1] * right
    lower = features[top + 1, left] * (inside[..., None] - right) + features[top + 1, left + 1] * right
    return upper * (1 - down) + lower * down


def take_apart(path: Path) -> tuple[bytes, bytes, tuple[Part, ...]]:
    """Reads the network's file. Returns the trunk (image -> mesh, features, presence) and the heads (a crop of each part -> its
    points), both without the operators at the seam, and the parts."""
    from ai_edge_litert import schema_py_generated as schema
    from flatbuffers import flexbuffers

    model: Any = schema.ModelT.InitFromObj(schema.Model.GetRootAs(path.read_bytes()))
    [graph] = model.subgraphs

    def custom(op: Any) -> bytes | None:
        return model.operatorCodes[op.opcodeIndex].customCode

    maker = {int(tensor): op for op in graph.operators for tensor in op.outputs}
    crops = [op for op in graph.operators if custom(op) == CROP]
    parts, heads = [], []
    for crop in crops:
        matrix = int(crop.inputs[1])
        told: Any = flexbuffers.Loads(bytes(maker[matrix].customOptions))
        part = Part(np.array(told["subset_idxs"]), (told["left_rotation_idx"], told["right_rotation_idx"]), told["scale_x"])
        parts.append(part)
        own = [int(op.inputs[0]) for op in graph.operators
               if custom(op) == BRING_BACK and maker[int(op.inputs[1])].inputs[0] == matrix]
        heads += [tensor for tensor in own if graph.tensors[tensor].shape[1] == len(part.points)]  # the other is the iris
    named = {graph.tensors[int(tensor)].name: int(tensor) for tensor in graph.outputs}
    seen = [named[b"output_mesh_identity"], int(crops[0].inputs[0]), named[b"conv_faceflag"]]
    whole = graph.operators

    def half(inputs: list[int], outputs: list[int]) -> bytes:
        """The network between these tensors, as a file."""
        import flatbuffers

        needed, graph.operators = set(outputs), []
        for op in reversed(whole):
            if needed & {int(tensor) for tensor in op.outputs} - set(inputs):
                needed |= {int(tensor) for tensor in op.inputs}
                graph.operators.insert(0, op)
        graph.inputs, graph.outputs = inputs, outputs
        model.signatureDefs = None
        builder = flatbuffers.Builder(1 << 22)
        builder.Finish(model.Pack(builder), b"TFL3")
        return bytes(builder.Output())

    trunk = half([int(tensor) for tensor in graph.inputs], seen)
    return trunk, half([int(crop.outputs[0]) for crop in crops], heads), tuple(parts)
