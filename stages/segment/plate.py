"""What the empty scene of a still camera tells about a frame: where nothing changed, and where something must have.

A cast shadow changes a pixel too, but like a dimmer: darker, hardly another hue. Such pixels are left to the network.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

BARE, CHANGED = 2.5, 6.0
"""Noise widths below which a pixel is bare scene, and above which it is not."""
CHROMA_NOISE, LIGHT_NOISE = 1.5, 3.0
"""Least noise of a* b* and of L*, in CIE Lab units."""
SHADOW = 45.0
"""L* units by which a shadow may darken a pixel."""
SMOOTH = 1.5
"""px; single pixels are too noisy to be believed."""


@dataclass
class Difference:
    plate: np.ndarray
    """(H, W, 3) uint8: the plate in the frame's exposure."""
    empty: np.ndarray
    """(H, W) bool: certainly bare scene."""
    changed: np.ndarray
    """(H, W) bool: certainly not the bare scene, and no shadow."""


def compare(image: np.ndarray, plate: np.ndarray, person: np.ndarray) -> Difference | None:
    """image, plate: (H, W, 3) uint8; person: (H, W) network probability.

    None where the plate does not show this frame's scene (most of the background differs).
    """
    outside = cv2.dilate((person > 0.05).astype(np.uint8), np.ones((31, 31), np.uint8)) == 0
    if outside.mean() < 0.05:
        return None
    plate = match_exposure(plate, image, outside)
    light, chroma = _difference(image, plate)
    light_noise = max(LIGHT_NOISE, 1.4826 * float(np.median(np.abs(light[outside]))))
    chroma_noise = max(CHROMA_NOISE, 1.4826 * float(np.median(chroma[outside])))
    hue = chroma / chroma_noise
    # Darker than the plate may be shadow; brighter may not.
    bright = np.abs(light) / light_noise
    shadow_like = (light < 0) & (light > -SHADOW)
    away = np.hypot(hue, bright)
    if np.median(away[outside]) > BARE or (away[outside] > CHANGED).mean() > 0.3:
        return None
    empty = (away < BARE) & (person < 0.9)
    changed = (np.where(shadow_like, hue, away) > CHANGED) & (person > 0.1)
    return Difference(plate, empty, changed)


def match_exposure(plate: np.ndarray, image: np.ndarray, outside: np.ndarray) -> np.ndarray:
    """The plate times one gain a channel, the median over the pixels outside of the person."""
    usable = outside & (plate > 12).all(axis=2) & (plate < 245).all(axis=2) & (image < 245).all(axis=2)
    if usable.sum() < 100:
        return plate
    gain = np.median(image[usable].astype(np.float32) / plate[usable], axis=0)
    return np.clip(plate * np.clip(gain, 0.5, 2) + 0.5, 0, 255).astype(np.uint8)


def _difference(image: np.ndarray, plate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """L* difference, and distance in a* b*, both (H, W), of the lightly smoothed pictures."""
    lab = [cv2.cvtColor(cv2.GaussianBlur(x, (0, 0), SMOOTH).astype(np.float32) / 255, cv2.COLOR_RGB2Lab)
           for x in (image, plate)]
    step = lab[0] - lab[1]
    return step[..., 0], np.hypot(step[..., 1], step[..., 2])
