"""Frames as the trainer uses them: scaled, cut out with the mask, cropped to the person's box, 8 bit."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from gsac.avatar.artifacts import frame_paths, read_alpha, read_frame
from gsac.avatar.camera import Camera
from gsac.avatar.threads import available_cores
from gsac.stages.contract import StageError

MARGIN = 0.06
"""Margin round the mask's box, in units of its height: limbs may move there while poses are refined."""
LEAST_SHARE = 2e-4
"""A mask that covers less of the frame counts as empty."""


@dataclass
class View:
    """A frame, or a crop of it, at one size."""

    camera: Camera
    """Of the crop: the frame's, with its centre moved."""
    pixels: np.ndarray
    """(h, w, 4) uint8, premultiplied RGB and mask."""
    corner: tuple[int, int]
    """x, y of the crop in the frame, px."""

    def crop(self, x0: int, y0: int, x1: int, y1: int) -> View:
        """Columns x0 to x1 and rows y0 to y1, px, the last ones excluded."""
        c = self.camera
        return View(Camera(c.focal, (c.center[0] - x0, c.center[1] - y0), x1 - x0, y1 - y0),
                    np.ascontiguousarray(self.pixels[y0:y1, x0:x1]), (self.corner[0] + x0, self.corner[1] + y0))

    def halved(self) -> View:
        """The view at half its size, with corner (0, 0)."""
        w, h = max(1, self.camera.width // 2), max(1, self.camera.height // 2)
        return View(self.camera.scaled(w, h), cv2.resize(self.pixels, (w, h), interpolation=cv2.INTER_AREA), (0, 0))


def read_views(frames: Path, alphas: Path, camera: Camera, height: int | None) -> tuple[list[View], list[int]]:
    """All T frames, whole, at most `height` px high, None: at their own size. camera: of the frames on disk.

    Returns the views and the indices of those whose mask is empty. Raises StageError for masks that do not fit the frames.
    """
    masks = {p.stem: p for p in frame_paths(alphas)}
    paths = frame_paths(frames)
    for path in paths:
        if path.stem not in masks:
            raise StageError(f"{alphas}: no mask for frame {path.name}; run segment again")
    with ThreadPoolExecutor(available_cores()) as pool:
        read = list(pool.map(lambda path: _read_view(path, masks[path.stem], camera, height), paths))
    return [view for view, _ in read], [t for t, (_, shown) in enumerate(read) if shown < LEAST_SHARE]


def _read_view(path: Path, mask: Path, camera: Camera, height: int | None) -> tuple[View, float]:
    """The frame cut out with its mask, and the share of it that the mask covers."""
    rgb, alpha = read_frame(path), read_alpha(mask)
    if alpha.shape != rgb.shape[:2]:
        raise StageError(f"{mask}: mask is {alpha.shape[1]}x{alpha.shape[0]} px, its frame {rgb.shape[1]}x{rgb.shape[0]}")
    if not np.isfinite(alpha).all():
        raise StageError(f"{mask}: mask is not finite")
    alpha = np.clip(alpha, 0, 1)
    pixels = np.dstack([rgb * alpha[..., None], alpha * 255])
    h = min(height or rgb.shape[0], rgb.shape[0])
    w = max(1, round(rgb.shape[1] * h / rgb.shape[0]))
    if (w, h) != (rgb.shape[1], rgb.shape[0]):
        pixels = cv2.resize(pixels, (w, h), interpolation=cv2.INTER_AREA)
    return View(camera.scaled(w, h), np.clip(np.round(pixels), 0, 255).astype(np.uint8), (0, 0)), float(alpha.mean())


def person_crop(view: View) -> View:
    """The view cut to the box of its mask and a margin."""
    rows, columns = (np.flatnonzero((view.pixels[..., 3] > 25).any(axis)) for axis in (1, 0))
    margin = int(np.ceil(MARGIN * (rows[-1] - rows[0]))) + 4
    return view.crop(max(columns[0] - margin, 0), max(rows[0] - margin, 0),
                     min(columns[-1] + 1 + margin, view.camera.width), min(rows[-1] + 1 + margin, view.camera.height))
