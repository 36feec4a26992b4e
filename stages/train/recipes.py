"""The recipes by name: what `train.recipe` chooses from. A recipe is `fit(Task) -> Fit`."""

from gsac.stages.train import fast

RECIPES = {"fast": fast.fit}
