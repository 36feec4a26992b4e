"""The recipes by name and device: what `train.recipe` and `train.device` choose from."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import replace
from functools import partial

from gsac.stages.train.fast import lod, prealign, size_search
from gsac.stages.train.fast.backend import Backend
from gsac.stages.train.fast.cpu import Cpu
from gsac.stages.train.fast.cuda import Cuda
from gsac.stages.train.fast.finish import Finish
from gsac.stages.train.fast.schedule import budget
from gsac.stages.train.finite import named_values, require_finite
from gsac.stages.train.gaussians.coarser import Coarser
from gsac.stages.train.gaussians.specks import find_specks
from gsac.stages.train.paper import cuda as paper_cuda
from gsac.stages.train.paper import trainer as paper
from gsac.stages.train.poses.expressions import find_rest
from gsac.stages.train.task import Fit, Task


def fit_fast(backend: Backend, task: Task) -> Fit:
    """Aligns the poses, fits the given number of gaussians or searches for it, less specks; adds coarser levels; finishes them all.

    On a GPU the levels are fitted beside what else is done, and go on behind the caller.
    """
    if task.resumed is None:
        prealign.adjust(task, backend)
    fit = size_search.search(task, backend) if task.config.searches_size() else backend.fit(task, budget(task, backend.device))
    require_finite("after the last step", named_values(fit.gaussians))
    task.poses.rest_expression = find_rest(task.poses, task.trained)
    kept = ~find_specks(fit.gaussians, task.poses, {int(t): task.views[t] for t in task.trained})
    fit = replace(fit, gaussians=fit.gaussians[kept], seen=fit.seen[kept])
    with_drift = replace(task, poses=task.poses.copy())
    aside, coarser = ThreadPoolExecutor(2), Coarser()
    finish = aside.submit(Finish, task.poses, task.trained)
    levels = aside.submit(lod.fit_levels, with_drift, backend, fit, lambda level: finish.result()(level).gaussians, coarser.add)
    levels.add_done_callback(lambda done: coarser.end(done.exception()))
    aside.shutdown(wait=False)
    if backend.device == "cpu" or task.network:  # torch records its graph alone
        wait([levels])
    finest, source = finish.result()(fit.gaussians)
    return replace(fit, gaussians=finest, seen=fit.seen[source], coarser=coarser)


BACKENDS: dict[str, Backend] = {"cpu": Cpu(), "cuda": Cuda()}
"""By device; test-time poses of every recipe run there, too."""
RECIPES: dict[tuple[str, str], Callable[[Task], Fit]] = {
    ("fast", "cpu"): partial(fit_fast, BACKENDS["cpu"]),
    ("fast", "cuda"): partial(fit_fast, BACKENDS["cuda"]),
    ("paper", "cpu"): paper.fit,
    ("paper", "cuda"): paper_cuda.fit,
}
