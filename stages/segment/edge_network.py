"""Alpha near the outline, and in what that has lost, by a small network, which sees frame, empty scene, outline and rough region.

A U-Net of 0.27 million weights, trained on rendered people of whom no figure in docs/lab is one (`tools/edge_network/`).
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

from gsac.avatar.onnx_network import open_network
from gsac.stages.segment.plate import Plate

if TYPE_CHECKING:
    from onnxruntime import InferenceSession

NETWORK = Path(__file__).with_name("edge_network.onnx")
"""Written by `tools/edge_network/`."""
STEP = 16
"""The network halves its picture four times, so both sides are multiples of this."""
AROUND = 24
"""px about the outline that the network sees."""
BAND = 16
"""px on each side of the outline whose alpha is the network's: deep inside clothes may look like the scene, and far outside others
may stand."""


class CloseUp(NamedTuple):
    """What the network is shown of a frame."""

    image: np.ndarray
    """(H, W, 3) uint8."""
    outline: np.ndarray
    """(H, W) bool."""
    probability: np.ndarray
    """(H, W) uint8, 255: certainly the person."""
    scene: Plate | None
    """The empty scene in the frame's exposure; None where nobody knows it."""
    lost: np.ndarray
    """(H, W) bool: `correction.find_lost`."""

    def stacked(self) -> np.ndarray:
        """(H, W, 9) uint8: image, scene, where the scene is known, outline, probability."""
        height, width = self.outline.shape
        planes = np.zeros((height, width, 9), np.uint8)
        planes[..., :3] = self.image
        if self.scene is not None:
            planes[..., 3:6] = self.scene.image * self.scene.known[..., None]
            planes[..., 6] = self.scene.known * 255
        planes[..., 7] = self.outline * 255
        planes[..., 8] = self.probability
        return planes


def find_alpha(seen: CloseUp) -> np.ndarray:
    """(H, W) float32 alpha: the network's within `BAND` of the outline and in what that has lost, elsewhere the outline."""
    outline = seen.outline.astype(np.uint8)
    alpha = seen.outline.astype(np.float32)
    theirs = seen.outline | seen.lost
    rows, columns = np.flatnonzero(theirs.any(axis=1)), np.flatnonzero(theirs.any(axis=0))
    if len(rows) == 0:
        return alpha
    part = np.s_[max(0, rows[0] - AROUND): rows[-1] + AROUND + 1, max(0, columns[0] - AROUND): columns[-1] + AROUND + 1]
    near = _square(BAND)
    band = ((cv2.dilate(outline, near) > 0) & (cv2.erode(outline, near) == 0) | seen.lost)[part]
    alpha[part][band] = np.minimum(_ask(seen.stacked()[part])[band], 1)  # its last step may end a rounding above 1
    return alpha


def open_edge_network() -> None:
    """Reads the network, which takes a moment."""
    _session()


def _ask(planes: np.ndarray) -> np.ndarray:
    """planes: (h, w, 9) uint8 of `CloseUp.stacked`. Returns what the network says, (h, w) float32."""
    height, width = planes.shape[:2]
    ready = np.pad(planes, ((0, -height % STEP), (0, -width % STEP), (0, 0)), mode="edge")
    (alpha,) = _session().run(None, {"planes": ready[None]})
    return np.asarray(alpha)[0, :height, :width]


@cache
def _session() -> InferenceSession:
    """The open network. Each call takes one thread: frames are many."""
    return open_network(NETWORK, NETWORK.name, threads=1)


def _square(reach: int) -> np.ndarray:
    """The neighbourhood of so many px to each side."""
    return np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
