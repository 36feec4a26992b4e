"""LiteRT interpreter behind one call."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np


class Network:
    """One .tflite file; input and outputs lose their batch axis."""

    def __init__(self, path: Path, threads: int | None = None):
        """threads: None takes the cores this process may use, at most four; more do not help nets this small."""
        from ai_edge_litert.interpreter import Interpreter

        threads = threads or min(4, len(os.sched_getaffinity(0)))
        self._interpreter = Interpreter(model_path=str(path), num_threads=threads)
        self._interpreter.allocate_tensors()
        self._input = self._interpreter.get_input_details()[0]["index"]
        self._outputs = [d["index"] for d in self._interpreter.get_output_details()]
        _, self.height, self.width, _ = self._interpreter.get_input_details()[0]["shape"].tolist()

    def __call__(self, image: np.ndarray) -> list[np.ndarray]:
        """image: (height, width, 3) float32 in the range the file asks for. Returns the outputs in the file's order."""
        self._interpreter.set_tensor(self._input, np.ascontiguousarray(image[None], dtype=np.float32))
        self._interpreter.invoke()
        return [self._interpreter.get_tensor(i)[0] for i in self._outputs]


def sigmoid(x: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-np.clip(x, -80, 80)))
