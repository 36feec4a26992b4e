"""Where the frames show detail: faces of the body with a print, a seam or eyes get more gaussians than plain cloth."""

from __future__ import annotations

import cv2
import numpy as np

from gsac.avatar.gaussians import Gaussians
from gsac.stages.train.gaussians.first_colours import PosedFrame, mean_colours, read_sights
from gsac.stages.train.gaussians.nearest import find_nearest

PROBES = 12000
"""Places on the surface where the images are read."""
NEAREST = 6
"""Probes that a face's detail is the mean of."""
RIM = 3
"""px inside of the outline that are not read: there the gradient is the background's."""
POWER, LEAST, MOST = 0.6, 0.5, 3.0
"""Density over the mean one: the relative gradient to this power, between these bounds."""


def find_detail(frames: list[PosedFrame], rest: np.ndarray, faces: np.ndarray, seed: int) -> np.ndarray:
    """(F,) factors of the density of gaussians, about 1 on average. frames: at least one; rest: (V, 3) m; faces: (F, 3)."""
    probes = Gaussians.area(rest, faces, PROBES, seed, power=1.0)
    found, seen = mean_colours(read_sights([to_gradient(frame) for frame in frames], faces, probes), PROBES)
    if not seen.any():
        return np.ones(len(faces))
    centres = rest[faces].mean(1)
    places = centres[probes.face]
    near = find_nearest(places[seen], centres, NEAREST)
    strength = found[seen][:, 0].astype(np.float64)[near].mean(1)
    return np.clip((strength / max(float(strength[probes.face].mean()), 1e-6)) ** POWER, LEAST, MOST)


def to_gradient(frame: PosedFrame) -> PosedFrame:
    """The frame with the length of its grey image's gradient in the place of colours, the mask cut by RIM px."""
    grey = cv2.cvtColor(frame.pixels[..., :3], cv2.COLOR_RGB2GRAY)
    across, down = (cv2.Sobel(grey, cv2.CV_32F, *order, scale=1 / 4) for order in ((1, 0), (0, 1)))
    strength = np.uint8(np.clip(np.hypot(across, down), 0, 255))
    mask = cv2.erode(frame.pixels[..., 3], np.ones((2 * RIM + 1, 2 * RIM + 1), np.uint8))
    return PosedFrame(frame.vertices, frame.camera, np.dstack([strength, strength, strength, mask]))
