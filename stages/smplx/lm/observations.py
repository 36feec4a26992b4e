"""The observations that `lm` fits: key points with their spread, their depth, outlines.

Spreads are standard deviations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsac.avatar.yaw import yaw
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.detector_errors import Detector
from gsac.stages.smplx.sightings import HIPS, Sightings
from gsac.stages.smplx.silhouette import Outline
from gsac.stages.smplx.state import State

TOGETHER = 2.0
"""Factor on the detector's spread: its errors are correlated between frames."""
DEPTH_SPREAD = 0.08
"""m, of the detector's depth at the start, where it decides which way a limb points."""
OUTLINE_SPREAD = 0.006
"""Of the outline, as a share of the person's height."""
ADULT_HEIGHT = (1.72, 0.02)
"""Scale prior without a given height: m and spread. One camera cannot see scale, and clothes make a free scale read people as
small."""
GIVEN_HEIGHT_SPREAD = 0.003
"""m"""


@dataclass
class Observations:
    """What was seen, frame by frame."""

    xy: np.ndarray  # (T, P, 2) px
    spread: np.ndarray  # (T, P) px; infinite where a point was not seen
    depth: np.ndarray  # (T, P) m, depth of the point against the hips; NaN where unknown
    depth_spread: float | np.ndarray  # m, or (T, P) m
    size: tuple[int, int]
    """px, width and height of the frames."""
    center: np.ndarray  # (2,) px
    seconds: np.ndarray | None  # (T,) time; None for photos
    focal_prior: tuple[float, float]
    """Focal length px and its relative spread."""
    height: tuple[float, float]
    """Metres and spread."""
    repeats: float
    """Frames for each different view of the person; frames of one view share their errors."""
    outlines: list[Outline]
    outline_spread: float  # px


def observe(sightings: Sightings, detector: Detector, points: np.ndarray, center: np.ndarray, focal: tuple[float, float],
                 config: SmplxConfig, outlines: list[Outline]) -> Observations:
    """Observations of the chosen key points; their spread is the detector's, wider where it or `handgap` is unsure.

    points: (P,) of the 133 key points; center: (2,) px; focal: px and relative spread.
    """
    height = sightings.person_height
    usual = TOGETHER * height * detector.spread
    unsure = np.sqrt(np.maximum(sightings.sigma**2 - sightings.sigma.min(0) ** 2, 0))
    spread = np.hypot(usual, unsure) / np.sqrt(np.clip(sightings.score, 0.2, 1))
    spread = np.where(sightings.seen, spread, np.inf)[:, points]
    return Observations(sightings.xy[:, points].astype(np.float64), spread.astype(np.float64), _depths(sightings)[:, points],
                        DEPTH_SPREAD, (sightings.width, sightings.height), center, sightings.seconds, focal,
                        (config.height_m, GIVEN_HEIGHT_SPREAD) if config.height_m else ADULT_HEIGHT, 1.0, outlines,
                        OUTLINE_SPREAD * height)


def _depths(sightings: Sightings) -> np.ndarray:
    """(T, 133) m against the middle of the hips, in the detector's scale; NaN where unknown, and for hands and face."""
    depth = np.where(sightings.seen, sightings.world[..., 2], np.nan).astype(np.float64)
    depth -= sightings.world[:, HIPS, 2].mean(1)[:, None]
    depth[:, 23:] = np.nan
    return depth


def subtract_habit(seen: Observations, sightings: Sightings, detector: Detector, points: np.ndarray, state: State) -> None:
    """Subtracts the detector's systematic error at the body's current yaw from the observed points (P,)."""
    error = detector.error(yaw(state.local[:, 0]))[:, points]
    seen.xy = sightings.xy[:, points] - error * sightings.person_height
