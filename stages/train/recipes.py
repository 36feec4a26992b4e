"""The recipes by name and device: what `train.recipe` and `train.device` choose from. A recipe is `fit(Task) -> Fit`."""

from functools import partial

from gsac.stages.train import bundle, cuda, fast, gauge, ladder, levels, paper, paper_cuda
from gsac.stages.train.config import AUTO
from gsac.stages.train.evaluate import align_poses
from gsac.stages.train.guard import finite, values
from gsac.stages.train.task import Fit, Loop, Task


def fit_fast(loop: Loop, task: Task) -> Fit:
    """Poses moved to the images; the given number of gaussians, or the ladder; coarser levels; bones turned back to the fit's."""
    if task.resumed is None:
        bundle.adjust(task, loop.learning)
    fit = ladder.fit(task, loop) if task.config.gaussians == AUTO else fast.fit(task, loop)
    finite("after the last step", values(fit.gaussians))
    fit.gaussians, *fit.coarser = gauge.taken_back([fit.gaussians, *levels.coarser(task, loop, fit)], task.poses, task.trained)
    return fit


RECIPES = {
    ("fast", "cpu"): partial(fit_fast, Loop(fast.train, ladder.refit, bundle.learning_on_cpu)),
    ("fast", "cuda"): partial(fit_fast, Loop(cuda.train, cuda.refit, cuda.learning)),
    ("paper", "cpu"): paper.fit,
    ("paper", "cuda"): paper_cuda.fit,
}
ALIGN = {"cpu": align_poses, "cuda": cuda.align_poses}
"""Test-time pose optimisation by device."""
