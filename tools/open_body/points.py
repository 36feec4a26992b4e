"""Regressors of COCO-WholeBody's key points from the body's vertices."""

from __future__ import annotations

import numpy as np
import torch
from anny.paths import get_anny_root_dir
from skeleton import FINGERS, JOINTS, finger_tails, head_bone
from source import Source


def keypoints(source: Source) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The non-zero entries (n,) of a sparse (133, V) matrix from vertices to key points: row, vertex, weight.

    Body and feet have anny's own regressors; hand points are rings of skin around the finger joints, and fingertips.
    Face points are left out: the stage `face` has its own model of them.
    """
    weights, vertices, heads = source.weights, source.mean_vertices, source.mean_heads
    base = source.model.base_mesh_vertex_indices.numpy()
    regressors = torch.load(get_anny_root_dir() / "data" / "keypoints" / "coco.pth", weights_only=True)
    names = ("nose left_eye right_eye left_ear right_ear left_shoulder right_shoulder left_elbow right_elbow left_wrist "
             "right_wrist left_hip right_hip left_knee right_knee left_ankle right_ankle left_big_toe left_small_toe left_heel "
             "right_big_toe right_small_toe right_heel").split()
    dense = np.zeros((133, len(base)))
    for i, name in enumerate(names):
        w = regressors[name].numpy()[base]
        w[w < 2e-4] = 0
        dense[i] = w / w.sum()
    tails = finger_tails(heads, vertices, weights)
    for side, first, suffix in (("left", 91, ".L"), ("right", 112, ".R")):
        dense[first] = ring(vertices, heads["wrist" + suffix], weights, JOINTS.index(f"{side}_wrist"))
        for f, finger in enumerate(("thumb", "index", "middle", "ring", "pinky")):
            for i in (1, 2, 3):
                j = JOINTS.index(f"{side}_{finger}{i}")
                dense[first + 1 + 4 * f + i - 1] = ring(vertices, heads[head_bone(JOINTS[j])], weights, j)
            tip = tails[f"finger{FINGERS[finger]}-3{suffix}"]
            own = weights[:, JOINTS.index(f"{side}_{finger}3")] > 0.5
            distance = np.where(own, np.linalg.norm(vertices - tip, axis=1), np.inf)
            dense[first + 4 + 4 * f, np.argsort(distance)[:4]] = 0.25
    row, vertex = np.nonzero(dense)
    return row.astype(np.uint8), vertex.astype(np.uint16), dense[row, vertex].astype(np.float32)


def ring(vertices: np.ndarray, joint: np.ndarray, weights: np.ndarray, j: int, count: int = 24) -> np.ndarray:
    """Weights (V,) of the `count` nearest skin vertices whose weighted mean is the joint (ridge least squares).

    vertices: (V, 3) m; joint: (3,) m; weights: (V, 55) of the skinning; j: the joint's index.
    """
    own = weights[:, j] > 0.05
    distance = np.where(own, np.linalg.norm(vertices - joint, axis=1), np.inf)
    near = np.argsort(distance)[:count]
    rows = np.vstack([vertices[near].T * 100, 100 * np.ones((1, count)), 0.3 * np.eye(count)])
    want = np.concatenate([joint * 100, [100], np.full(count, 0.3 / count)])
    out = np.zeros(len(vertices))
    out[near] = np.linalg.lstsq(rows, want, rcond=None)[0]
    return out / out.sum()
