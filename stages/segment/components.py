"""Drops the connected parts of a mask that are not the person."""

from __future__ import annotations

import cv2
import numpy as np

LEAST = 0.002
"""Parts smaller than this share of the largest one are dropped."""
BODY_AND_HANDS = (*range(17), *range(91, 133))


def keep_person(outline: np.ndarray, xy: np.ndarray, score: np.ndarray) -> np.ndarray:
    """outline: (H, W) 0..1; xy: (133, 2) px; score: (133,). Returns the outline (H, W) without the parts that hold no seen point.

    Where no part holds one, the largest is kept.
    """
    count, labels, stats, _ = cv2.connectedComponentsWithStats((outline > 0.5).astype(np.uint8), connectivity=8)
    if count <= 2:
        return outline
    areas = stats[1:, cv2.CC_STAT_AREA]
    height, width = outline.shape
    points = np.floor(xy[list(BODY_AND_HANDS)][score[list(BODY_AND_HANDS)] > 0.3]).astype(int)
    points = points[(points >= 0).all(axis=1) & (points[:, 0] < width) & (points[:, 1] < height)]
    held = np.unique(labels[points[:, 1], points[:, 0]])
    keep = set(held[held > 0].tolist()) or {1 + int(np.argmax(areas))}
    keep = {part for part in keep if areas[part - 1] >= LEAST * areas.max()}
    island = (labels > 0) & ~np.isin(labels, list(keep))
    # Grown by a pixel, or the half-covered rim of a dropped part would stay.
    return np.where(cv2.dilate(island.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0, 0, outline).astype(np.float32)


def keep_soft_person(alpha: np.ndarray, xy: np.ndarray, score: np.ndarray) -> np.ndarray:
    """alpha: (H, W) 0..1, soft; xy: (133, 2) px; score: (133,). Returns the alpha (H, W) without the parts that hold no
    seen point, and without what is nearer to them than to the person."""
    kept = keep_person(alpha, xy, score) > 0.5
    dropped = (alpha > 0.5) & ~kept
    if not dropped.any():
        return alpha
    to_kept, to_dropped = (cv2.distanceTransform((~part).astype(np.uint8), cv2.DIST_L2, 5) for part in (kept, dropped))
    return np.where(to_dropped < to_kept, 0, alpha).astype(np.float32)
