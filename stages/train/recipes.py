"""The recipes by name and device: what `train.recipe` and `train.device` choose from. A recipe is `fit(Task) -> Fit`."""

from functools import partial

from gsac.stages.train import cuda, fast, ladder, paper, paper_cuda
from gsac.stages.train.config import AUTO
from gsac.stages.train.task import Fit, Loop, Task


def fit_fast(loop: Loop, task: Task) -> Fit:
    """The given number of gaussians, or the ladder."""
    return ladder.fit(task, loop) if task.config.gaussians == AUTO else fast.fit(task, loop)


RECIPES = {
    ("fast", "cpu"): partial(fit_fast, Loop(fast.train, ladder.refit)),
    ("fast", "cuda"): partial(fit_fast, Loop(cuda.train, cuda.refit)),
    ("paper", "cpu"): paper.fit,
    ("paper", "cuda"): paper_cuda.fit,
}
