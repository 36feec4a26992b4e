"""Results of an earlier stage that end before the clip does: what they lack counts as not seen, and is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gsac.avatar.artifacts import NOWHERE, PER_FRAME, check_keypoints, frame_paths
from gsac.stages.contract import StageError


def read_keypoints(path: Path, frames: int | None) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Reads keypoints.npz. frames: of the clip; None: as many as it holds.

    Returns its arrays by name, of all frames, no point found in those after its end, and these (T,) bool. Raises StageError where
    it has none, or more frames than the clip.
    """
    arrays = check_keypoints(path)
    held = len(arrays["xy"])
    frames = held if frames is None else frames
    if not 0 < held <= frames:
        raise StageError(f"{path.name} holds {held} frames, and the clip has {frames}; run keypoints again")
    if held < frames:
        arrays |= {name: _lengthen(arrays[name], frames, np.nan if name in NOWHERE else 0) for name in PER_FRAME & arrays.keys()}
    return arrays, np.arange(frames) >= held


def pair_masks(names: list[str], alphas: Path) -> list[Path | None]:
    """names: (T,) of the frames' files, without their ends; alphas: the folder of masks.

    Returns (T,) the mask of each, None where the folder lacks it. Raises StageError where it lacks all, or holds another's.
    """
    masks = {path.stem: path for path in frame_paths(alphas)}
    if strange := sorted(masks.keys() - set(names)):
        raise StageError(f"{masks[strange[0]]} is the mask of none of the clip's {len(names)} frames; "
                         "run segment again")
    if not masks:
        raise StageError(f"{alphas} holds no mask; run segment again")
    return [masks.get(name) for name in names]


def _lengthen(array: np.ndarray, frames: int, nothing: float) -> np.ndarray:
    """array: (t, ...). Returns (frames, ...), `nothing` after its end."""
    return np.concatenate([array, np.full((frames - len(array), *array.shape[1:]), nothing, array.dtype)])
