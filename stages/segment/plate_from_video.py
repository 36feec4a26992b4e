"""Computes the plate of a video from a still camera: each pixel's median over the frames in which the person is elsewhere."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np

from gsac.avatar.frame_files import read_frame
from gsac.avatar.threads import available_cores, prefetch
from gsac.stages.segment.plate import Plate

SAMPLES = 24
"""Frames that the median is taken over, evenly spread over the clip."""
LEAST_SEEN = 3
"""Fewest of them in which a pixel must be free of the person."""
CLEAR, NEAR = 0.01, 0.005
"""Distance kept from what the network may take for the person, and from the outline, as shares of the frame's height."""
BAND = 64
"""Rows that one thread sorts at a time."""
MOST_CHANGED = 0.03
"""Share of the background that may differ from the median; with more the camera moved."""

Person = Callable[[int, np.ndarray], np.ndarray]
"""(index, image (H, W, 3) uint8) of a frame -> (H, W) bool, the person in it."""


def learn_plate(paths: list[Path], shown: np.ndarray, person: Person) -> Plate | None:
    """From where the network sees the person. paths: T frames; shown: (T,) bool, frames with a person.

    None where too few frames show the person.
    """
    return median_without(paths, [t for t in sample(len(paths)) if shown[t]], person, CLEAR)


def relearn_plate(paths: list[Path], shown: np.ndarray, outline: Person) -> Plate | None:
    """From the person's outlines, which lie closer. paths: T frames; shown: (T,) bool, frames with a person.

    None where too few frames show the person.
    """
    return median_without(paths, [t for t in sample(len(paths)) if shown[t]], outline, NEAR)


def sample(frames: int) -> list[int]:
    """Indices of at most SAMPLES of so many frames."""
    return np.unique(np.linspace(0, frames - 1, SAMPLES).astype(int)).tolist()


def median_without(paths: list[Path], frames: list[int], person: Person, clear: float) -> Plate | None:
    """Median of some of the frames. clear: distance kept from the person, as a share of the height."""
    images, free = [], []
    with ThreadPoolExecutor(available_cores()) as pool:
        for t, image in zip(frames, prefetch(pool, lambda t: read_frame(paths[t]), frames, available_cores()), strict=True):
            reach = 2 * int(clear * len(image)) + 1
            images.append(image)
            free.append(cv2.dilate(person(t, image).astype(np.uint8), np.ones((reach, reach), np.uint8)) == 0)
    if len(images) < 2 * LEAST_SEEN:
        return None
    return masked_median(np.stack(images), np.stack(free))


def masked_median(images: np.ndarray, free: np.ndarray) -> Plate:
    """images: (n, H, W, 3) uint8; free: (n, H, W) bool, the frames that count for each pixel."""
    count = free.sum(axis=0)
    middle = np.maximum((count - 1) // 2, 0)[None]
    image = np.empty(images.shape[1:], np.uint8)

    def band(rows: slice) -> None:
        for channel in range(3):
            # What does not count is sorted behind all that does.
            ordered = np.where(free[:, rows], images[:, rows, :, channel], np.uint8(255))
            sort_first_axis(ordered)
            image[rows, :, channel] = np.take_along_axis(ordered, middle[:, rows], axis=0)[0]

    with ThreadPoolExecutor(available_cores()) as pool:
        deque(pool.map(band, [slice(k, k + BAND) for k in range(0, len(image), BAND)]), maxlen=0)
    return Plate(image, count >= LEAST_SEEN, MOST_CHANGED)


def sort_first_axis(values: np.ndarray) -> None:
    """Sorts values (n, ...) along their first axis, in place, by exchanges of neighbours: for few long rows six times as fast as
    numpy."""
    for turn in range(len(values)):
        left, right = values[turn % 2:-1:2], values[turn % 2 + 1::2]
        low = np.minimum(left, right)
        np.maximum(left, right, out=right)
        left[:] = low
