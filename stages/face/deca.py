"""DECA's encoder (Feng et al. 2021), brought by the user as ONNX or TorchScript: a face crop's FLAME shape, expression and jaw.

Input 3 x 224 x 224, RGB in 0..1; output 236 numbers: 100 shape, 50 texture, 50 expression, 6 pose (rotation vectors of head and
jaw), 3 camera, 27 light. The numbers mean what the user's FLAME file says, so they are read with it and never without.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from gsac.avatar.brought_network import open_brought
from gsac.avatar.facemesh import IBUG68
from gsac.avatar.onnx_network import NetworkError
from gsac.stages.contract import BadInput
from gsac.stages.face.config import ENCODER

SIZE, CODES = 224, 236
SHAPE, EXPRESSION, JAW = slice(0, 100), slice(150, 200), slice(203, 206)
"""Places of what is used in the output."""
TALL, WIDE = 1.1, 1.25
"""Side of the crop's square: the mean of width and height of the 68 points, times both (DECA's own data loader)."""


class DecaEncoder:
    """path: the file. Raises BadInput where it is no such network."""

    def __init__(self, path: Path):
        try:
            self._network = open_brought(path, ENCODER)
        except NetworkError as error:
            raise BadInput(str(error)) from error
        if not self._network.may_be([None, 3, SIZE, SIZE], [None, CODES]):
            raise BadInput(f"model file {ENCODER} takes {self._network.given} and gives {self._network.gives}; expected DECA's "
                           f"E_flame: [N, 3, {SIZE}, {SIZE}] and [N, {CODES}]")

    def read(self, image: np.ndarray, points: np.ndarray) -> np.ndarray:
        """The codes (236,) of one face. image: (H, W, 3) uint8 RGB; points: (468, 2 or 3) px, of the face network."""
        ready = (cut_face(image, points[IBUG68, :2]) / np.float32(255)).transpose(2, 0, 1)[None]
        try:
            codes = self._network.run(ready)
        except NetworkError as error:
            raise BadInput(str(error)) from error
        if codes.shape != (1, CODES):
            raise BadInput(f"model file {ENCODER} gives {codes.shape}; expected (1, {CODES})")
        return codes[0].astype(np.float64)


def cut_face(image: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The square about the 68 points as the encoder takes it: (224, 224, 3) uint8, black outside the frame.

    image: (H, W, 3) uint8 RGB; points: (68, 2) px. The square's corners come to lie on the middles of the crop's corner pixels.
    """
    low, high = points.min(0), points.max(0)
    side = float((high - low).mean()) * TALL * WIDE
    corner = (low + high) / 2 - side / 2 - 0.5  # OpenCV counts from pixel centres, we from their corners
    step = side / (SIZE - 1)
    matrix = np.array([[step, 0, corner[0]], [0, step, corner[1]]])
    return cv2.warpAffine(image, matrix, (SIZE, SIZE), flags=cv2.WARP_INVERSE_MAP | cv2.INTER_LINEAR)
