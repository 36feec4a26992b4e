"""Draws over frames: keypoints by side, filled and missing ones, a shaded body, reprojection errors."""

from __future__ import annotations

import cv2
import numpy as np

from gsac.avatar.wholebody import ARM, BODY, FACE, FEET, HANDS, NAMES

Colour = tuple[int, int, int]
"""r, g, b in 0..255."""
SIDE_COLOURS = {"left": (255, 122, 26), "right": (20, 190, 255), "middle": (245, 245, 245)}
FACE_COLOUR = (190, 255, 120)
FILLED_COLOUR = (255, 60, 230)
MISSING_COLOUR = (255, 40, 60)
BODY_COLOUR = np.array((120, 220, 180), np.float32)
MAGENTA = np.array((255, 0, 255), np.float32)
TORSO_EDGES = ((0, 1), (0, 2), (1, 3), (2, 4), (5, 6), (5, 11), (6, 12), (11, 12))
LIMB_EDGES = ((5, 7), (7, 9), (6, 8), (8, 10), (11, 13), (13, 15), (12, 14), (14, 16), (15, 17), (15, 18), (15, 19),
              (16, 20), (16, 21), (16, 22))
SUBPIXEL = 4


def side_of(point: int) -> str:
    """left, right or middle."""
    name = NAMES[point]
    return next((side for side in ("left", "right") if name.startswith(side)), "middle")


def hand_edges(side: str) -> list[tuple[int, int]]:
    """Pairs of points along the fingers, from the wrist out."""
    wrist = HANDS[side].start
    return [(wrist if i == 0 else wrist + 4 * finger + i, wrist + 4 * finger + i + 1)
            for finger in range(5) for i in range(4)]


def draw_line(image: np.ndarray, a: np.ndarray, b: np.ndarray, colour: Colour, thickness: int = 1) -> None:
    """Draws into image: (H, W, 3) uint8. a, b: (2,) px; centres of pixels are at +0.5."""
    p, q = (tuple(np.round((np.asarray(x) - 0.5) * 2**SUBPIXEL).astype(int).tolist()) for x in (a, b))
    cv2.line(image, p, q, colour, thickness, cv2.LINE_AA, SUBPIXEL)


def draw_dot(image: np.ndarray, at: np.ndarray, radius: float, colour: Colour, thickness: int = -1) -> None:
    """Draws into image: (H, W, 3) uint8. at: (2,) px; radius: px; thickness: px of a ring, negative for a disc."""
    centre = tuple(np.round((np.asarray(at) - 0.5) * 2**SUBPIXEL).astype(int).tolist())
    cv2.circle(image, centre, round(radius * 2**SUBPIXEL), colour, thickness, cv2.LINE_AA, SUBPIXEL)


def draw_cross(image: np.ndarray, at: np.ndarray, radius: float, colour: Colour) -> None:
    """Draws into image: (H, W, 3) uint8. at: (2,) px; radius: px."""
    for dx, dy in ((1, 1), (1, -1)):
        draw_line(image, np.asarray(at) - radius * np.array((dx, dy)), np.asarray(at) + radius * np.array((dx, dy)), colour, 2)


def draw_keypoints(image: np.ndarray, xy: np.ndarray, score: np.ndarray, least: float, filled: np.ndarray | None = None,
                   missing: np.ndarray | None = None) -> None:
    """Draws into image: (H, W, 3) uint8. xy: (133, 2) px; score: (133,); filled: (133,) bool; missing: (2,) bool left, right.

    Left points in one colour, right in another; a filled point is a ring, however unsure; a cross marks the wrist of a hand that is
    missing and was not filled.
    """
    far = 4 * max(image.shape)
    filled = np.zeros(len(xy), bool) if filled is None else filled
    shown = ((score >= least) | filled) & np.isfinite(xy).all(1) & (np.abs(np.nan_to_num(xy)) < far).all(1)
    unit = max(image.shape[0] / 640, 0.6)
    edges = [(*e, 2) for e in TORSO_EDGES + LIMB_EDGES] + [(*e, 1) for side in HANDS for e in hand_edges(side)]
    for a, b, width in edges:
        if shown[a] and shown[b]:
            colour = SIDE_COLOURS[side_of(a) if side_of(a) == side_of(b) else "middle"]
            draw_line(image, xy[a], xy[b], colour, max(1, round(width * unit)))
    for i in np.flatnonzero(shown).tolist():
        if filled[i]:
            draw_dot(image, xy[i], 2.6 * unit, FILLED_COLOUR, 1)
        elif FACE.start <= i < FACE.stop:
            draw_dot(image, xy[i], 0.9 * unit, FACE_COLOUR)
        else:
            draw_dot(image, xy[i], (3.2 if i < FEET.stop else 1.6) * unit, SIDE_COLOURS[side_of(i)])
    for i, side in enumerate(HANDS):
        wrist = ARM[side][2]
        if missing is not None and missing[i] and not filled[HANDS[side]].any() and shown[wrist]:
            draw_cross(image, xy[wrist], 6 * unit, MISSING_COLOUR)


def over_magenta(image: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """The cut-out on magenta, (H, W, 3) uint8. image: (H, W, 3) uint8; alpha: (H, W) in 0..1."""
    a = alpha[..., None]
    return np.round(image * a + MAGENTA * (1 - a)).astype(np.uint8)


def draw_body(image: np.ndarray, vertices: np.ndarray, faces: np.ndarray, face_id: np.ndarray) -> np.ndarray:
    """Shaded, half transparent body over a frame, (H, W, 3) uint8.

    image: (H, W, 3) uint8; vertices: (V, 3) m, camera frame; faces: (F, 3); face_id: (H, W), -1 where no face.
    """
    corners = vertices[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True) + 1e-12
    light = np.array((-0.4, -0.6, -0.7)) / np.linalg.norm((0.4, 0.6, 0.7))
    towards = np.sign(-(normal * corners.mean(1)).sum(1))  # either winding: the seen side faces the camera
    shade = 0.35 + 0.65 * np.clip(towards * (normal @ light), 0, 1)
    seen = face_id >= 0
    out = image.astype(np.float32)
    out[seen] = 0.4 * out[seen] + 0.6 * shade[face_id[seen], None] * BODY_COLOUR
    return np.clip(out, 0, 255).astype(np.uint8)


def draw_reprojection(image: np.ndarray, detected: np.ndarray, projected: np.ndarray, shown: np.ndarray) -> None:
    """Draws detected body and foot points as dots, the body's as rings, a line between, into image: (H, W, 3) uint8.

    detected: (133, 2) px; projected: (133, 2) px; shown: (133,) bool.
    """
    unit = max(image.shape[0] / 640, 0.6)
    for i in np.flatnonzero(shown[: FEET.stop]).tolist():
        colour = SIDE_COLOURS[side_of(BODY.start + i)]
        draw_line(image, detected[i], projected[i], (255, 255, 255), max(1, round(unit)))
        draw_dot(image, detected[i], 2.4 * unit, colour)
        draw_dot(image, projected[i], 4 * unit, (255, 255, 255), 1)
