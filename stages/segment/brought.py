"""Masks that the user brought, as split laid them onto the frames: the alpha as it is, soft edges and all."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from gsac.avatar.artifacts import read_alpha, read_frame
from gsac.avatar.camera_motion import View, make_view
from gsac.avatar.mask_file import LEAST_SHOWN
from gsac.avatar.threads import available_cores, prefetch
from gsac.stages.contract import BadInput, StageError

MASKS = "masks"
"""Folder of `split/frames` that holds them."""


def hand_on(paths: list[Path], out: Path, empty: np.ndarray) -> Iterator[View]:
    """Copies the mask of each frame, and yields the frame's background. paths: T frames; empty: (T,) bool, set where a mask shows
    nobody."""
    folder = paths[0].parent / MASKS
    if not folder.is_dir():
        raise BadInput("segment.method is brought, but no masks lie beside the footage; put the video or the photos into a folder "
                       "with a folder masks, one mask a frame (docs/models.md), or choose another method")
    files = [folder / f"{path.stem}.exr" for path in paths]
    for t, file in enumerate(files):
        if not file.is_file():
            raise StageError(f"frame {t} ({paths[t].name}) has no mask {MASKS}/{file.name}; run split again")

    def view(t: int) -> View:
        alpha, image = read_alpha(files[t]), read_frame(paths[t])
        if alpha.shape != image.shape[:2]:
            raise StageError(f"{MASKS}/{files[t].name} is {alpha.shape[1]}x{alpha.shape[0]} px and its frame "
                             f"{image.shape[1]}x{image.shape[0]}; run split again")
        empty[t] = alpha.max() < LEAST_SHOWN
        shutil.copyfile(files[t], out / files[t].name)
        return make_view(image, alpha)

    with ThreadPoolExecutor(available_cores()) as pool:
        yield from prefetch(pool, view, range(len(paths)), available_cores())
