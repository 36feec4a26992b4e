"""Checkpoints: where a training stands, in one file that outlives its process.

A state is a dict of dicts, arrays and what JSON can say. A file is written whole or not at all, and its own checksums tell whether
it can still be read.
"""

from __future__ import annotations

import contextlib
import json
import os
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

EVERY_S = 10.0
"""Seconds of training from one checkpoint to the next, at least."""
COST = 0.01
"""Share of the training's time that writing checkpoints may take."""
FILE = "checkpoint.npz"

State = dict[str, Any]


class Checkpoints:
    """The newest state of one training. folder: None for nowhere; made when there is something to write."""

    def __init__(self, folder: Path | None, warn: Callable[[str], None]):
        self.path = None if folder is None else folder / FILE
        self.warn, self.cost = warn, 0.0
        self.began = self.last = time.perf_counter()

    def due(self, ends: bool) -> bool:
        """Whether it is time to write. ends: the steps are done; so far a training is worth it that took long enough."""
        if self.path is None:
            return False
        return time.perf_counter() - (self.began if ends else self.last) >= max(EVERY_S, self.cost / COST)

    def write(self, state: State) -> None:
        """The state takes the place of the one before. A disk that takes no more is warned of, once."""
        began = time.perf_counter()
        arrays: list[np.ndarray] = []
        tree = json.dumps(_apart(state, arrays))
        temp = self.path.with_name(f".{FILE}-{os.getpid()}")
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with temp.open("wb") as file:
                np.savez(file, np.array(tree), *arrays)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temp, self.path)
        except OSError as error:
            self.warn(f"No checkpoint can be written to {self.path.parent} ({error.strerror}); should this run be stopped, the "
                      "next one starts anew.")
            with contextlib.suppress(OSError):
                temp.unlink()
            self.path = None
        self.last = time.perf_counter()
        self.cost = self.last - began

    def read(self) -> State | None:
        """The state that a stopped run has left; None where there is none, or none that can be read, which is warned of."""
        if self.path is None or not self.path.exists():
            return None
        try:
            with np.load(self.path) as file:
                arrays = [file[f"arr_{k}"] for k in range(len(file.files))]
            return _together(json.loads(str(arrays[0])), arrays[1:])
        except (OSError, ValueError, KeyError, IndexError, EOFError, zipfile.BadZipFile) as error:
            self.warn(f"The checkpoint {self.path} cannot be read ({error}); training starts anew.")
            return None


def standing(step: int, order: list[int], rng: np.random.Generator, trainer: Any) -> State:
    """Where a loop stands after so many steps. order: frames that are still to come in this round."""
    return {"step": step, "order": order, "rng": rng.bit_generator.state, "trainer": trainer.state()}


def _apart(value: Any, arrays: list[np.ndarray]) -> dict:
    """The value as JSON can say it; arrays go to the end of `arrays`."""
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {"array": len(arrays) - 1}
    if isinstance(value, dict):
        return {"fields": {name: _apart(part, arrays) for name, part in value.items()}}
    return {"value": value}


def _together(tree: dict, arrays: list[np.ndarray]) -> Any:
    if "array" in tree:
        return arrays[tree["array"]]
    if "fields" in tree:
        return {name: _together(part, arrays) for name, part in tree["fields"].items()}
    return tree["value"]
