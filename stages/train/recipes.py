"""The recipes by name and device: what `train.recipe` and `train.device` choose from."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from gsac.stages.train.fast import lod, prealign, size_search
from gsac.stages.train.fast.backend import Backend
from gsac.stages.train.fast.cpu import Cpu
from gsac.stages.train.fast.cuda import Cuda
from gsac.stages.train.fast.schedule import budget
from gsac.stages.train.finite import named_values, require_finite
from gsac.stages.train.gaussians.joint_faces import hold_at_joints
from gsac.stages.train.gaussians.joint_strays import shrink_strays
from gsac.stages.train.paper import cuda as paper_cuda
from gsac.stages.train.paper import trainer as paper
from gsac.stages.train.poses import bone_drift
from gsac.stages.train.task import Fit, Task


def fit_fast(backend: Backend, task: Task) -> Fit:
    """Aligns the poses, fits the given number of gaussians or searches for it, adds coarser levels; removes drift, holds joints."""
    if task.resumed is None:
        prealign.adjust(task, backend)
    fit = size_search.search(task, backend) if task.config.searches_size() else backend.fit(task, budget(task, backend.device))
    require_finite("after the last step", named_values(fit.gaussians))
    levels = [fit.gaussians, *lod.fit_levels(task, backend, fit)]
    levels = bone_drift.remove_drift(levels, task.poses, task.trained)
    levels = hold_at_joints(levels, task.poses, task.trained)
    fit.gaussians, *fit.coarser = shrink_strays(levels, task.poses, task.trained)
    return fit


BACKENDS: dict[str, Backend] = {"cpu": Cpu(), "cuda": Cuda()}
"""By device; test-time poses of every recipe run there, too."""
RECIPES: dict[tuple[str, str], Callable[[Task], Fit]] = {
    ("fast", "cpu"): partial(fit_fast, BACKENDS["cpu"]),
    ("fast", "cuda"): partial(fit_fast, BACKENDS["cuda"]),
    ("paper", "cpu"): paper.fit,
    ("paper", "cuda"): paper_cuda.fit,
}
