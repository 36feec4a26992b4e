"""Runs .tflite networks by LiteRT."""

from __future__ import annotations

from pathlib import Path
from threading import local

import numpy as np

from gsac.avatar.threads import available_cores


class Network:
    """One .tflite file; inputs and outputs lose their batch axis. Each thread that calls has an interpreter of its own."""

    def __init__(self, file: Path | bytes, threads: int | None = None):
        """file: or its content; threads: of each interpreter; all available cores unless given, at most four: more do not speed up
        nets this small."""
        self._model = {"model_content": file} if isinstance(file, bytes) else {"model_path": str(file)}
        self._threads, self._own = threads or min(4, available_cores()), local()
        interpreter = self._interpreter()
        self._inputs = [d["index"] for d in interpreter.get_input_details()]
        self._outputs = [d["index"] for d in interpreter.get_output_details()]
        _, self.height, self.width, _ = interpreter.get_input_details()[0]["shape"].tolist()

    def _interpreter(self):
        """The calling thread's."""
        if not hasattr(self._own, "interpreter"):
            from ai_edge_litert.interpreter import Interpreter

            self._own.interpreter = Interpreter(**self._model, num_threads=self._threads)
            self._own.interpreter.allocate_tensors()
        return self._own.interpreter

    def __call__(self, *images: np.ndarray) -> list[np.ndarray]:
        """Outputs in the file's order. images: (height, width, C) float32 for each input, in the network's own range."""
        interpreter = self._interpreter()
        for index, image in zip(self._inputs, images, strict=True):
            interpreter.set_tensor(index, np.ascontiguousarray(image[None], dtype=np.float32))
        interpreter.invoke()
        return [interpreter.get_tensor(i)[0] for i in self._outputs]
