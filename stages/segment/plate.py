"""Compares a frame with the plate, the empty scene of a still camera: where the bare scene shows, and where it certainly does not.

A cast shadow changes a pixel too, but it darkens it and hardly changes its hue. Such pixels are left to the network.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

HALF = 2
"""The comparison is done at half size: a plate decides areas, not outlines."""
BARE, ALIKE, CHANGED = 2.5, 4.0, 6.0
"""Deviations from the plate, in units of the noise: below BARE a pixel is bare scene, below ALIKE it is where the network is not
sure, above CHANGED it is not."""
LEAST_NOISE, MOST_NOISE = 1.0, 4.0
"""Bounds of the noise of L* and of a* b*, in CIE Lab units; above the upper one the plate shows another scene."""
SHADOW = 45.0
"""Most by which a shadow darkens a pixel, in L*."""
SHADE, DIM = 20.0, 8.0
"""Most by which a pixel of unchanged hue may be darker and still be bare scene in shade, in L*: in a smooth area, and elsewhere."""
SURE = 0.9
"""Network probability from which on only the stricter of both limits overrules it."""
OPENING = 5, 3
"""px; bare scene narrower than this is taken for chance, where the network is sure and where it is not."""
CAMOUFLAGE = 0.06
"""Largest share of the sure person that may look like the plate: more than that is clothing, gaps between limbs are less."""
STRUCTURE, WINDOW = 4.0, 3.0
"""A shadow darkens evenly: a difference that varies by more than STRUCTURE (L*) about its mean over WINDOW (px) is an object."""


@dataclass
class Plate:
    """The empty scene."""

    image: np.ndarray
    """(H, W, 3) uint8."""
    known: np.ndarray
    """(H, W) bool: where it was seen."""
    most_changed: float = 0.3
    """Share of the background that may differ before the plate counts as one of another scene."""

    def part(self, box: tuple[int, int, int, int]) -> Plate:
        """box: x0, y0, x1, y1 px."""
        x0, y0, x1, y1 = box
        return Plate(self.image[y0:y1, x0:x1], self.known[y0:y1, x0:x1], self.most_changed)

    @cached_property
    def half(self) -> Plate:
        """At half size."""
        return Plate(halve(self.image), halve(self.known.astype(np.float32)) > 0.99, self.most_changed)


@dataclass
class Difference:
    """Of a frame from the plate."""

    gain: np.ndarray
    """(3,) float: factor that gives the plate the frame's exposure."""
    empty: np.ndarray
    """(H // 2, W // 2) bool: certainly bare scene."""
    changed: np.ndarray
    """(H // 2, W // 2) bool: certainly not the bare scene, and no shadow."""

    def part(self, box: tuple[int, int, int, int]) -> Difference:
        """box: x0, y0, x1, y1 px at full size, even numbers except at the frame's end."""
        x0, y0, x1, y1 = box
        half = np.s_[y0 // HALF: y1 // HALF, x0 // HALF: x1 // HALF]
        return Difference(self.gain, self.empty[half], self.changed[half])


def halve(image: np.ndarray) -> np.ndarray:
    """image: (H, W) or (H, W, 3). Returns it averaged down by two, (H // 2, W // 2, ...); an odd last row or column is left out."""
    height, width = (n // HALF for n in image.shape[:2])
    return cv2.resize(image[: height * HALF, : width * HALF], (width, height), interpolation=cv2.INTER_AREA)


def compare(image: np.ndarray, plate: Plate, person: np.ndarray) -> Difference | None:
    """image: (H, W, 3) uint8; plate: of this place, at half size; person: (H, W) network probability.

    None where the plate does not show this frame's scene: too much of the background differs.
    """
    image, person = halve(image), halve(person)
    outside = plate.known & (cv2.dilate((person > 0.05).astype(np.uint8), np.ones((15, 15), np.uint8)) == 0)
    if outside.mean() < 0.05:
        return None
    gain = measure_gain(plate.image, image, outside)
    light, hue = _difference(image, expose(plate.image, gain))
    light_noise = max(LEAST_NOISE, 1.4826 * float(np.median(np.abs(light[outside]))))
    hue_noise = max(LEAST_NOISE, 1.4826 * float(np.median(hue[outside])))
    away = np.hypot(hue / hue_noise, light / light_noise)
    if max(light_noise, hue_noise) > MOST_NOISE or (away[outside] > CHANGED).mean() > plate.most_changed:
        return None
    # Darker than the plate may be shadow, brighter may not.
    varies = cv2.GaussianBlur(np.abs(light - cv2.GaussianBlur(light, (0, 0), WINDOW)), (0, 0), WINDOW)
    smooth = varies < STRUCTURE
    shadow = (light < 0) & (light > -SHADOW) & (smooth | (person < 0.5))
    shade = (light < 0) & (light > np.where(smooth, -SHADE, -DIM)) & (hue < BARE * hue_noise)
    doubted = person < SURE
    empty = bare_scene((away < np.where(doubted, ALIKE, BARE)) | shade, person)
    changed = (np.where(shadow, hue / hue_noise, away) > CHANGED) & (person > 0.1)
    return Difference(gain, empty & plate.known, changed & plate.known)


def bare_scene(alike: np.ndarray, person: np.ndarray) -> np.ndarray:
    """alike: (h, w) bool, looks like the plate; person: (h, w) probability. Returns (h, w) bool, the wide parts of alike.

    The network fills the gaps between arms and trunk, so the plate may overrule it. Where much of the person looks like the plate,
    it is the clothing; then only parts that reach the outside of the person count.
    """
    alike, inside = alike.astype(np.uint8), person >= SURE
    wide = np.where(inside, *(cv2.morphologyEx(alike, cv2.MORPH_OPEN, np.ones((n, n), np.uint8)) for n in OPENING))
    if (wide[inside] > 0).mean() < CAMOUFLAGE:
        return wide > 0
    wide[inside] = 0
    _, labels = cv2.connectedComponents(wide, connectivity=4)
    return (wide > 0) & np.isin(labels, np.unique(labels[(person < 0.5) & (wide > 0)]))


def expose(plate: np.ndarray, gain: np.ndarray) -> np.ndarray:
    """plate: (h, w, 3) uint8; gain: (3,). Returns their product, (h, w, 3) uint8."""
    table = np.clip(np.arange(256)[:, None] * gain + 0.5, 0, 255).astype(np.uint8)
    return cv2.LUT(plate, table[None])


def measure_gain(plate: np.ndarray, image: np.ndarray, outside: np.ndarray) -> np.ndarray:
    """plate, image: (h, w, 3) uint8; outside: (h, w) bool, not the person. Returns (3,) the gain of each channel, plate to image: a
    median."""
    # Every second pixel is enough for a median.
    plate, image = plate[::2, ::2][outside[::2, ::2]], image[::2, ::2][outside[::2, ::2]]
    usable = (plate > 12).all(axis=1) & (plate < 245).all(axis=1) & (image < 245).all(axis=1)
    if usable.sum() < 100:
        return np.ones(3, np.float32)
    return np.clip(np.median(image[usable].astype(np.float32) / plate[usable], axis=0), 0.5, 2)


def _difference(image: np.ndarray, plate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Difference of L*, and distance in a* b*, both (h, w), of the lightly smoothed images."""
    lab = [cv2.cvtColor(cv2.GaussianBlur(x, (0, 0), 0.8).astype(np.float32) / 255, cv2.COLOR_RGB2Lab)
           for x in (image, plate)]
    step = lab[0] - lab[1]
    return step[..., 0], np.hypot(step[..., 1], step[..., 2])
