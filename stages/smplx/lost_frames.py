"""Detects frames whose fit failed, and why; training skips them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from gsac.stages.contract import BadInput
from gsac.stages.counting import counted
from gsac.stages.findings import Code, Finding
from gsac.stages.mask_place import HELD, share_held
from gsac.stages.smplx.silhouette import Outline
from gsac.stages.smplx.state import Fit

POOR_IOU = 0.7
LOOSE_IOU, LOOSE = 0.87, 3
"""IoU that is low though the frame is kept, and frames of it that are news: seven clean clips have 0.92 and more in the median, and
one frame of 0.89; pictures that mix two or three moments, 18 degrees of the turn apart, 0.84 to 0.88 in the median."""
FALL = 0.12
"""A frame's IoU is lost this far below the clip's median: a wide coat lowers it in every frame, a wrong pose in one."""
UNCOVERED, FEW = 0.003, 2
"""Area of the mask beside the body that is news, as a share of the person's height squared, and frames of it: clean turns and real
clips have 0.001 at most, pictures whose last row is a twentieth of a turn later than their first up to 0.005."""
MOSTLY = 0.5
"""Share of frames of low IoU from which on pictures do not tell where an arm is: where they mix three moments 0.6 to 0.8. With more
masks beside the person these are to blame, not clothes."""
SLIVER = 0.6
"""Share of the usual area below which a mask is what is left of a person who leaves the picture: there the points are wrong."""
BY_MASKS = (Code.CLOTHES_HIDE_SHAPE, Code.PART_HIDDEN)
"""What is found by masks that are taken to be right."""
REPEATED = "the picture is an earlier frame's"
FAR = 0.05
"""Median reprojection error of a lost frame, as a share of the person's height; a good fit has a tenth of it."""


def find_lost_frames(fit: Fit, seen: np.ndarray, height: float, own: np.ndarray) -> dict[str, np.ndarray]:
    """Reason -> frames (T,) bool; a frame has at most one reason.

    seen: (T,) bool, frames with a person; height: px, of the person; own: (T,) bool, frames that repeat no other.
    """
    iou, off = np.nan_to_num(fit.iou, nan=1.0), np.nan_to_num(fit.reprojection, nan=0.0)
    seen = seen & own
    usual = np.median(iou[seen]) if seen.any() else 1.0
    uncovered = seen & (iou < min(POOR_IOU, usual - FALL))
    away = seen & ~uncovered & (off > FAR * height)
    return {REPEATED: ~own, "no person is seen": own & ~seen,
            f"the body covers the silhouette badly (IoU below {POOR_IOU})": uncovered,
            f"the body lies more than {FAR:.0%} of its height off the seen points": away}


def refuse_lost(lost: dict[str, np.ndarray]) -> None:
    """Raises BadInput where no frame is left. lost: reason -> frames (T,) bool."""
    if np.any(list(lost.values()), axis=0).all():
        told = "; ".join(f"{reason} in {mask.sum()}" for reason, mask in lost.items() if mask.any())
        raise BadInput(f"The body fits none of the clip's {counted(len(lost[REPEATED]), 'frame')}: {told}; film one whole "
                       "person from head to feet, upright, and look whether masks, points or poses that you bring are this clip's")


def is_mostly_loose(iou: np.ndarray) -> bool:
    """Whether the body covers the silhouette badly in most frames. iou: (T,), NaN without alpha."""
    known = iou[np.isfinite(iou)]
    return len(known) > 0 and bool((known < LOOSE_IOU).mean() > MOSTLY)


def find_beside(outlines: list[Outline], points: dict[str, np.ndarray], seen: np.ndarray) -> np.ndarray:
    """(T,) bool, frames whose mask lies beside the person. points: arrays of keypoints.npz, xy (T, 133, 2) px, score (T, 133);
    seen: (T,) bool, frames with a person."""
    area = np.array([outline.area for outline in outlines])
    least = SLIVER * np.median(area[seen]) if seen.any() else 0.0
    return seen & (area >= least) & np.array([share_held(outline.mask, xy, score, outline.scale) < HELD for outline, xy, score
                                              in zip(outlines, points["xy"], points["score"], strict=True)])


def notes_that_hold(notes: Iterable[Finding], beside: np.ndarray, seen: np.ndarray) -> list[Finding]:
    """Those without any that blames clothes, or things before the person, for masks. beside, seen: (T,) bool, frames whose mask
    lies beside the person, and frames with a person."""
    misled = (beside & seen).sum() > MOSTLY * seen.sum()
    return [note for note in notes if not (misled and note.code in BY_MASKS)]


def describe_lost_frames(lost: dict[str, np.ndarray], fit: Fit, beside: np.ndarray) -> list[Finding]:
    """What the user should know: lost frames by reason, and frames that were kept though the body covers the silhouette badly.

    lost: reason -> frames (T,) bool; beside: (T,) bool, frames whose mask lies beside the person, which has been told.
    """
    out = [Finding.of(Code.NOT_FITTED, mask, reason=reason) for reason, mask in lost.items()
           if mask.any() and reason != REPEATED]  # `split` has said so
    kept = ~np.any(list(lost.values()), axis=0) & ~beside
    low = kept & (np.nan_to_num(fit.iou, nan=1.0) < LOOSE_IOU)
    bare = kept & (fit.uncovered > UNCOVERED if fit.uncovered is not None else False)
    loose = low & (low.sum() >= min(LOOSE, len(low))) | bare & (bare.sum() >= min(FEW, len(bare)))
    if loose.any():
        out.append(Finding.of(Code.POORLY_COVERED, loose, figure=np.nan_to_num(fit.iou, nan=1.0)[loose].min()))
    return out
