"""The detections of one clip: input of a fit by either method."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gsac.avatar.pose_files.read import Start
from gsac.avatar.wholebody import INDEX, OTHER_SIDE
from gsac.stages.smplx.config import SmplxConfig

HAND_ROOTS = tuple(first + i for first in (91, 112) for i in (0, 1, 5, 9, 13, 17))
"""Hand points that no finger joint moves: they turn the wrist."""
BODY_POINTS = np.array([*range(23), *HAND_ROOTS])
HIPS = (INDEX["left_hip"], INDEX["right_hip"])
HEAD, FEET = slice(0, 5), slice(15, 23)
TRUNK = [INDEX[name] for name in ("left_shoulder", "right_shoulder", "left_hip", "right_hip")]
"""Shoulders and hips, left before right."""
TRUNKS = 3.5
"""Height of a person over the trunk from shoulders to hips, as the detector sees both: 3.4 to 3.6 in seven clips."""
FOCAL_GUESS = 0.95
"""Focal length when nothing is known, as a share of the footage's longer side: between a phone's main lens and a tele."""
FOCAL_SPREAD, GIVEN_FOCAL_SPREAD = 0.15, 0.002
"""Relative sigma of a guessed and of a given focal length."""


@dataclass
class Sightings:
    """Detections of one clip, from `handgap`, and face.npz."""

    xy: np.ndarray  # (T, 133, 2) px
    score: np.ndarray  # (T, 133)
    sigma: np.ndarray  # (T, 133) px
    world: np.ndarray  # (T, 133, 3) m
    seconds: np.ndarray | None  # (T,) time; None for photos
    width: int
    height: int
    focal_px: float | None
    detector: str | Path = ""
    """Its name, or the file of its measured errors."""
    face: dict[str, np.ndarray] | None = None
    """Arrays of face.npz: `valid` (T,), `expression` (T, E), `jaw` (T, 3) and, where a head was fitted, its mesh."""
    missing: np.ndarray | None = None
    """(T, 2) bool, hands that were not seen, or in a wrong place; None: all were."""
    principal_point: tuple[float, float] | None = None
    """px; None: the frame's middle."""
    longer_side: float | None = None
    """Of the footage before it was cut, in px of the frames; None: the frame's."""
    start: Start | None = None
    """Poses that the user brought; their betas only where the body has SMPL-X's shapes."""

    @property
    def center(self) -> np.ndarray:
        """(2,) px, principal point."""
        return np.array(self.principal_point or (self.width / 2, self.height / 2))

    @property
    def seen(self) -> np.ndarray:
        """(T, 133) bool."""
        return (self.score > 0.2) & np.isfinite(self.xy).all(-1)

    @property
    def person_height(self) -> float:
        """Median height of the person, px, from the body points; where half the frames lack head or feet, from the trunk."""
        seen, y = self.seen[:, :23], self.xy[:, :23, 1]
        whole = seen[:, HEAD].any(1) & seen[:, FEET].any(1)
        trunk = seen[:, TRUNK].all(1)
        if trunk.any() and whole.mean() < 0.5:
            return float(np.median(y[trunk][:, TRUNK[2:]].mean(1) - y[trunk][:, TRUNK[:2]].mean(1))) * TRUNKS
        extents = [np.ptp(own[known]) for own, known in zip(y, seen, strict=True) if known.sum() > 1]
        return float(np.median(extents)) * 1.08 if extents else self.height * 0.8

    def exchange_sides(self, frames: np.ndarray) -> Sightings:
        """The same with left and right exchanged in some frames, (T,) bool."""
        def exchange(of_points: np.ndarray, order: tuple[int, ...]) -> np.ndarray:
            out = of_points.copy()
            out[frames] = out[frames][:, order]
            return out

        points = {name: exchange(getattr(self, name), OTHER_SIDE) for name in ("xy", "score", "sigma", "world")}
        return replace(self, **points, missing=None if self.missing is None else exchange(self.missing, (1, 0)))


def focal_prior(sightings: Sightings, config: SmplxConfig) -> tuple[float, float]:
    """Focal length, px, and its relative sigma."""
    given = config.focal_px or sightings.focal_px
    if given:
        return given, GIVEN_FOCAL_SPREAD
    return FOCAL_GUESS * (sightings.longer_side or max(sightings.width, sightings.height)), FOCAL_SPREAD
