"""Judges the likeness of body, face and hands in held-out frames."""

from __future__ import annotations

from collections.abc import Iterable

from gsac.avatar import rotation
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.threads import Workspace, side_by_side
from gsac.avatar.yaw import name_side, yaw
from gsac.stages.train.judge.heldout import find_boxes, render_view, truth
from gsac.stages.train.judge.parts import SIZES, average, compare_parts
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.views import Views


def judge_likeness(gaussians: Gaussians, poses: Poses, frames: Iterable[int], views: Views,
                   height: int) -> dict[str, dict | None]:
    """body, face and hands: `average` of `compare_parts` over the frames that show the part, and `worst_view`, the side of the body
    that the camera sees where it is least alike; None where none does.

    poses: aligned to the frames, so that an error of the pose is none of the avatar's; views: no larger than those at which the
    verdict's bounds were set, since structure falls with size; height: of the frames as filmed, px, in which `px` is told.
    """

    def row(t: int, workspace: Workspace) -> dict[str, list[dict]]:
        view = views[t]
        images = (*render_view(gaussians, poses, t, view, workspace), *truth(view))
        found = compare_parts(*images, find_boxes(poses, t, view.camera))
        larger = height / view.camera.height
        return {part: [one | {"px": one["px"] * larger} for one in ones] for part, ones in found.items()}

    held = [int(t) for t in frames]
    rows = side_by_side(row, held)
    return {part: describe([(found, t) for t, one in zip(held, rows, strict=True) for found in one[part]], poses) for part in SIZES}


def describe(found: list[tuple[dict, int]], poses: Poses) -> dict | None:
    """The figures of one part. found: its comparisons, each with its frame."""
    means = average([one for one, _ in found])
    if means is None:
        return None
    _, worst = min(found, key=lambda one: one[0]["structure"])
    return means | {"worst_view": name_side(float(yaw(rotation.exp(poses.pose[worst, 0].astype(float)))))}
