"""The recipes by name: what `train.recipe` chooses from. A recipe is `fit(Task) -> Fit`."""

from gsac.stages.train import fast, ladder, paper
from gsac.stages.train.config import AUTO
from gsac.stages.train.task import Fit, Task


def fit_fast(task: Task) -> Fit:
    """The given number of gaussians, or the ladder."""
    return ladder.fit(task) if task.config.gaussians == AUTO else fast.fit(task)


RECIPES = {"fast": fit_fast, "paper": paper.fit}
