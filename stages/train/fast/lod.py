"""Coarser levels of detail: each merges neighbours of the one before and is fitted to frames of about the size it is seen at.

From afar many gaussians share a pixel, and then fewer that were fitted to small frames draw better.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from gsac.avatar.gaussians import Gaussians
from gsac.avatar.metrics import summary
from gsac.avatar.threads import prefetch
from gsac.stages.train.fast.backend import Backend
from gsac.stages.train.fast.drawn_height import find_drawn_height, typical_height
from gsac.stages.train.fast.initial_gaussians import crop_views
from gsac.stages.train.fast.merged import merge_trainer
from gsac.stages.train.fast.refit import FIRM, GENTLE
from gsac.stages.train.fast.size_search import POSE_ROUNDS
from gsac.stages.train.gaussians.joint_cuts import uncut
from gsac.stages.train.judge.heldout import Candidate, judge_all
from gsac.stages.train.poses.photometric import converge
from gsac.stages.train.poses.poses import Poses, carry_to_untrained
from gsac.stages.train.task import Fit, Task
from gsac.stages.train.views import View, of_each


class Level(NamedTuple):
    height: float
    """px, height of the person in the images that this level is fitted to."""
    most: int
    """Its gaussians, at most, once those are cut that joints would lift."""


LEVELS = (Level(600, 8000), Level(360, 4000), Level(150, 1300))
"""As many as such images ask for. The first is fitted a tenth higher than the 540 px that it is meant for: viewers take a coarser
level only where the person is a tenth lower than it allows."""
FEWER = 2 / 3
"""Gaussians of a level over those of the one before, at most."""
MOVED = 300
"""px, height of the person in the images that poses are moved to before a level is looked at: smaller ones tell them poorly."""
FRAMES = 6
"""Frames that are looked at, at most, to find up to which height a level is drawn."""


def fit_levels(task: Task, backend: Backend, fit: Fit, finish: Callable[[Gaussians], Gaussians],
               hand_out: Callable[[Gaussians], None]) -> None:
    """Levels below fit.gaussians, the finest of them first; none of `LEVELS` that has as many gaussians as the one before it.

    finish: a level as it is handed out, from the gaussians as they were fitted; hand_out: called with each when it is done.
    """
    filmed = crop_views(task)
    tall = typical_height(task.poses, filmed)
    finer, finer_seen = fit.gaussians, fit.seen
    smaller = [(tried.gaussians, tried.seen) for tried in fit.smaller]
    levels = [level for level in LEVELS if level.most < len(finer)]
    scales = [min(1.0, level.height / tall) for level in levels]
    told: list[Future[float]] = []
    # a level is looked at and finished while the next one is fitted, whose images are made ready while this one is
    with ThreadPoolExecutor(2) as aside, ThreadPoolExecutor(1) as ahead:
        looked_at = aside.submit(find_frames, task, filmed, tall)
        finer_placed = aside.submit(move, finer, task, looked_at)
        for level, scale, views in zip(levels, scales, prefetch(ahead, partial(scale_views, filmed), scales, 1), strict=True):
            size = min(uncut(level.most), round(FEWER * len(finer)))
            tried, seen = min((one for one in ((finer, finer_seen), *smaller) if len(one[0]) >= size), key=lambda one: len(one[0]))
            trainer = merge_trainer(tried, seen, size, task, views, scale)
            pace = FIRM if len(tried) >= 2 * size else GENTLE
            gaussians, seen = backend.refit(task, trainer, views, pace).finish(views)
            placed, finished = aside.submit(move, gaussians, task, looked_at), aside.submit(finish, gaussians)
            told.append(aside.submit(tell, Placed(gaussians, placed), Placed(finer, finer_placed), looked_at, scale, finished,
                                     told[-1] if told else None, hand_out))
            finer, finer_seen, finer_placed = gaussians, seen, placed
    for each in told:
        each.result()


class LookedAt(NamedTuple):
    """Some frames to look at."""

    poses: Poses
    """Of all frames."""
    views: dict[int, View]
    """Frame -> its view, as large as those that are trained on."""
    small: dict[int, View]
    """The same with a person of `MOVED` px."""


class Placed(NamedTuple):
    """A level, and its own poses in the frames that are looked at."""

    gaussians: Gaussians
    poses: Future[Poses]


def tell(level: Placed, finer: Placed, looked_at: Future[LookedAt], scale: float, finished: Future[Gaussians],
         before: Future[float] | None, hand_out: Callable[[Gaussians], None]) -> float:
    """Hands out a level with its height, px, up to which it is drawn: `find_drawn_height`, at most that of the level before.

    scale: size of the views that it was fitted to, of those looked at; finished: the level as it is handed out.
    """
    views = scale_views(looked_at.result().views, scale)
    height = find_drawn_height(*(Candidate(one.gaussians, one.poses.result(), list(views), views) for one in (level, finer)))
    if before is not None:
        height = min(height, before.result())
    hand_out(replace(finished.result(), max_height_px=height))
    return height


def scale_views(views: Mapping[int, View], scale: float) -> dict[int, View]:
    """Frame -> its view at `scale` of its size, where that is smaller."""
    return of_each(lambda view: view.scaled(scale), views)


def find_frames(task: Task, views: dict[int, View], tall: float) -> LookedAt:
    """Some frames to look at: frames that are not trained on where such are at hand.

    In frames that were trained on, the finest level is flattered by all that it knows of these very frames.
    views: trained frame -> view; tall: px, the person's height in them.
    """
    poses = task.poses
    if task.filmed:
        height, poses = task.views[int(task.trained[0])].frame.height, carry_to_untrained(task.poses, task.trained)
        views = {int(t): task.filmed[int(t)].reduced(height) for t in task.choosing}
    some = dict(list(views.items())[::-(-len(views) // FRAMES)])
    return LookedAt(poses, some, scale_views(some, MOVED / tall))


def move(gaussians: Gaussians, task: Task, looked_at: Future[LookedAt]) -> Poses:
    """The poses, those of untrained frames that are looked at moved to their views by these gaussians.

    With poses that the finer level moved, a level would also pay for lying elsewhere than that one, which nobody sees.
    """
    poses, _, views = looked_at.result()
    if not task.filmed:
        return poses
    poses = poses.copy()
    converge(gaussians, poses, views, views, POSE_ROUNDS)
    return poses


def judge_levels(finest: Gaussians, levels: Iterable[Gaussians], poses: Poses, views: Mapping[int, View]) -> list[dict]:
    """Held-out psnr_fg and ssim of each level where the person is as tall as it is drawn at most, with its size and the same
    figures of the finest level.

    levels: each is judged as soon as it comes; views: held-out frame -> its whole view, as large as the trained ones.
    """
    tall = typical_height(poses, views) if views else np.nan
    rows = []
    for level in levels:
        assert level.max_height_px is not None  # as `fit_levels` makes them
        small = scale_views(views, level.max_height_px / tall)
        height = next((view.camera.height for view in small.values()), None)
        row = {"n_gaussians": len(level), "max_height_px": level.max_height_px, "image_height": height}
        judged = judge_all([Candidate(gaussians, poses, list(small), small) for gaussians in (level, finest)])
        for judged_rows, name in zip(judged, ("", "_finest"), strict=True):
            figures = summary(judged_rows)
            row |= {f"{key}{name}": figures[key] for key in ("psnr_fg", "ssim")}
        rows.append(row)
    return rows
