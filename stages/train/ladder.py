"""`train.gaussians: auto`: no more gaussians than the held-out frames can tell apart.

The largest size is trained as always; each smaller one is a part of the one before, drawn by how much each gaussian shows,
and fitted again for a short while. Sizes are judged on held-out frames whose pose is first moved to their image, once, with the
largest avatar: a pose that is off would reward blur. The smallest size within one standard error of the best is taken.
"""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.metrics import psnr
from gsac.avatar.raster import render_backward, render_bound
from gsac.avatar.workspace import Workspace
from gsac.stages.train import fast
from gsac.stages.train.evaluate import judge
from gsac.stages.train.poses import carried
from gsac.stages.train.sizes import Rung, choose
from gsac.stages.train.task import Fit, Loop, Task

SIZES = (24000, 16000, 12000, 8000, 6000, 4000, 2000, 1000)
UNJUDGED = 12000
"""Size where no frame is held out."""
REFIT = 160
"""Steps of a smaller size."""
REFIT_FROM = 0.6
"""Rates of the refit are those of a training from this share of its steps on."""
ALIGN_STEPS = 40
EVENNESS = 0.5
"""Power of what a gaussian shows in the chance to keep it: 1 would leave holes where many show little, 0 is blind."""


def fit(task: Task, loop: Loop) -> Fit:
    """As `fast.fit`, with `size_curve` and `size_rule` among the figures."""
    if not len(task.held):
        return fast.fit(task, loop, UNJUDGED)
    trainer, fine, coarse = loop.train(task, SIZES[0])
    poses, workspace = carried(task.poses, task.trained), Workspace()
    loop.align(trainer.gaussians(), poses, task.held, task.views, ALIGN_STEPS)
    rungs, trainers = [], []
    for size in SIZES:
        if size != SIZES[0]:
            trainer = loop.refit(task, thinned(trainer.gaussians(), size, task, fine, workspace), fine)
        rows = judge(trainer.gaussians(), poses, task.held, task.views, None, workspace)
        rungs.append(Rung(size, [psnr(row["mse_fg"]) for row in rows], [row["detail"] for row in rows]))
        trainers.append(trainer)
    best = choose(rungs)
    kept = trainers[rungs.index(best)]
    figures = {"size_curve": [asdict(rung) | rung.means() | {"chosen": rung is best} for rung in rungs],
               "size_rule": "smallest within one standard error, and 0.3 dB, of the best held-out psnr_fg, and as sharp; the same "
                            "frames give psnr_fg, so it is chosen on them"}
    return Fit(*kept.recoloured(coarse), dict(kept.gains), figures)


def thinned(gaussians: Gaussians, size: int, task: Task, views, workspace: Workspace) -> Gaussians:
    """`size` of the gaussians, grown so that they cover what all of them covered.

    Systematic draws in the gaussians' own order, which follows the mesh: what is left is spread as evenly as it can be. The chance
    to stay grows with what a gaussian shows, summed over some frames: its blend weights.
    """
    shown = np.zeros(len(gaussians))
    for t in task.trained[::-(-len(task.trained) // fast.COLOUR_FRAMES)]:
        rendering = render_bound(task.poses.vertices(int(t)), task.poses.body.faces, gaussians, views[int(t)].camera, workspace)
        ones = np.ones_like(rendering.rgb)
        shown += render_backward(rendering.state, ones, np.zeros_like(rendering.alpha)).rgb[:, 0]
    chance = (shown + 1e-3 * shown.mean()) ** EVENNESS
    share = np.minimum(1, size * chance / chance.sum())
    for _ in range(20):  # chances above one are handed to the others
        free = share < 1
        share[free] = np.minimum(1, chance[free] * (size - (~free).sum()) / chance[free].sum())
    up_to = np.cumsum(share) * (size / share.sum())
    picked = np.flatnonzero(np.diff(np.floor(up_to + 0.5), prepend=0) > 0)
    left = gaussians[picked]
    left.log_scale = left.log_scale + np.float32(0.5 * np.log(len(gaussians) / max(len(left), 1)))
    return left


def refit(task: Task, gaussians: Gaussians, views) -> fast.Trainer:
    """A short training of the gaussians with the poses as they are."""
    trainer = fast.Trainer(gaussians, task, settled=True)
    rng = np.random.default_rng(task.config.seed)
    order: list[int] = []
    for step in range(REFIT):
        order = order or [int(t) for t in rng.permutation(task.trained)]
        t = order.pop()
        trainer.step(t, views[t], REFIT_FROM + (1 - REFIT_FROM) * step / REFIT, rng.random(3), step)
    return trainer
