"""The recipes by name and device: what `train.recipe` and `train.device` choose from. A recipe is `fit(Task) -> Fit`."""

from functools import partial

from gsac.stages.train.config import AUTO
from gsac.stages.train.fast import cuda, lod, prealign, size_search
from gsac.stages.train.fast import trainer as fast
from gsac.stages.train.finite import finite, values
from gsac.stages.train.judge.heldout import align_poses
from gsac.stages.train.paper import cuda as paper_cuda
from gsac.stages.train.paper import trainer as paper
from gsac.stages.train.poses import bone_drift
from gsac.stages.train.task import Fit, Loop, Task


def fit_fast(loop: Loop, task: Task) -> Fit:
    """Poses moved to the images; the given number of gaussians, or the ladder; coarser levels; bones turned back to the fit's."""
    if task.resumed is None:
        prealign.adjust(task, loop.learning)
    fit = size_search.fit(task, loop) if task.config.gaussians == AUTO else fast.fit(task, loop)
    finite("after the last step", values(fit.gaussians))
    fit.gaussians, *fit.coarser = bone_drift.taken_back([fit.gaussians, *lod.coarser(task, loop, fit)], task.poses, task.trained)
    return fit


RECIPES = {
    ("fast", "cpu"): partial(fit_fast, Loop(fast.train, size_search.refit, prealign.learning_on_cpu)),
    ("fast", "cuda"): partial(fit_fast, Loop(cuda.train, cuda.refit, cuda.learning)),
    ("paper", "cpu"): paper.fit,
    ("paper", "cuda"): paper_cuda.fit,
}
ALIGN = {"cpu": align_poses, "cuda": cuda.align_poses}
"""Test-time pose optimisation by device."""
