"""The recipes by name and device: what `train.recipe` and `train.device` choose from."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import replace
from functools import partial

from gsac.avatar.gaussians import Gaussians
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
    """Aligns the poses, fits the given number of gaussians or searches for it; removes drift, holds joints; adds coarser levels.

    On a GPU these are fitted beside what else is done, and go on behind the caller.
    """
    if task.resumed is None:
        prealign.adjust(task, backend)
    fit = size_search.search(task, backend) if task.config.searches_size() else backend.fit(task, budget(task, backend.device))
    require_finite("after the last step", named_values(fit.gaussians))
    aside = ThreadPoolExecutor(1)
    fitting = aside.submit(lod.fit_levels, replace(task, poses=task.poses.copy()), backend, fit)
    if backend.device == "cpu" or task.network:  # torch records its graph alone
        wait([fitting])
    drift = bone_drift.remove_drift(task.poses, task.trained)
    coarser = aside.submit(lambda: finish(fitting.result(), drift, task))
    if backend.device == "cpu":
        wait([coarser])
    aside.shutdown(wait=False)
    return replace(fit, gaussians=finish([fit.gaussians], drift, task)[0], coarser=coarser)


def finish(levels: list[Gaussians], drift: bone_drift.Drift, task: Task) -> list[Gaussians]:
    """The gaussians of each level as they are handed out, on bones turned back, and on the body where joints bend."""
    return shrink_strays(hold_at_joints([drift.undo(level) for level in levels], task.poses, task.trained), task.poses, task.trained)


BACKENDS: dict[str, Backend] = {"cpu": Cpu(), "cuda": Cuda()}
"""By device; test-time poses of every recipe run there, too."""
RECIPES: dict[tuple[str, str], Callable[[Task], Fit]] = {
    ("fast", "cpu"): partial(fit_fast, BACKENDS["cpu"]),
    ("fast", "cuda"): partial(fit_fast, BACKENDS["cuda"]),
    ("paper", "cpu"): paper.fit,
    ("paper", "cuda"): paper_cuda.fit,
}
