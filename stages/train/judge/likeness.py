"""Judges the likeness of body, face and hands in held-out frames."""

from __future__ import annotations

from collections.abc import Iterable

from gsac.avatar.gaussians import Gaussians
from gsac.avatar.likeness import SIZES, average, compare_parts
from gsac.avatar.threads import Workspace, side_by_side
from gsac.stages.train.judge.heldout import find_boxes, render_view, truth
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.views import Views


def judge_likeness(gaussians: Gaussians, poses: Poses, frames: Iterable[int], views: Views) -> dict[str, dict | None]:
    """body, face and hands: `average` of `compare_parts` over the frames that show the part; None where none does.

    poses: aligned to the frames, so that an error of the pose is none of the avatar's.
    """

    def row(t: int, workspace: Workspace) -> dict[str, list[dict]]:
        view = views[t]
        images = (*render_view(gaussians, poses, t, view, workspace), *truth(view))
        return compare_parts(*images, find_boxes(poses, t, view.camera))

    rows = side_by_side(row, [int(t) for t in frames])
    return {part: average([found for one in rows for found in one[part]]) for part in SIZES}
