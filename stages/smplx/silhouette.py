"""Outlines: the signed distance field of an alpha's edge, and the points of the posed body that should lie on it.

The posed body is rasterised small; the surface under its outline pixels becomes a set of points. `lm` renews them each round and
minimises their distance in the field.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from gsac.avatar.body import Body, BodyParams
from gsac.avatar.camera import Camera
from gsac.avatar.frame_files import read_alpha
from gsac.avatar.threads import available_cores
from gsac.avatar.zbuffer import rasterise
from gsac.stages.smplx.jacobians import Pairs, make_surface_pairs

FIELD_HEIGHT = 320
"""Height of the field, px: finer edges do not move a joint."""
POINTS = 160
"""Most outline points a frame."""
INSET = 0.5
"""Distance, field pixels, from an outline point (the middle of a covered pixel) out to the outline."""

THREADS = min(available_cores(), 8)
"""The rasteriser releases Python's lock; more threads mostly wait for code that holds it."""
POSED_AT_ONCE = 64
"""Frames whose vertices are held in memory together."""


@dataclass
class Outline:
    """Signed distance field of one frame's alpha edge, in full-size pixels."""

    field: np.ndarray  # (h, w) signed distance px, negative inside
    slope: np.ndarray  # (2, h, w) its gradient, two planes: a view with a stride would be copied at each look
    scale: float
    """Full-size pixels per field pixel."""
    area: float
    """Share of the frame that the person covers; 0 without a person, or where all of it is the person: there is no outline."""
    mask: np.ndarray  # (h, w) bool
    hidden: np.ndarray | None = None
    """(h, w) bool, where something stands before the person; None: nowhere."""

    def at(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Signed distance (P,) px, its gradient (P, 2), and whether the point can be judged (P,) bool: it lies in the
        image, and nothing stands before it. xy: (P, 2) px."""
        h, w = self.field.shape
        at = (xy / self.scale - 0.5).astype(np.float32)
        inside = (at[:, 0] > 1) & (at[:, 0] < w - 2) & (at[:, 1] > 1) & (at[:, 1] < h - 2)
        if self.hidden is not None:
            column, row = np.clip(np.round(at), 0, (w - 1, h - 1)).astype(int).T
            inside &= ~self.hidden[row, column]
        x, y = at[:, 0].reshape(-1, 1), at[:, 1].reshape(-1, 1)
        sample = lambda image: cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)[:, 0]  # noqa: E731
        return sample(self.field), np.stack([sample(plane) for plane in self.slope], 1), inside


def read_outline(path: Path) -> Outline:
    """Makes the field of one alpha EXR."""
    return make_outline(read_alpha(path))


def make_outline(alpha: np.ndarray) -> Outline:
    """Makes the field of one alpha, (H, W) in 0..1; of one without an edge, it tells nothing."""
    scale = max(alpha.shape[0] / FIELD_HEIGHT, 1.0)
    size = (max(2, round(alpha.shape[1] / scale)), max(2, round(alpha.shape[0] / scale)))
    small = cv2.resize(alpha, size, interpolation=cv2.INTER_AREA)
    mask = small > 0.5
    mask &= not mask.all()  # how far it is to an edge that is nowhere would be infinite
    outside, inside = (cv2.distanceTransform(part.astype(np.uint8), cv2.DIST_L2, 5) for part in (~mask, mask))
    distance = np.where(mask, 0.5 - inside, outside - 0.5)  # OpenCV's are to the other side's pixel, half a pixel behind the edge
    field = (cv2.GaussianBlur(distance, (0, 0), 1.0) * scale).astype(np.float32)
    slope = np.stack([cv2.Sobel(field, cv2.CV_32F, 1, 0, ksize=3), cv2.Sobel(field, cv2.CV_32F, 0, 1, ksize=3)]) / (8 * scale)
    return Outline(field, slope, scale, float(mask.mean()), mask)


def read_outlines(paths: list[Path | None], height: int, width: int) -> list[Outline]:
    """Makes the fields of a clip's alpha EXRs. paths: (T,) None for a frame of nobody; height, width: of the frames, px."""
    nobody = make_outline(np.zeros((height, width), np.float32))
    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(lambda path: nobody if path is None else read_outline(path), paths))


def sample_outlines(body: Body, params: BodyParams, width: int, height: int,
                    outlines: list[Outline]) -> tuple[list[Pairs | None], np.ndarray]:
    """Outline points of each posed frame, None where there are none, and the IoU (T,) of body and alpha, NaN without alpha."""
    camera, pose = params.camera(width, height), params.pose
    pairs: list[Pairs | None] = [None] * params.frames
    iou = np.full(params.frames, np.nan)

    def sample(t: int, vertices: np.ndarray) -> None:
        if outlines[t].area > 0:
            points, iou[t] = sample_outline(body, vertices, camera, outlines[t], t, pose[t])
            pairs[t] = points if points.count else None

    with ThreadPoolExecutor(THREADS) as pool:
        for first in range(0, len(outlines), POSED_AT_ONCE):
            frames = range(first, min(first + POSED_AT_ONCE, len(outlines)))
            list(pool.map(sample, frames, body.posed(params, list(frames))[0]))
    return pairs, iou


def sample_outline(body: Body, vertices: np.ndarray, camera: Camera, outline: Outline, seed: int,
                   pose: np.ndarray | None = None) -> tuple[Pairs, float]:
    """Outline points of one posed body, and the IoU of body and alpha.

    vertices: (V, 3) m, camera frame, in pose (55, 3), axis-angle, whose pose correctives the points keep.
    """
    h, w = outline.field.shape
    face, bary, _ = rasterise(vertices, body.faces, camera.scaled(w, h))
    covered = face >= 0
    judged = covered if outline.hidden is None else covered & ~outline.hidden
    union = (judged | outline.mask).sum()
    overlap = (judged & outline.mask).sum() / union if union else 0.0
    edge = covered & ~cv2.erode(covered.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
    edge[[0, -1]] = edge[:, [0, -1]] = False
    y, x = np.nonzero(edge)
    if len(y) > POINTS:
        pick = ((np.arange(POINTS) + np.random.default_rng(seed).random(POINTS)) * len(y) / POINTS).astype(int)  # evenly by height
        y, x = y[pick], x[pick]
    return make_surface_pairs(body, face[y, x], bary[y, x].astype(np.float64), pose), float(overlap)
