"""`train.gaussians: auto`: searches for the smallest number of gaussians at no visible loss on held-out frames.

The largest size is trained as always; each smaller size merges neighbours of the one before and refits the result. Sizes are
judged on held-out frames, as filmed, whose poses are first moved to their images, once, with the largest avatar: a pose that is
off would reward blur. The search ends at the first size that scores worse than the best, and takes the one before.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace

from gsac.avatar.metrics import psnr
from gsac.stages.train.fast.backend import Backend, Trained
from gsac.stages.train.fast.merged import merge_trainer
from gsac.stages.train.fast.refit import OF_SIZE
from gsac.stages.train.fast.schedule import budget
from gsac.stages.train.fast.size_rule import MOST_LOST, SizeScore, choose, optimism
from gsac.stages.train.judge.heldout import Candidate, judge_person
from gsac.stages.train.poses.photometric import converge
from gsac.stages.train.poses.poses import Poses, carry_to_untrained
from gsac.stages.train.task import Fit, Task

SHARES = 1, 2 / 3, 1 / 2, 1 / 3, 1 / 4, 1 / 6, 1 / 12
"""Sizes, of the largest; the largest is taken where no frame can judge."""
POSE_ROUNDS = 5
"""Rounds that move the held-out frames' poses, on any device: the choice shall not depend on it."""


def search(task: Task, backend: Backend) -> Fit:
    """The chosen size, with `size_curve` and `size_rule` among its figures."""
    sizes = list_sizes(budget(task, backend.device))
    if not len(task.choosing):
        return backend.fit(task, sizes[0])
    largest = backend.train(task, sizes[0])
    poses = carry_to_untrained(task.poses, task.trained)
    task.progress(0, len(sizes), "sizes at most")
    with ThreadPoolExecutor(1) as aside:
        judging = aside.submit(judge_largest, largest, sizes[0], task, poses)
        trained = refit_fewer(largest, sizes[1], task, backend)  # that size is tried whatever the first one's score
        tried = [judging.result(), judge_size(trained, sizes[1], task, poses)]
    for size in sizes[2:]:
        task.progress(len(tried), len(sizes), "sizes at most")
        scores = [score for _, score in tried]
        if choose(scores) is not scores[-1] and not task.config.every_size:
            break
        trained = refit_fewer(trained, size, task, backend)
        tried.append(judge_size(trained, size, task, poses))
    fits, scores = [fit for fit, _ in tried], [score for _, score in tried]
    best = choose(scores)
    figures = {"size_curve": [asdict(score) | score.means() | {"chosen": score is best} for score in scores],
               "size_rule": f"smallest within one standard error, and {MOST_LOST} dB, of the best psnr_fg of size_frames, their "
                            "poses moved to the images, and as sharp as the sharpest of these; size_optimism: by how many dB "
                            "these frames flatter the choice, since it was made by them; other heldout_frames do not",
               "size_frames": task.choosing.tolist(), "size_optimism": optimism(scores)}
    taken = scores.index(best)
    return replace(fits[taken], figures=figures, smaller=fits[taken + 1:])


def refit_fewer(trained: Trained, size: int, task: Task, backend: Backend) -> Trained:
    """What was trained, merged to `size` gaussians and refitted to the same views."""
    trainer, fine, coarse = trained
    assert trainer.seen is not None  # as `Backend.train` and `refit` leave it
    merged = merge_trainer(trainer.gaussians(), trainer.seen, size, task, coarse)
    return trained._replace(trainer=backend.refit(task, merged, fine, OF_SIZE, coarse))


def judge_largest(trained: Trained, size: int, task: Task, poses: Poses) -> tuple[Fit, SizeScore]:
    """`judge_size`, after the choosing frames of `poses` were moved to their images with these gaussians."""
    converge(trained.trainer.gaussians(), poses, task.choosing, task.views, POSE_ROUNDS)
    return judge_size(trained, size, task, poses)


def judge_size(trained: Trained, size: int, task: Task, poses: Poses) -> tuple[Fit, SizeScore]:
    """The finished gaussians, and how well they show the choosing frames in these poses. size: that was asked for."""
    trainer = trained.trainer
    fit = Fit(*trainer.finish(trained.coarse), dict(trainer.gains))
    rows, = judge_person([Candidate(fit.gaussians, poses, task.choosing, task.filmed)])
    decibels = [psnr(row["mse_fg"]) or 0.0 for row in rows]  # 0 where neither shows the person, whatever the size
    return fit, SizeScore(size, decibels, [row["detail"] for row in rows])


def list_sizes(largest: int) -> list[int]:
    """Numbers of gaussians to try, largest first."""
    return [round(share * largest) for share in SHARES]
