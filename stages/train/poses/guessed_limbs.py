"""Limbs that a frame cannot teach: the body fit only guesses where they are there."""

from __future__ import annotations

import numpy as np

from gsac.avatar.body import Body

GUESSED = 0.1
"""m: sigma of a joint from which on the fit has guessed its place, and the bones on both sides of it teach nothing."""


def find_guessed_faces(body: Body, sigma_joints: np.ndarray) -> dict[int, np.ndarray]:
    """Frame -> faces (F,) bool on bones whose place was guessed, of the frames that have any. sigma_joints: (T, 55) m."""
    guessed = sigma_joints >= GUESSED
    bones = guessed.copy()
    for joint, parent in enumerate(body.parents):
        if parent > 0:
            bones[:, parent] |= guessed[:, joint]
    frames = np.flatnonzero(bones.any(1))
    if not len(frames):
        return {}
    bone = np.asarray(body.weights)[body.faces].sum(1).argmax(1)  # (F,)
    return {int(t): bones[t, bone] for t in frames}
