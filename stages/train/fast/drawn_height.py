"""Up to which height of the person in the picture a coarser level of detail is drawn: as long as it shows the frames as well."""

from __future__ import annotations

import numpy as np

from gsac.avatar.gaussians import Gaussians
from gsac.avatar.metrics import score_person
from gsac.avatar.person_height import person_height
from gsac.avatar.threads import Workspace
from gsac.stages.train.judge.heldout import render_view, truth
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.views import View

LOSS = 0.25
"""dB that a level may lose to the one before it, whose gaussians are three times as many."""
OCTAVES = 2
"""How often the frames are halved below the size at which the level was fitted."""
FRAMES = 6
"""Frames that are looked at, at most."""


def find_drawn_height(level: Gaussians, finer: Gaussians, poses: Poses, views: dict[int, View]) -> float:
    """Whole px: where `level` loses LOSS dB to `finer`, at most the person's median height in the views, at which it was fitted.

    views: frame -> view. Between sizes that are halved the loss is taken to be linear in the height's logarithm.
    """
    joints = poses.to_params().joints
    fitted = np.median([person_height(np.ptp(poses.rest(t)[0][:, 1]), joints[t], views[t].camera.focal[1]) for t in views])
    lost = np.minimum.accumulate(measure_losses(level, finer, poses, views))
    octaves = np.interp(LOSS, lost[::-1], np.arange(OCTAVES + 1.0)[::-1])
    return float(round(fitted / 2**octaves))


def measure_losses(level: Gaussians, finer: Gaussians, poses: Poses, views: dict[int, View]) -> np.ndarray:
    """(OCTAVES + 1,) dB by which `finer` shows the person better than `level`, in the views and in those halved ever again."""
    errors, workspace = np.zeros((OCTAVES + 1, 2)), Workspace()
    for t in list(views)[::-(-len(views) // FRAMES)]:
        view = views[t]
        for octave in range(OCTAVES + 1):
            real = truth(view)
            for which, gaussians in enumerate((level, finer)):
                found = score_person(*render_view(gaussians, poses, t, view, workspace), *real)
                if found["fg_pixels"]:
                    errors[octave, which] += found["mse_fg"] * found["fg_pixels"]
            view = view.halved()
    errors = np.maximum(errors, 1e-12)
    return 10 * np.log10(errors[:, 0] / errors[:, 1])
