"""The recipes by name: what `train.recipe` chooses from. A recipe is `fit(Task) -> Fit`."""

from gsac.stages.train import fast, paper

RECIPES = {"fast": fast.fit, "paper": paper.fit}
