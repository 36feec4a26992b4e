"""Computes the plate of a video from a still camera: each pixel's median over the frames in which the person is elsewhere."""

from __future__ import annotations

from collections import deque
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np

from gsac.avatar.artifacts import read_frame
from gsac.avatar.threads import available_cores, prefetch
from gsac.stages.segment.network import PersonMask, person_region
from gsac.stages.segment.plate import Plate

SAMPLES = 24
"""Frames that the median is taken over, evenly spread over the clip."""
LEAST_SEEN = 3
"""Fewest of them in which a pixel must be free of the person."""
CLEAR = 0.01
"""Distance kept from what may be the person, as a share of the frame's height."""
BAND = 64
"""Rows that one thread sorts at a time."""
MOST_CHANGED = 0.03
"""Share of the background that may differ from the median; with more the camera moved."""


def learn_plate(paths: list[Path], xy: np.ndarray, score: np.ndarray, network: PersonMask) -> Plate | None:
    """paths: T frames; xy: (T, 133, 2) px; score: (T, 133). None where too few frames show the person."""
    regions = {t: person_region(np.nan_to_num(xy[t]), score[t])
               for t in np.unique(np.linspace(0, len(paths) - 1, SAMPLES).astype(int)).tolist()}
    images, free = [], []
    with ThreadPoolExecutor(available_cores()) as pool:
        seen = [t for t, region in regions.items() if region is not None]
        for t, image in zip(seen, prefetch(pool, lambda t: read_frame(paths[t]), seen, available_cores()), strict=True):
            reach = 2 * int(CLEAR * len(image)) + 1
            person = (network(image, regions[t]) > 0.05).astype(np.uint8)
            images.append(image)
            free.append(cv2.dilate(person, np.ones((reach, reach), np.uint8)) == 0)
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
            ordered = np.sort(np.where(free[:, rows], images[:, rows, :, channel], 255), axis=0)
            image[rows, :, channel] = np.take_along_axis(ordered, middle[:, rows], axis=0)[0]

    with ThreadPoolExecutor(available_cores()) as pool:
        deque(pool.map(band, [slice(k, k + BAND) for k in range(0, len(image), BAND)]), maxlen=0)
    return Plate(image, count >= LEAST_SEEN, MOST_CHANGED)
