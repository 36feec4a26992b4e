"""Coarser levels of detail: each merges neighbours of the one before and is fitted to frames of about the size it is seen at.

From afar many gaussians share a pixel, and then fewer that were fitted to small frames draw better.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from gsac.avatar.gaussians import Gaussians
from gsac.avatar.metrics import summary
from gsac.stages.train.fast.backend import Backend
from gsac.stages.train.fast.drawn_height import find_drawn_height
from gsac.stages.train.fast.initial_gaussians import crop_views
from gsac.stages.train.fast.size_search import POSE_ROUNDS, count_pixels, viewing_weight
from gsac.stages.train.fast.trainer import Trainer
from gsac.stages.train.gaussians.merge import merge_to_size
from gsac.stages.train.gaussians.unseen import level_heights
from gsac.stages.train.judge.heldout import Candidate, judge_all
from gsac.stages.train.poses.photometric import converge
from gsac.stages.train.poses.poses import Poses, carry_to_untrained
from gsac.stages.train.task import Fit, Task
from gsac.stages.train.views import View


class Level(NamedTuple):
    members: int
    """Gaussians of the finest level for each one of this level."""
    halvings: int
    """How often the training images are halved, to the size at which this level is fitted."""


LEVELS = (Level(3, 1), Level(9, 2))
LEAST = 100
"""Fewest gaussians of a level."""


def fit_levels(task: Task, backend: Backend, fit: Fit) -> list[Gaussians]:
    """Levels below fit.gaussians, the finest of them first; fewer than `LEVELS` where an avatar has few gaussians."""
    rest = task.poses.rest(int(task.trained[0]))[0]
    views, halvings = crop_views(task)[0], 0
    poses, looked_at = find_unseen(task, fit.gaussians) or (task.poses, views)
    out, gaussians = [], fit.gaussians
    for level in LEVELS:
        size = len(fit.gaussians) // level.members
        if size < LEAST:
            break
        views = {t: halve(view, level.halvings - halvings) for t, view in views.items()}
        looked_at = {t: halve(view, level.halvings - halvings) for t, view in looked_at.items()}
        halvings = level.halvings
        worth = count_pixels(gaussians, task, views) * viewing_weight(gaussians, task.poses.body)
        fewer = merge_to_size(gaussians, worth, size, task.poses.body, rest)
        if len(fewer) >= len(gaussians):
            break
        trainer = Trainer(level_heights(fewer, rest, task.poses.body.faces), task, frozen_body=True, halvings=halvings)
        trainer.freeze_unseen(views)
        finer, gaussians = gaussians, backend.refit(task, trainer, views).finish(views)[0]
        gaussians.max_height_px = find_drawn_height(gaussians, finer, poses, looked_at)
        out.append(gaussians)
    return out


def find_unseen(task: Task, gaussians: Gaussians) -> tuple[Poses, dict[int, View]] | None:
    """The frames to choose by, as large as those trained on, and poses moved to them; None where none are at hand.

    In frames that were trained on, the finest level is flattered by all that it knows of these very frames.
    """
    if not task.filmed:
        return None
    height = task.views[int(task.trained[0])].frame.height
    views = {int(t): task.filmed[int(t)].reduced(height) for t in task.choosing}
    poses = carry_to_untrained(task.poses, task.trained)
    converge(gaussians, poses, task.choosing, {t: view.halved() for t, view in views.items()}, POSE_ROUNDS)
    return poses, views


def judge_levels(finest: Gaussians, levels: list[Gaussians], poses: Poses, views: Mapping[int, View], height: int) -> list[dict]:
    """Held-out psnr_fg and ssim of each level at its own image height, with its size and the same figures of the finest level.

    views: held-out frame -> its whole view, `height` px high as the trained ones.
    """
    rows, candidates = [], []
    for (_, halvings), level in zip(LEVELS, levels, strict=False):
        small = {t: halve(view, halvings) for t, view in views.items()}
        rows.append({"n_gaussians": len(level), "image_height": height // 2**halvings or 1})
        candidates += [Candidate(gaussians, poses, list(small), small) for gaussians in (level, finest)]
    for k, judged_rows in enumerate(judge_all(candidates)):
        figures, name = summary(judged_rows), "_finest" if k % 2 else ""
        rows[k // 2] |= {f"{key}{name}": figures[key] for key in ("psnr_fg", "ssim")}
    return rows


def halve(view: View, times: int) -> View:
    """The view at half its size, `times` over."""
    for _ in range(times):
        view = view.halved()
    return view
