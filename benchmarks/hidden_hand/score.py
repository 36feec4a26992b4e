"""Errors of a fitted arm whose hand lies behind the back."""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from gsac.avatar.body import Body, BodyParams
from gsac.avatar.joints import INDEX, NAMES
from gsac.benchmarks.fit.clips import FitCase
from gsac.benchmarks.fit.score import joint_distances
from gsac.benchmarks.fit.truth import Truth
from gsac.benchmarks.hidden_hand.cases import HiddenHand
from gsac.stages.contract import Job
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.lm.hidden_arms import SIDES

BARS = {"wrist_mm": 80.0, "elbow_mm": 40.0, "skin_inside": 0.97}
"""Targets of the median errors, mm, and of the least share of the forearm's skin inside the mask, in frames with a hidden hand."""
AT_LEAST = ("skin_inside",)
"""Measures of which more is better."""


@dataclass(frozen=True)
class Row:
    """One clip; medians of hidden frames, or of all frames of a clean turn."""

    name: str
    wrist_mm: float
    """Pelvis aligned, one scale a clip."""
    elbow_mm: float
    skin_inside: float
    """Share of the bare forearm's vertices that lie inside the person's true mask, or at most a pixel beside it."""
    wrist_seen_mm: float
    """Of both arms' wrists wherever no hand lies on the back: the mean."""
    elbow_seen_mm: float
    joints_mm: float
    """Mean of all body joints and frames."""
    cpu_s: float
    """Processor seconds of the smplx stage."""
    said: str
    """Codes that the stage gave, with their number of frames."""

    @property
    def misses(self) -> list[str]:
        """Measures that miss their bar."""
        return [name for name, bar in BARS.items()
                if (getattr(self, name) < bar if name in AT_LEAST else getattr(self, name) > bar)]


def fit(case: FitCase, body_file: Path) -> tuple[float, str]:
    """Runs the smplx stage, which writes `body_file`. Returns processor seconds, and codes with their numbers of frames."""
    from gsac.stages.smplx.stage import run

    said: dict[str, int] = {}
    body_file.parent.mkdir(parents=True, exist_ok=True)
    began = time.process_time()
    run(Job(case.inputs, body_file.parent, SmplxConfig(),
            warn=lambda note: said.update({note.code.name.lower(): sum(last - first + 1 for first, last in note.frames)})))
    return time.process_time() - began, " ".join(f"{code}:{count}" for code, count in sorted(said.items()))


def measure(hand: HiddenHand, case: FitCase, body_file: Path, cpu_s: float, said: str) -> Row:
    """Compares a fit with the truth."""
    body, params = Body.load(), BodyParams.read(body_file)
    off = joint_distances(body, params, case.truth)
    column = {NAMES[j]: i for i, j in enumerate(case.truth.joint)}
    hidden = hand.hidden if hand.count else np.ones(len(off), bool)
    seen = {part: np.concatenate([off[~hidden if side == hand.side and hand.count else slice(None), column[f"{side}_{part}"]]
                                  for side in SIDES]).mean() for part in ("elbow", "wrist")}
    return Row(hand.name, float(np.median(off[hidden, column[f"{hand.side}_wrist"]])),
               float(np.median(off[hidden, column[f"{hand.side}_elbow"]])),
               measure_inside(body, params, case.truth, hand.side, hidden), float(seen["wrist"]), float(seen["elbow"]),
               float(off[:, 1:].mean()), cpu_s, said)


def measure_inside(body: Body, params: BodyParams, truth: Truth, side: str, frames: np.ndarray) -> float:
    """Share of a bare forearm's vertices inside the true mask or at most a pixel beside it. frames: (T,) bool.

    The pixel is the mask's own edge: of the true skin 5 % lies beyond it where persons are 400 px high, and arms 15 px wide.
    """
    bare = dataclasses.replace(params, betas=np.where(np.arange(body.num_betas) < body.num_figure, params.betas, 0))
    forearm = np.asarray(body.weights)[:, INDEX[f"{side}_elbow"]] > 0.5
    h, w = truth.masks.shape[1:]
    camera = params.camera(w, h)
    inside = []
    for t in np.flatnonzero(frames).tolist():
        at = np.floor(camera.project(body.posed(bare, [t])[0][0][forearm])).astype(int)
        on = (at >= 0).all(1) & (at < (w, h)).all(1)
        at = np.clip(at, 0, (w - 1, h - 1))
        mask = cv2.dilate(truth.masks[t].astype(np.uint8), np.ones((3, 3), np.uint8))
        inside.append(on & (mask[at[:, 1], at[:, 0]] > 0))
    return float(np.mean(inside))
