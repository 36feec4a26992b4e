"""Masks that the user brought, as split laid them onto the frames: the alpha as it is, soft edges and all."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from gsac.avatar.camera_motion import View, make_view
from gsac.avatar.frame_files import read_alpha, read_frame
from gsac.avatar.mask_file import LEAST_SHOWN
from gsac.avatar.threads import available_cores, prefetch
from gsac.stages.contract import BadInput, StageError
from gsac.stages.frame_names import name_frames
from gsac.stages.mask_place import HELD, share_held

MASKS = "masks"
"""Folder of `split/frames` that holds them."""
MOSTLY = 0.5
"""Share of the picture's edge that is white in an inverted mask, and of the person's frames that have one."""


def hand_on(paths: list[Path], out: Path, keypoints: dict[str, np.ndarray], empty: np.ndarray,
            inverted: np.ndarray) -> Iterator[View]:
    """Copies the mask of each frame, and yields the frame's background. paths: T frames; keypoints: their arrays (T, ...) by name;
    empty, inverted: (T,) bool, set where a mask shows nobody, or all but the person."""
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
        inverted[t] = is_inverted(alpha, keypoints["xy"][t], keypoints["score"][t])
        shutil.copyfile(files[t], out / files[t].name)
        return make_view(image, alpha)

    with ThreadPoolExecutor(available_cores()) as pool:
        yield from prefetch(pool, view, range(len(paths)), available_cores())


def is_inverted(alpha: np.ndarray, xy: np.ndarray, score: np.ndarray) -> bool:
    """Whether a mask is white at most of the picture's edge, and black where the points are. alpha: (H, W); xy: (133, 2) px; score:
    (133,)."""
    mask = alpha > 0.5
    edge = np.concatenate([mask[0], mask[-1], mask[:, 0], mask[:, -1]])
    return bool(edge.mean() > MOSTLY) and share_held(mask, xy, score) < HELD


def refuse_inverted(paths: list[Path], inverted: np.ndarray, score: np.ndarray) -> None:
    """Raises BadInput where most masks of a person are inverted. paths: T frames; inverted: (T,) bool, those masks; score: (T, 133)
    of the points."""
    if inverted.sum() > MOSTLY * score.any(1).sum():
        first = paths[int(np.flatnonzero(inverted)[0])]
        raise BadInput(f"The masks of {name_frames(inverted)}, the first of them {MASKS}/{first.stem}.exr, look inverted: they are "
                       "black where the person is. Masks are white where the person is and black elsewhere; exchange black and "
                       "white in them.")
