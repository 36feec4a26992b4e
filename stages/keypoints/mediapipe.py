"""The MediaPipe networks in the order of its Holistic pipeline: body, face mesh, hands."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gsac.avatar.blazepose import Pose
from gsac.avatar.facemesh import EYE_POINTS, IBUG68, NOSE_TIP, Face
from gsac.avatar.wholebody import FACE, HANDS, INDEX
from gsac.stages.keypoints.config import KeypointsConfig
from gsac.stages.keypoints.detection import Frame
from gsac.stages.keypoints.detector import Detector
from gsac.stages.keypoints.hands import Arm, Hand, HandNetworks

ARM33 = {"left": (13, 15, 17, 19), "right": (14, 16, 18, 20)}
"""Elbow, wrist, pinky knuckle, index knuckle."""
LIMBS33 = ((11, 12), (11, 23), (12, 24), (23, 24), (23, 25), (24, 26), (25, 27), (26, 28), (11, 13), (12, 14))


class Mediapipe(Detector):
    def __init__(self, models: dict[str, Path], config: KeypointsConfig):
        super().__init__(models, config)
        self._hands = HandNetworks(models, threads=1)

    def write_points(self, frame: Frame, image: np.ndarray, pose: Pose, face: Face | None) -> None:
        """image: (H, W, 3) uint8 RGB. Face and hands; the body's points stay BlazePose's."""
        if face is not None:
            write_face(frame, face)
        hands = self._hands.find(image, arms_of(pose), self._config.hand_threshold, self._config.hand_reach)
        for side, hand in hands.items():
            write_hand(frame, side, hand)


def pixels_per_metre(pose: Pose) -> float:
    """The scale that maps the pose's metres onto its pixels, by least squares over the limbs' lengths."""
    a, b = np.array(LIMBS33).T
    px = np.linalg.norm(pose.points[a] - pose.points[b], axis=1)
    m = np.linalg.norm((pose.world[a] - pose.world[b])[:, :2], axis=1)
    return float(px @ m / max(m @ m, 1e-9))


def arms_of(pose: Pose) -> dict[str, Arm]:
    scale = pixels_per_metre(pose)
    arms = {}
    for side, (elbow, wrist, pinky, index) in ARM33.items():
        forearm = scale * float(np.linalg.norm(pose.world[elbow] - pose.world[wrist]))
        arms[side] = Arm(pose.points[wrist], pose.points[pinky], pose.points[index], forearm)
    return arms


def write_face(frame: Frame, face: Face) -> None:
    """Moves the body's nose and eyes too: the mesh places them to a pixel or two, the body network does not."""
    facing = face.facing()
    frame.xy[FACE] = face.points[IBUG68, :2]
    frame.score[FACE] = face.presence * facing[IBUG68]
    frame.xy[INDEX["nose"]] = face.points[NOSE_TIP, :2]
    for side, points in EYE_POINTS.items():
        if facing[list(points)].mean() >= 0.5:
            frame.xy[INDEX[f"{side}_eye"]] = face.points[list(points), :2].mean(axis=0)


def write_hand(frame: Frame, side: str, hand: Hand) -> None:
    frame.xy[HANDS[side]] = hand.points
    frame.score[HANDS[side]] = hand.presence
    frame.world[HANDS[side]] = hand.world - hand.world[0] + frame.world[INDEX[f"{side}_wrist"]]
