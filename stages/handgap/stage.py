"""Entry of handgap: finds missing hands, fills the gaps, gives each point its standard deviation."""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_limits

from gsac.avatar.artifacts import Clip, write_arrays
from gsac.avatar.wholebody import HANDS
from gsac.stages.contract import Job
from gsac.stages.findings import Code, Finding
from gsac.stages.handgap.fill import fill_gaps
from gsac.stages.handgap.missing_hands import SIDES, MissingHands, find_missing, leave_all, runs
from gsac.stages.handgap.paper_rule import find_missing_as_paper
from gsac.stages.handgap.sigma import detection_sigma, person_height
from gsac.stages.missing_frames import read_keypoints
from gsac.stages.turn_pace import pace

RULES = {"places": find_missing, "paper": find_missing_as_paper}
"""handgap.rule -> the function that finds missing hands."""
MOSTLY = 0.5
"""Share of the photos that may lack a hand."""
FILLED_SCORE = 0.5
"""Score of a filled point whose sigma is a detection's; it falls as sigma grows."""


def run(job: Job) -> None:
    clip = Clip.read(job.inputs["split/clip.json"])
    times = None if clip.timestamps_s is None else np.asarray(clip.timestamps_s)
    keypoints, lacking = read_keypoints(job.inputs["keypoints/keypoints.npz"], None if times is None else len(times))
    if lacking.any():
        job.warn(Finding.of(Code.POINTS_MISSING, lacking))
    times = None if times is None else pace(times, keypoints["world"].astype(np.float64))
    xy = keypoints["xy"].astype(np.float64)
    score = keypoints["score"].astype(np.float64)
    own = clip.shows_own_moment(len(xy))
    score = np.where(np.isfinite(xy).all(axis=2) & own[:, None], score, 0)
    xy = np.nan_to_num(xy)
    found = leave_all(len(xy)) if job.config.method == "none" else RULES[job.config.rule](xy, score, times, job.config)
    filled, drift = np.zeros(score.shape, bool), np.zeros(score.shape)
    if times is not None:
        with threadpool_limits(1, "blas"):  # small matrices: threads cost more than they give, ten times more on a busy machine
            xy, filled, drift = fill_gaps(xy, score, keypoints["world"].astype(np.float64), found, times, job.config)

    unseen = filled.copy()
    for i, side in enumerate(SIDES):
        unseen[:, HANDS[side]] |= found.hand[:, i, None]
    full = detection_sigma(np.ones_like(score), person_height(xy, score))
    score = np.where(unseen, 0, score)
    sigma = np.where(filled, np.hypot(full, drift), detection_sigma(score, person_height(xy, score)))
    score = np.where(filled, FILLED_SCORE * full / sigma, score)
    world = np.where(unseen[..., None], np.nan, keypoints["world"])
    _report(job, found, filled, own, keypoints["score"], times is None)
    write_arrays(job.out / "keypoints.npz", xy=xy.astype(np.float32), score=score.astype(np.float32),
                 world=world.astype(np.float32), detector=keypoints["detector"], missing=found.hand, filled=filled,
                 sigma=sigma.astype(np.float32))


def _report(job: Job, found: MissingHands, filled: np.ndarray, own: np.ndarray, detected: np.ndarray,
            photos: bool) -> None:
    """Warns of what the user should know: hands never seen well, taken for the other one, or left missing; of those that were never
    detected `keypoints` has told. own: (T,) bool, frames that repeat no other; detected: (T, 133) the detector's scores; photos:
    nothing is filled, and a body hides each hand in some."""
    for i, side in enumerate(SIDES):
        missing = found.hand[:, i]
        if missing.all():
            if detected[:, HANDS[side]].any():
                job.warn(Finding.of(Code.HAND_NEVER_SEEN, figure=len(missing), side=side))
            continue
        if found.misplaced[:, i].any():
            job.warn(Finding.of(Code.HAND_MISPLACED, found.misplaced[:, i], side=side))
        if photos and missing.mean() <= MOSTLY:
            continue
        left = missing & own & ~filled[:, HANDS[side]].all(axis=1)
        for start, end in runs(left):
            if end - start == 1:
                left[start] = False  # the fit bridges one frame
        if left.any():
            job.warn(Finding.of(Code.HAND_NOT_FILLED, left, side=side))
