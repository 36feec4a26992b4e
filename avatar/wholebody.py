"""COCO-WholeBody's 133 points: order, names, sides.

0-16 body, 17-22 feet, 23-39 face contour, 40-90 inner face, 91-111 left hand, 112-132 right hand.
"""

from __future__ import annotations

BODY = slice(0, 17)
FEET = slice(17, 23)
FACE = slice(23, 91)
LEFT_HAND = slice(91, 112)
RIGHT_HAND = slice(112, 133)

BODY_NAMES = ("nose left_eye right_eye left_ear right_ear left_shoulder right_shoulder left_elbow right_elbow left_wrist "
              "right_wrist left_hip right_hip left_knee right_knee left_ankle right_ankle").split()
FEET_NAMES = "left_big_toe left_small_toe left_heel right_big_toe right_small_toe right_heel".split()
HAND_POINTS = "wrist thumb1 thumb2 thumb3 thumb4 index1 index2 index3 index4 middle1 middle2 middle3 middle4 " \
              "ring1 ring2 ring3 ring4 pinky1 pinky2 pinky3 pinky4"
NAMES = tuple(
    BODY_NAMES + FEET_NAMES
    + [f"contour{i}" for i in range(17)] + [f"face{i}" for i in range(51)]
    + [f"left_hand_{n}" for n in HAND_POINTS.split()] + [f"right_hand_{n}" for n in HAND_POINTS.split()]
)
INDEX = {name: i for i, name in enumerate(NAMES)}
OTHER_SIDE = tuple(INDEX[name.replace("left", "?").replace("right", "left").replace("?", "right")] for name in NAMES)
"""The point of the same name on the other side."""

PALM = {"left": INDEX["left_hand_middle1"], "right": INDEX["right_hand_middle1"]}
"""The paper's palm point is read as the root of the middle finger."""
ARM = {side: (INDEX[f"{side}_shoulder"], INDEX[f"{side}_elbow"], INDEX[f"{side}_wrist"], PALM[side])
       for side in ("left", "right")}
"""Shoulder, elbow, wrist, palm: the paper's S, E, W, P."""
HANDS = {"left": LEFT_HAND, "right": RIGHT_HAND}
