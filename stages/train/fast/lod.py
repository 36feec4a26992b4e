"""Coarser levels of detail: each merges neighbours of the one before and is fitted to frames of about the size it is seen at.

From afar many gaussians share a pixel, and then fewer that were fitted to small frames draw better.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gsac.avatar.gaussians import Gaussians
from gsac.avatar.metrics import summary
from gsac.stages.train.fast.backend import Backend
from gsac.stages.train.fast.drawn_height import find_drawn_height, typical_height
from gsac.stages.train.fast.initial_gaussians import crop_views
from gsac.stages.train.fast.refit import FIRM, GENTLE
from gsac.stages.train.fast.size_search import POSE_ROUNDS, count_pixels, viewing_weight
from gsac.stages.train.fast.trainer import Trainer
from gsac.stages.train.gaussians.merge import merge_to_size
from gsac.stages.train.gaussians.unseen import level_heights
from gsac.stages.train.judge.heldout import Candidate, judge_all
from gsac.stages.train.poses.photometric import converge
from gsac.stages.train.poses.poses import Poses, carry_to_untrained
from gsac.stages.train.task import Fit, Task
from gsac.stages.train.views import View, of_each


class Level(NamedTuple):
    height: float
    """px, height of the person in the images that this level is fitted to."""
    most: int
    """Its gaussians, at most."""


LEVELS = (Level(600, 8000), Level(360, 4000), Level(150, 1300))
"""As many as such images ask for. The first is fitted a tenth higher than the 540 px that it is meant for: viewers take a coarser
level only where the person is a tenth lower than it allows."""
FEWER = 2 / 3
"""Gaussians of a level over those of the one before, at most."""
MOVED = 300
"""px, height of the person in the images that poses are moved to before a level is looked at: smaller ones tell them poorly."""
FRAMES = 6
"""Frames that are looked at, at most, to find up to which height a level is drawn."""


def fit_levels(task: Task, backend: Backend, fit: Fit, finish: Callable[[Gaussians], Gaussians]) -> list[Gaussians]:
    """Levels below fit.gaussians, the finest of them first; none of `LEVELS` that has as many gaussians as the one before it.

    finish: a level as it is handed out, from the gaussians as they were fitted.
    """
    rest, body = task.poses.rest(int(task.trained[0]))[0], task.poses.body
    filmed = crop_views(task)
    tall = typical_height(task.poses, filmed)
    poses, looked_at = find_frames(task, filmed)
    coarse = scale_views(looked_at, MOVED / tall)
    finished: list[Future[Gaussians]] = []
    heights: list[Future[float]] = []
    finer, finer_seen, placed = fit.gaussians, fit.seen, None
    smaller = [(tried.gaussians, tried.seen) for tried in fit.smaller]
    with ThreadPoolExecutor(1) as aside:  # a level is looked at and finished while the next one is fitted
        for level in LEVELS:
            if len(finer) <= level.most:
                continue
            placed = placed or aside.submit(move, finer, task, poses, coarse)
            scale, size = min(1.0, level.height / tall), min(level.most, round(FEWER * len(finer)))
            views = scale_views(filmed, scale)
            tried, seen = min((one for one in ((finer, finer_seen), *smaller) if len(one[0]) >= size), key=lambda one: len(one[0]))
            worth = count_pixels(tried, task, views) * viewing_weight(tried, body)
            fewer, seen = merge_to_size(tried, seen, worth, size, body, rest)
            trainer = Trainer(level_heights(fewer, rest, body.faces), task, frozen_body=True, scale=scale)
            trainer.seen = seen
            pace = FIRM if len(tried) >= 2 * size else GENTLE
            gaussians, seen = backend.refit(task, trainer, views, pace).finish(views)
            finer_placed, placed = placed, aside.submit(move, gaussians, task, poses, coarse)
            heights.append(aside.submit(look, gaussians, placed, finer, finer_placed, scale_views(looked_at, scale)))
            finished.append(aside.submit(finish, gaussians))
            finer, finer_seen = gaussians, seen
    least = np.minimum.accumulate([height.result() for height in heights])
    return [replace(level.result(), max_height_px=float(height)) for level, height in zip(finished, least, strict=True)]


def look(level: Gaussians, poses: Future[Poses], finer: Gaussians, finer_poses: Future[Poses], views: dict[int, View]) -> float:
    """`find_drawn_height` of a level, each with its own poses in the same views."""
    return find_drawn_height(Candidate(level, poses.result(), list(views), views),
                             Candidate(finer, finer_poses.result(), list(views), views))


def scale_views(views: Mapping[int, View], scale: float) -> dict[int, View]:
    """Frame -> its view at `scale` of its size, where that is smaller."""
    return of_each(lambda view: view.scaled(scale), views)


def find_frames(task: Task, views: dict[int, View]) -> tuple[Poses, dict[int, View]]:
    """Some frames to look at and all poses: as large as those that are trained on, and not trained on where such are at hand.

    In frames that were trained on, the finest level is flattered by all that it knows of these very frames.
    views: trained frame -> view.
    """
    poses = task.poses
    if task.filmed:
        height, poses = task.views[int(task.trained[0])].frame.height, carry_to_untrained(task.poses, task.trained)
        views = {int(t): task.filmed[int(t)].reduced(height) for t in task.choosing}
    return poses, dict(list(views.items())[::-(-len(views) // FRAMES)])


def move(gaussians: Gaussians, task: Task, poses: Poses, views: dict[int, View]) -> Poses:
    """The poses, those of untrained frames moved to their views by these gaussians.

    With poses that the finer level moved, a level would also pay for lying elsewhere than that one, which nobody sees.
    """
    if not task.filmed:
        return poses
    poses = poses.copy()
    converge(gaussians, poses, views, views, POSE_ROUNDS)
    return poses


def judge_levels(finest: Gaussians, levels: list[Gaussians], poses: Poses, views: Mapping[int, View]) -> list[dict]:
    """Held-out psnr_fg and ssim of each level where the person is as tall as it is drawn at most, with its size and the same
    figures of the finest level.

    views: held-out frame -> its whole view, as large as the trained ones.
    """
    tall = typical_height(poses, views) if views else np.nan
    rows, candidates = [], []
    for level in levels:
        assert level.max_height_px is not None  # as `fit_levels` makes them
        small = scale_views(views, level.max_height_px / tall)
        height = next((view.camera.height for view in small.values()), None)
        rows.append({"n_gaussians": len(level), "max_height_px": level.max_height_px, "image_height": height})
        candidates += [Candidate(gaussians, poses, list(small), small) for gaussians in (level, finest)]
    for k, judged_rows in enumerate(judge_all(candidates)):
        figures, name = summary(judged_rows), "_finest" if k % 2 else ""
        rows[k // 2] |= {f"{key}{name}": figures[key] for key in ("psnr_fg", "ssim")}
    return rows
