"""Checkpoints: the state of a training in one file that outlives its process.

A state is a dict of dicts, arrays and JSON values. A file is written whole or not at all, and its checksums show whether it can
still be read.
"""

from __future__ import annotations

import contextlib
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from gsac.avatar.npz import read_npz
from gsac.stages.findings import Code, Finding

EVERY_S = 10.0
"""Least seconds of training from one checkpoint to the next."""
COST = 0.01
"""Share of the training's time that writing checkpoints may take."""
FILE = "checkpoint.npz"

State = dict[str, Any]


class Checkpoints:
    """The newest state of one training. folder: made when there is something to write; None: nothing is kept."""

    def __init__(self, folder: Path | None, warn: Callable[[Finding], None]):
        self.path = None if folder is None else folder / FILE
        self.warn, self.cost = warn, 0.0
        self.began = self.last = time.perf_counter()

    def due(self, ends: bool) -> bool:
        """Whether it is time to write. ends: the steps are done; then one is due if the training as a whole took long enough."""
        if self.path is None:
            return False
        return time.perf_counter() - (self.began if ends else self.last) >= max(EVERY_S, self.cost / COST)

    def write(self, state: State) -> None:
        """Replaces the state before. Where the disk refuses, warns once and writes no more."""
        began = time.perf_counter()
        arrays: list[np.ndarray] = []
        tree = json.dumps(_take_apart(state, arrays))
        temp = self.path.with_name(f".{FILE}-{os.getpid()}")
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with temp.open("wb") as file:
                np.savez(file, np.array(tree), *arrays)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temp, self.path)
        except OSError as error:
            with contextlib.suppress(OSError):
                temp.unlink()
            self.warn(Finding.of(Code.NO_CHECKPOINT, folder=temp.parent, error=error.strerror))
            self.path = None
        self.last = time.perf_counter()
        self.cost = self.last - began

    def read(self) -> State | None:
        """The state that a stopped run left; None where there is none, or, with a warning, where it cannot be read."""
        if self.path is None or not self.path.exists():
            return None
        try:
            found = read_npz(self.path)
            arrays = [found[f"arr_{k}"] for k in range(len(found))]
            return _put_together(json.loads(str(arrays[0])), arrays[1:])
        except (OSError, ValueError, KeyError, IndexError, TypeError, AttributeError, RecursionError) as error:
            self.warn(Finding.of(Code.CHECKPOINT_UNREADABLE, path=self.path, error=error))
            return None


class HasState(Protocol):
    """What can be kept in a checkpoint."""

    def state(self) -> State:
        """The state, to be restored from."""
        ...


def loop_state(step: int, order: list[int], rng: np.random.Generator, trainer: HasState, mean: HasState) -> State:
    """The state of a training loop after `step` steps. order: frames still to come in this round; mean: of the last steps."""
    return {"step": step, "order": order, "rng": rng.bit_generator.state, "trainer": trainer.state(), "mean": mean.state()}


def _take_apart(value: Any, arrays: list[np.ndarray]) -> dict:
    """The value as JSON; its arrays are appended to `arrays`."""
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {"array": len(arrays) - 1}
    if isinstance(value, dict):
        return {"fields": {name: _take_apart(part, arrays) for name, part in value.items()}}
    return {"value": value}


def _put_together(tree: dict, arrays: list[np.ndarray]) -> Any:
    if "array" in tree:
        return arrays[tree["array"]]
    if "fields" in tree:
        return {name: _put_together(part, arrays) for name, part in tree["fields"].items()}
    return tree["value"]
