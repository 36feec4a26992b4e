"""Runs .tflite networks by LiteRT."""

from __future__ import annotations

from pathlib import Path
from threading import local

import numpy as np

from gsac.avatar.threads import available_cores


class Network:
    """One .tflite file; input and outputs lose their batch axis. Each thread that calls has an interpreter of its own."""

    def __init__(self, path: Path, threads: int | None = None):
        """threads: of each interpreter; all available cores unless given, at most four: more do not speed up nets this small."""
        self._path, self._threads, self._own = path, threads or min(4, available_cores()), local()
        interpreter = self._interpreter()
        self._input = interpreter.get_input_details()[0]["index"]
        self._outputs = [d["index"] for d in interpreter.get_output_details()]
        _, self.height, self.width, _ = interpreter.get_input_details()[0]["shape"].tolist()

    def _interpreter(self):
        """The calling thread's."""
        if not hasattr(self._own, "interpreter"):
            from ai_edge_litert.interpreter import Interpreter

            self._own.interpreter = Interpreter(model_path=str(self._path), num_threads=self._threads)
            self._own.interpreter.allocate_tensors()
        return self._own.interpreter

    def __call__(self, image: np.ndarray) -> list[np.ndarray]:
        """Outputs in the file's order. image: (height, width, 3) float32 in the network's own range."""
        interpreter = self._interpreter()
        interpreter.set_tensor(self._input, np.ascontiguousarray(image[None], dtype=np.float32))
        interpreter.invoke()
        return [interpreter.get_tensor(i)[0] for i in self._outputs]
