"""Priors of pose, motion and shape: mean and spread of each joint's rotation vector, limits of hinges, speeds, betas.

Rotation vectors about the T-pose axes (x left, y up, z front), degrees in the tables. Spreads are standard deviations, and wide:
they decide only what the images leave open.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.joints import BODY, FINGERS, NAMES, J

BODY_JOINTS = np.arange(J)[BODY]
FINGER_JOINTS = np.arange(J)[FINGERS]

SPREAD = {
    "pelvis": (400, 400, 400), "hip": (35, 20, 15), "spine1": (10, 8, 8), "spine2": (8, 8, 6), "spine3": (8, 8, 6),
    "knee": (50, 5, 4), "ankle": (20, 10, 8), "foot": (5, 2, 2), "neck": (15, 15, 10), "head": (15, 20, 12),
    "collar": (5, 8, 8), "shoulder": (30, 35, 40), "elbow": (35, 45, 6), "wrist": (25, 20, 20),
}
MEAN = {"left_collar": (0, 0, -3), "right_collar": (0, 0, 3), "left_shoulder": (0, 0, -55), "right_shoulder": (0, 0, 55),
        "left_elbow": (0, -20, 0), "right_elbow": (0, 20, 0), "left_knee": (8, 0, 0), "right_knee": (8, 0, 0)}
"""Arms hang, and the collar bones with them: the template's lie as under arms held 45 degrees out."""
LIMITS = ((4, 0, 1), (5, 0, 1), (18, 1, -1), (19, 1, 1))
"""Hinges that do not bend backwards: joint, axis, sign of the allowed bend."""
LIMIT_SPREAD = np.radians(3)
CURL = np.radians(15)
"""Bend of resting fingers about z, towards the palm."""


def pose_prior(joints: np.ndarray, hand_means: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Mean (A, 3) and spread (A, 3) of the joints' rotation vectors, rad.

    joints: (A,) indices; hand_means: (30, 3) rad, the body's own mean fingers, which take the place of ours.
    """
    mean, spread = np.zeros((len(joints), 3)), np.zeros((len(joints), 3))
    for i, j in enumerate(joints):
        name = NAMES[j]
        side, _, part = name.partition("_")
        part = part or name
        if j >= FINGERS.start:
            mean[i], spread[i] = finger_prior(side, part)
            if hand_means is not None:
                mean[i] = hand_means[j - FINGERS.start]
            continue
        mean[i] = np.radians(MEAN.get(name, (0, 0, 0)))
        spread[i] = np.radians(SPREAD[part])
    return mean, spread


def finger_prior(side: str, part: str) -> tuple[np.ndarray, np.ndarray]:
    """Mean (3,) and spread (3,), rad. Fingers are hinges about z; roots also spread about y; the thumb is freer."""
    down = -1 if side == "left" else 1
    if part.startswith("thumb"):
        return np.zeros(3), np.radians([12, 15, 15])
    return np.array([0, 0, down * CURL]), np.radians([3, 8 if part.endswith("1") else 2, 25])


def motion_prior(joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Spread of angular speed (A,) rad/s (infinite for the pelvis, which turns) and of acceleration (A,) rad/s^2. joints: (A,)."""
    speed, acceleration = np.full(len(joints), 0.4), np.full(len(joints), 1.0)
    arms, legs, ankles = np.isin(joints, (16, 17, 18, 19, 20, 21)), np.isin(joints, (1, 2, 4, 5)), np.isin(joints, (7, 8))
    speed[arms], acceleration[arms] = 0.75, 2.0
    speed[legs], acceleration[legs] = 6.0, 40.0  # a step bends a knee by 30 degrees and back in half a second
    speed[ankles], acceleration[ankles] = 3.0, 20.0
    trunk = np.isin(joints, (3, 6, 9, 13, 14, 10, 11))
    speed[trunk], acceleration[trunk] = 0.15, 0.5
    fingers = joints >= FINGERS.start
    speed[fingers], acceleration[fingers] = 0.25, 1.0
    speed[joints == 0], acceleration[joints == 0] = np.inf, 0.75
    return speed, acceleration


CLOTHES = {"chest": (4, 8), "belly": (4, 8), "waist": (10, 10), "upper arms": (3, 8), "sleeves": (1.5, 8), "forearms": (1.5, 6),
           "thighs": (4, 8), "shanks": (4, 12), "cuffs": (2.5, 10), "feet": (2.5, 8), "soles": (5, 10), "hair": (15, 15),
           "nape": (10, 15)}
"""Distance of clothes and hair from the skin, mm: mean and spread over people in clothes and without."""


def shape_prior(figure: int, clothes: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Mean (B,) and spread (B,) of the betas: the figure's, then the clothes' (1 cm a unit). figure: number of the former."""
    worn = np.array([CLOTHES[name] for name in clothes]).reshape(-1, 2) / 10
    return np.append(np.zeros(figure), worn[:, 0]), np.append(np.ones(figure), worn[:, 1])


TRANSL_ACCELERATION = 0.25
"""Spread of the acceleration of transl, m/s^2."""
