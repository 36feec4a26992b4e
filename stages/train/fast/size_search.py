"""`train.gaussians: auto`: no more gaussians than the held-out frames can tell apart.

The largest size is trained as always; each smaller one is the one before with neighbours merged, fitted again for a short while.
Sizes are judged on held-out frames whose pose is first moved to their image, once, with the largest avatar: a pose that is off
would reward blur. The first size that these frames can tell from the best ends the walk, and the one before it is taken.
"""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np

from gsac.avatar.body import Body
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import HEAD, JAW, WRISTS, J
from gsac.avatar.metrics import psnr
from gsac.avatar.raster import render_backward, render_bound
from gsac.avatar.threads import Workspace, side_by_side
from gsac.stages.train.config import TrainConfig
from gsac.stages.train.fast import trainer as fast
from gsac.stages.train.fast.size_rule import MOST_LOST, Rung, choose, optimism
from gsac.stages.train.gaussians.merge import merged, skin_of
from gsac.stages.train.gaussians.unseen import levelled
from gsac.stages.train.judge.heldout import judge
from gsac.stages.train.poses.photometric import converge
from gsac.stages.train.poses.poses import carried
from gsac.stages.train.task import Fit, Loop, Task
from gsac.stages.train.views import View

SIZES = (12000, 8000, 6000, 4000, 3000, 2000, 1000)
UNJUDGED = 12000
"""Size where no frame is held out."""
REFIT, REFIT_FROM = 0.2, 0.15
"""Steps of a smaller size, as a share of the training's; their rates are those of a training from this share of its steps on."""
AVERAGED = 0.1
"""Share of these steps, the last, after which gaussians are their own mean: each step runs after the one frame that it sees."""
WIDTHS = 3.0
"""Rate of the scales in that time, over a training's: of what was merged these are off most."""
ROUNDS = 5
"""That move the held-out frames' poses, on any device: sizes are to be chosen alike."""
NEAR, CARE = [HEAD, *WRISTS, *range(JAW, J)], 3.0
"""Joints of head and hands, and what their pixels count for beside others."""


def fit(task: Task, loop: Loop) -> Fit:
    """As `fast.fit`, with `size_curve` and `size_rule` among the figures."""
    if not len(task.held):
        return fast.fit(task, loop, UNJUDGED)
    trainer, fine, coarse = loop.train(task, SIZES[0])
    poses = carried(task.poses, task.trained)
    converge(trainer.gaussians(), poses, task.held, task.views, ROUNDS)
    rungs: list[Rung] = []
    kept: list[Fit] = []
    for size in SIZES:
        if rungs:
            gaussians = trainer.gaussians()
            worth = shown(gaussians, task, coarse) * care(gaussians, task.poses.body)
            fewer = merged(gaussians, worth, size, task.poses.body, trainer.rest)
            trainer = fast.Trainer(levelled(fewer, trainer.rest, trainer.faces), task, settled=True)
            trainer.rest_unseen(coarse)
            trainer = loop.refit(task, trainer, fine)
        kept.append(Fit(*trainer.recoloured(coarse), dict(trainer.gains)))
        rows = judge(kept[-1].gaussians, poses, task.held, task.views)
        rungs.append(Rung(size, [psnr(row["mse_fg"]) for row in rows], [row["detail"] for row in rows]))
        if choose(rungs) is not rungs[-1] and not task.config.every_size:
            break
    best = choose(rungs)
    figures = {"size_curve": [asdict(rung) | rung.means() | {"chosen": rung is best} for rung in rungs],
               "size_rule": f"smallest within one standard error, and {MOST_LOST} dB, of the best psnr_fg of size_frames, their "
                            "poses moved to the images, and as sharp; size_optimism: by how many dB these frames flatter the "
                            "choice, since it was made by them; other heldout_frames do not",
               "size_frames": task.held.tolist(), "size_optimism": optimism(rungs)}
    return replace(kept[rungs.index(best)], figures=figures)


def shown(gaussians: Gaussians, task: Task, views: dict[int, View]) -> np.ndarray:
    """(N,) pixels that each gaussian adds to some of the trained frames."""

    def added(t: int, workspace: Workspace) -> np.ndarray:
        rendering = render_bound(task.poses.vertices(t), task.poses.body.faces, gaussians, views[t].camera, workspace)
        return render_backward(rendering.state, np.ones_like(rendering.rgb), np.zeros_like(rendering.alpha)).rgb[:, 0].copy()

    return sum(side_by_side(added, map(int, task.trained[::-(-len(task.trained) // fast.COLOUR_FRAMES)])), np.zeros(len(gaussians)))


def care(gaussians: Gaussians, body: Body) -> np.ndarray:
    """(N,) how much more than its pixels a gaussian is worth: one meets an avatar's face and hands closer than the clip does."""
    return 1 + (CARE - 1) * skin_of(gaussians.face, body)[:, NEAR].sum(1)


def refit_steps(task: Task) -> int:
    return max(1, round(REFIT * (task.config.steps or fast.STEPS)))


def refit_config(config: TrainConfig) -> TrainConfig:
    """The rates of that time."""
    return replace(config, scale_rate=WIDTHS * config.scale_rate)


def refit(task: Task, trainer: fast.Trainer, views: dict[int, View]) -> fast.Trainer:
    """A short training of a trainer's gaussians with the poses as they are; those that it has not seen rest."""
    rng = np.random.default_rng(task.config.seed)
    trainer.config = refit_config(task.config)
    order: list[int] = []
    steps = refit_steps(task)
    averaged = max(1, round(AVERAGED * steps))
    sums = {name: np.zeros(value.shape) for name, value in trainer.values.items()}
    for step in range(steps):
        order = order or [int(t) for t in rng.permutation(task.trained)]
        t = order.pop()
        trainer.step(t, views[t], REFIT_FROM + (1 - REFIT_FROM) * step / steps, rng.random(3), step)
        if step >= steps - averaged:
            for name, value in trainer.values.items():
                sums[name] += value
    trainer.values = {name: (total / averaged).astype(np.float32) for name, total in sums.items()}
    return trainer
