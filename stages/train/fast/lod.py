"""Coarser levels of detail: each is the one before with neighbours merged, fitted to frames as small as it will be seen.

On the screen no gaussian is narrower than a pixel's blur: gaussians made for a near view are fat from afar, and a level fitted at
its own size draws better there than they do.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gsac.avatar.gaussians import Gaussians
from gsac.avatar.metrics import summary
from gsac.stages.train.fast import trainer as fast
from gsac.stages.train.fast.size_search import care, shown
from gsac.stages.train.gaussians.merge import merged
from gsac.stages.train.gaussians.unseen import levelled
from gsac.stages.train.judge.heldout import Look, judge_all
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.task import Fit, Loop, Task
from gsac.stages.train.views import View


class Level(NamedTuple):
    members: int
    """How many of the finest level's gaussians become one."""
    halvings: int
    """Of the images that are trained on, to the size at which a viewer takes this level."""


LEVELS = (Level(3, 1), Level(9, 2))
"""A person fills most of a frame of 540 px: a third for those of about 200 px, a ninth for 100, as Unity's renderer takes them."""
LEAST = 100
"""Gaussians below which there is no level."""


def coarser(task: Task, loop: Loop, fit: Fit) -> list[Gaussians]:
    """Levels below fit.gaussians, the finest of them first; fewer than `LEVELS` where an avatar has few gaussians."""
    rest = task.poses.rest(int(task.trained[0]))[0]
    views, halvings = fast.crops(task)[0], 0
    out, gaussians = [], fit.gaussians
    for level in LEVELS:
        size = len(fit.gaussians) // level.members
        if size < LEAST:
            break
        views = {t: halved(view, level.halvings - halvings) for t, view in views.items()}
        halvings = level.halvings
        worth = shown(gaussians, task, views) * care(gaussians, task.poses.body)
        fewer = merged(gaussians, worth, size, task.poses.body, rest)
        if len(fewer) >= len(gaussians):
            break
        trainer = fast.Trainer(levelled(fewer, rest, task.poses.body.faces), task, settled=True)
        trainer.rest_unseen(views)
        gaussians = loop.refit(task, trainer, views).recoloured(views)[0]
        out.append(gaussians)
    return out


def judged(finest: Gaussians, levels: list[Gaussians], poses: Poses, held: np.ndarray, views: list[View]) -> list[dict]:
    """For each level its number of gaussians, the height of its images, its held-out psnr_fg and ssim there, and the finest's."""
    rows, looks = [], []
    for (_, halvings), level in zip(LEVELS, levels, strict=False):
        small = {int(t): halved(views[t], halvings) for t in held}
        rows.append({"n_gaussians": len(level), "image_height": halved(views[0], halvings).camera.height})
        looks += [Look(gaussians, poses, held, small) for gaussians in (level, finest)]
    for k, judged_rows in enumerate(judge_all(looks)):
        figures, name = summary(judged_rows), "_finest" if k % 2 else ""
        rows[k // 2] |= {f"{key}{name}": figures[key] for key in ("psnr_fg", "ssim")}
    return rows


def halved(view: View, times: int) -> View:
    for _ in range(times):
        view = view.halved()
    return view
