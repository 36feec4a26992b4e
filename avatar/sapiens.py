"""Sapiens' body parts (Khirodkar et al. 2024), by a network that the user brings as ONNX or TorchScript: a soft alpha, and labels.

Input (1, 3, 1024, 768): the whole frame, stretched to that size, RGB, less MEAN, by DEVIATION. Output (1, 28, h, w): a logit for
each class of `PARTS`, over the whole frame. Numbers and order of classes are those of the published model.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from gsac.avatar.brought_network import open_brought
from gsac.avatar.onnx_network import NetworkError
from gsac.avatar.region import Region

MODEL = "sapiens-seg"
"""Name under which the network is brought."""
HEIGHT, WIDTH = 1024, 768
MEAN = np.array([123.5, 116.5, 103.5], np.float32)
DEVIATION = np.array([58.5, 57.0, 57.5], np.float32)
PARTS = ("background", "apparel", "face_neck", "hair", "left_foot", "left_hand", "left_lower_arm", "left_lower_leg", "left_shoe",
         "left_sock", "left_upper_arm", "left_upper_leg", "lower_clothing", "right_foot", "right_hand", "right_lower_arm",
         "right_lower_leg", "right_shoe", "right_sock", "right_upper_arm", "right_upper_leg", "torso", "upper_clothing",
         "lower_lip", "upper_lip", "lower_teeth", "upper_teeth", "tongue")
"""Goliath's 28 classes: a label's number is its place here."""
CERTAIN = 80.0
"""Logits above the background's from which on alpha is 1 in any float."""
EXPECTED = f"expected Sapiens' segmentation: input [1, 3, {HEIGHT}, {WIDTH}], output [1, {len(PARTS)}, height, width]"


class Sapiens:
    """Who and what is in a frame. models: its file as `MODEL`; raises NetworkError where that is no such network."""

    def __init__(self, models: dict[str, Path]):
        self._network = open_brought(models[MODEL], MODEL)
        if not self._network.may_be([1, 3, HEIGHT, WIDTH], [1, len(PARTS), None, None]):
            raise NetworkError(f"model file {MODEL} has input {self._network.given} and output {self._network.gives}; {EXPECTED}")

    def __call__(self, image: np.ndarray, region: Region) -> np.ndarray:
        """image: (H, W, 3) uint8. Returns (H, W) float32, alpha of all persons: the network sees the whole frame."""
        return self.read(image)[0]

    def read(self, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """image: (H, W, 3) uint8. Returns alpha (H, W) float32 of all persons, and the label (H, W) uint8 of each pixel."""
        logits = self._network.run(prepare(image))
        if logits.ndim != 4 or logits.shape[1] != len(PARTS):
            raise NetworkError(f"model file {MODEL} gives an output of shape {logits.shape}; {EXPECTED}")
        return decide(logits[0], *image.shape[:2])


def prepare(image: np.ndarray) -> np.ndarray:
    """image: (H, W, 3) uint8 RGB. Returns the network's input (1, 3, 1024, 768) float32."""
    stretched = cv2.resize(image, (WIDTH, HEIGHT), interpolation=cv2.INTER_LINEAR).astype(np.float32)
    return np.ascontiguousarray(((stretched - MEAN) / DEVIATION).transpose(2, 0, 1)[None])


def decide(logits: np.ndarray, height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """logits: (28, h, w) over a frame of this size, px. Returns alpha (height, width) float32, one less the background's share of
    the softmax, and labels (height, width) uint8, the highest logits' classes."""
    labels, best = np.zeros((height, width), np.uint8), np.zeros((height, width), np.float32)
    odds = np.zeros((height, width), np.float32)
    # Over the background's logits, class by class: all at full size would be a gigabyte for a large frame.
    for part in range(1, len(logits)):
        above = cv2.resize(logits[part] - logits[0], (width, height), interpolation=cv2.INTER_LINEAR)
        labels[above > best] = part
        np.maximum(best, above, out=best)
        odds += np.exp(np.minimum(above, CERTAIN, out=above), out=above)
    return odds / (1 + odds), labels
