"""Poses moved onto their images by the avatar that is judged, from coarse images to the full ones, so that none ends half-way.

At full size a sleeve's pattern has a best place at every stripe: from where a strong pose starts, Gauss-Newton then ends up to 4 dB
below what the avatar can show (`docs/lab/training.md`, Moved from coarse to fine), and what is compared is luck.
"""

from __future__ import annotations

from collections.abc import Iterable

from gsac.avatar.gaussians import Gaussians
from gsac.avatar.threads import Workspace, side_by_side
from gsac.stages.train.poses.photometric import converge, find_residuals
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.views import Views, person_crop

HEIGHTS, ROUNDS = (160, 320, 640), (12, 12, 8)
"""px of the small images and rounds of Gauss-Newton on each; a start may leave out the first ones, or all."""
LAST_ROUNDS = 16
"""Rounds on the images at full size."""


def move_onto(gaussians: Gaussians, poses: Poses, frames: Iterable[int], views: Views) -> None:
    """Moves the poses of some frames onto their images, the avatar held still. views: frame -> view.

    Of several starts, each moved through its sizes, a frame goes on from the one that shows it best at full size.
    """
    frames = list(frames)
    begun = poses.copy()
    least = measure(gaussians, poses, frames, views)
    for first in range(len(HEIGHTS)):
        tried = begun.copy()
        for height, rounds in list(zip(HEIGHTS, ROUNDS, strict=True))[first:]:
            small = {t: views[t].reduced(height) for t in frames if views[t].camera.height > height}
            converge(gaussians, tried, small, small, rounds)
        errors = measure(gaussians, tried, frames, views)
        for t, error in errors.items():
            if error < least[t]:
                least[t], poses.pose[t], poses.transl[t] = error, tried.pose[t], tried.transl[t]
    converge(gaussians, poses, frames, views, LAST_ROUNDS)


def measure(gaussians: Gaussians, poses: Poses, frames: Iterable[int], views: Views) -> dict[int, float]:
    """Frame -> squared error of one channel of one pixel of its view."""

    def of_frame(t: int, workspace: Workspace) -> float:
        return find_residuals(gaussians, poses, t, person_crop(views[t]), workspace).mean

    return dict(zip(frames, side_by_side(of_frame, frames), strict=True))
