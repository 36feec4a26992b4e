"""The mean of the gaussians over some steps of a training: a single step has just followed the one frame that it saw."""

from __future__ import annotations

import numpy as np

from gsac.stages.train.checkpoint import State


class MeanOfSteps:
    """Sums up what is learned, step by step."""

    def __init__(self) -> None:
        self._sums: dict[str, np.ndarray] = {}
        self._count = 0

    def add(self, values: dict[str, np.ndarray]) -> None:
        """values: name -> (N, ...) after a step, the same names and shapes each time."""
        for name, value in values.items():
            self._sums[name] = self._sums[name] + value if name in self._sums else value.astype(np.float64)
        self._count += 1

    def values(self) -> dict[str, np.ndarray]:
        """Name -> (N, ...) float32, the mean. At least one step has been added."""
        return {name: (total / self._count).astype(np.float32) for name, total in self._sums.items()}

    def state(self) -> State:
        """For a checkpoint."""
        return {"sums": self._sums, "count": self._count}

    def restore(self, state: State) -> None:
        """Goes on from what `state` returned."""
        self._sums, self._count = state["sums"], state["count"]
