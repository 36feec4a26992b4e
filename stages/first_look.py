"""What the key points tell of a clip before anything is fitted: how much of a person was seen, how large, from which sides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsac.avatar.wholebody import FACE, HANDS, INDEX
from gsac.avatar.yaw import degrees_covered, yaw_of
from gsac.stages.counting import count_of

LEFT, RIGHT = ([INDEX[f"{side}_{part}"] for part in ("shoulder", "hip")] for side in ("left", "right"))
SEEN = 0.3
"""Score from which on a point counts."""
BODY_SPAN = 0.9
"""Eyes to ankles, as a part of the height."""
LARGEST = 90
"""Percentile of the frames that stands for a part's size where it is seen well."""

LEAST_TURN = 270
"""Degrees of the person's turn below which the user is warned."""


@dataclass(frozen=True)
class FirstLook:
    """The clip at a glance. Sizes in px; 0 where the part was never seen."""

    frames: int
    """That were looked at."""
    seen: int
    """Frames with a person."""
    height_px: float
    """Of the person, head to feet."""
    turn: float
    """Degrees of 360 from which the person was seen."""
    face_px: float
    """Longer side of the face where it is seen well."""
    hand_px: float
    """Likewise of a hand."""

    @classmethod
    def of(cls, points: dict[str, np.ndarray]) -> FirstLook:
        """points: arrays of keypoints.npz, xy (T, 133, 2) px, score (T, 133), world (T, 133, 3) m."""
        xy, score, seen = points["xy"], points["score"], points["score"].any(1)
        across = (points["world"][:, LEFT] - points["world"][:, RIGHT]).sum(1)[seen]  # to the person's left
        front = np.stack([across[:, 2], across[:, 1], -across[:, 0]], 1)[np.isfinite(across).all(1)]
        body = slice(0, 17)
        hands = np.concatenate([span(xy[:, hand], score[:, hand]) for hand in HANDS.values()])
        height = _large(span(xy[:, body], score[:, body]), 75) / BODY_SPAN
        return cls(len(xy), int(seen.sum()), height, degrees_covered(yaw_of(front)), _large(span(xy[:, FACE], score[:, FACE])),
                   _large(hands))

    @property
    def sentence(self) -> str:
        """One line."""
        frames = count_of(self.seen, self.frames, "frame")
        parts = ", ".join(f"{name} {size:.0f} px" if size else f"no {name}"
                          for name, size in (("face", self.face_px), ("hands", self.hand_px)))
        return f"A person in {frames}, {self.height_px:.0f} px tall, seen from {self.turn:.0f} of 360 degrees; {parts}."


def span(xy: np.ndarray, score: np.ndarray) -> np.ndarray:
    """Longer extent (T,) px of the seen ones of points xy (T, P, 2) px with score (T, P); 0 where fewer than two are seen."""
    known = (score > SEEN)[..., None]
    size = np.where(known, xy, -np.inf).max(1) - np.where(known, xy, np.inf).min(1)
    return np.maximum(size.max(1), 0)


def _large(sizes: np.ndarray, percentile: int = LARGEST) -> float:
    return float(np.percentile(sizes[sizes > 0], percentile)) if (sizes > 0).any() else 0.0
