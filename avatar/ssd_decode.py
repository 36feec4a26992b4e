"""Boxes and points from a single-shot detector's output: anchors, decoding, weighted non-maximum suppression."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsac.avatar.logistic import clipped_sigmoid


@dataclass(frozen=True)
class Detections:
    """n detections, best first, in coordinates of their region (0..1) until mapped to the frame."""

    box: np.ndarray
    """(n, 4) x0 y0 x1 y1."""
    points: np.ndarray
    """(n, k, 2)."""
    score: np.ndarray
    """(n,) in 0..1."""

    def __len__(self) -> int:
        return len(self.score)


def anchor_centers(size: int, strides: tuple[int, ...]) -> np.ndarray:
    """(n, 2) in 0..1: the cells of each stride's grid, with two anchors for every layer of that stride.

    size: px of the square input; strides: px, one for each layer.
    """
    centers = []
    for stride in dict.fromkeys(strides):
        cells = -(-size // stride)
        grid = (np.stack(np.meshgrid(np.arange(cells), np.arange(cells)), axis=-1).reshape(-1, 2) + 0.5) / cells
        centers.append(np.repeat(grid, 2 * strides.count(stride), axis=0))
    return np.concatenate(centers)


def decode(raw: np.ndarray, logits: np.ndarray, centers: np.ndarray, size: int, threshold: float) -> Detections:
    """Detections of score >= threshold, best first, not yet suppressed.

    raw: (n, 4 + 2 k) px of the input: box centre and points about the anchor, box size; logits: (n, 1); centers: (n, 2) of
    `anchor_centers`; size: px of the input.
    """
    score = clipped_sigmoid(logits[:, 0])
    order = np.argsort(-score, kind="stable")
    keep = order[score[order] >= threshold]
    values = raw[keep].reshape(len(keep), raw.shape[1] // 2, 2) / size
    middle, extent, points = values[:, 0] + centers[keep], values[:, 1], values[:, 2:] + centers[keep][:, None]
    return Detections(np.hstack([middle - extent / 2, middle + extent / 2]), points, score[keep])


def iou(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Intersection over union (...) of boxes a (..., 4) and b (..., 4), x0 y0 x1 y1; 0 for empty boxes."""
    low, high = np.maximum(a[..., :2], b[..., :2]), np.minimum(a[..., 2:], b[..., 2:])
    inter = np.prod(np.clip(high - low, 0, None), axis=-1)
    area = np.prod(a[..., 2:] - a[..., :2], axis=-1) + np.prod(b[..., 2:] - b[..., :2], axis=-1) - inter
    return np.where(area > 0, inter / np.where(area > 0, area, 1), 0.0)


def suppress(found: Detections, overlap: float = 0.3) -> Detections:
    """Merges each best detection with all that overlap it by more than `overlap` IoU: their mean by score (BlazeFace)."""
    box, points, score = [], [], []
    rest = np.arange(len(found))
    while len(rest):
        similar = iou(found.box[rest], found.box[rest[0]]) > overlap
        similar[0] = True
        group = rest[similar]
        weight = found.score[group] / found.score[group].sum()
        box.append(weight @ found.box[group])
        points.append(np.tensordot(weight, found.points[group], axes=1))
        score.append(found.score[rest[0]])
        rest = rest[~similar]
    return Detections(np.reshape(box, (-1, 4)), np.reshape(points, (-1, *found.points.shape[1:])),
                      np.array(score))
