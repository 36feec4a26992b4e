"""Up to which height of the person in the picture a coarser level of detail is drawn: as long as it shows the frames as well."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gsac.stages.train.judge.heldout import Candidate, judge_person
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.views import View, of_each

LOSS = 0.25
"""dB that a level may lose to the one before it."""
OCTAVES = 2
"""How often the frames are halved below the size at which the level was fitted."""


def find_drawn_height(level: Candidate, finer: Candidate) -> float:
    """Whole px: where `level` loses LOSS dB to `finer`, at most the person's median height in its views, at which it was fitted.

    Each has its own poses, and both have the same views. Between sizes that are halved the loss is taken to be linear in the
    height's logarithm.
    """
    lost = np.minimum.accumulate(measure_losses(level, finer))
    octaves = np.interp(LOSS, lost[::-1], np.arange(OCTAVES + 1.0)[::-1])
    return float(round(typical_height(level.poses, _by_frame(level)) / 2**octaves))


def typical_height(poses: Poses, views: Mapping[int, View]) -> float:
    """px, the person's median height in the views. views: frame -> view."""
    joints = poses.to_params().joints
    return float(np.median([person_height(np.ptp(poses.rest(t)[0][:, 1]), joints[t], views[t].camera.focal[1]) for t in views]))


def person_height(stature: float, joints: np.ndarray, focal: float) -> float:
    """px in a picture, as the file's levels mean it (docs/gsac-format.md, Level): of a body `stature` m high at rest, where the
    joint nearest to the eye is.

    joints: (J, 3) m, posed, camera frame; focal: focal length over the picture's height, px.
    """
    return float(focal * stature / np.linalg.norm(joints, axis=1).min())


def measure_losses(level: Candidate, finer: Candidate) -> np.ndarray:
    """(OCTAVES + 1,) dB by which `finer` shows the person better than `level`, in the views and in those halved ever again."""
    views, candidates = _by_frame(level), []
    for _ in range(OCTAVES + 1):
        candidates += [level._replace(views=views), finer._replace(views=views)]
        views = of_each(View.halved, views)
    errors = [sum(row["mse_fg"] * row["fg_pixels"] for row in rows if row["fg_pixels"]) for rows in judge_person(candidates)]
    of_level, of_finer = np.maximum(errors, 1e-12).reshape(-1, 2).T
    return 10 * np.log10(of_level / of_finer)


def _by_frame(candidate: Candidate) -> dict[int, View]:
    return {t: candidate.views[t] for t in candidate.frames}
