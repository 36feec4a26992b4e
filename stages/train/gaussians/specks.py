"""Gaussians that show as specks beside the person in the clip's own frames, of which each avatar has a few.

On the rim of an ear that stands off on the body and not on the person a gaussian is hair from the side and a speck from the front:
in too few pixels for the loss to take it away, and seen by everybody. Hands keep theirs: where a mask has lost a finger, the finger
would be the speck.
"""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np

from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import FINGERS, WRISTS, J
from gsac.avatar.raster import render_bound
from gsac.avatar.threads import Workspace, side_by_side
from gsac.stages.train.config import FULL_SIZE
from gsac.stages.train.gaussians.added_alpha import added_alpha
from gsac.stages.train.gaussians.merge import skin_weights
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.views import View

HANDS = [*WRISTS, *range(J)[FINGERS]]
FRAMES = 16
"""Frames that are looked at, at most, each at half its size."""
EMPTY = 13
"""Mask, of 255, below which a pixel shows the scene."""
OFF = 2 / 1280
"""Share of the frame's height off the mask from which alpha of `FULL_SIZE` gaussians begins to count (fewer are wider); from twice
as far all does."""
SHOWN = 0.1
"""Alpha from which on a pixel belongs to a speck."""
SIZE = 1e-3
"""Share of the person's pixels that a speck has at most: what is larger is a limb that the mask has lost, or a pose that is off."""
MOST = 0.05
"""Share of what a gaussian adds to the frames that may be specks."""


def find_specks(gaussians: Gaussians, poses: Poses, views: Mapping[int, View]) -> np.ndarray:
    """(N,) bool, the gaussians of which more than `MOST` is specks, but those of hands. views: trained frame -> view."""
    off = OFF * max(1.0, FULL_SIZE / len(gaussians)) ** 0.5

    def of_frame(frame: tuple[int, View], workspace: Workspace) -> np.ndarray:
        """(2, N) alpha that each gaussian adds to specks, and in all."""
        t, view = frame[0], frame[1].halved()
        rendering = render_bound(poses.vertices(t), poses.body.faces, gaussians, view.camera, workspace)
        specks = mark_specks(rendering.alpha, view.pixels[..., 3], off * frame[1].frame.height / 2)
        return np.stack([added_alpha(rendering, specks), added_alpha(rendering)])

    some = list(views.items())[::-(-len(views) // FRAMES)]
    in_specks, added = np.sum(side_by_side(of_frame, some), 0)
    return (in_specks > MOST * added) & (skin_weights(gaussians.face, poses.body)[:, HANDS].sum(1) < 0.5)


def mark_specks(alpha: np.ndarray, mask: np.ndarray, off: float) -> np.ndarray:
    """(h, w) float32 in 0..1, how far each pixel belongs to something small that stands beside the person.

    alpha: (h, w) as rendered; mask: (h, w) uint8; off: px off the mask from which it counts, all of it from twice as far.
    """
    away = cv2.distanceTransform((mask < EMPTY).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    beside = np.clip(away / off - 1, 0, 1)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(((alpha > SHOWN) & (beside > 0)).astype(np.uint8), connectivity=8)
    small = stats[:, cv2.CC_STAT_AREA] <= SIZE * np.count_nonzero(mask > 127)
    small[0] = False
    return beside * small[labels.astype(np.intp)]
