"""The MediaPipe networks in the order of its Holistic pipeline; nothing but whom to follow goes from frame to frame."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from gsac.avatar.facemesh import EYE_POINTS, IBUG68, NOSE_TIP, Face, FaceMesh, head_yaw, region_of_head
from gsac.avatar.wholebody import FACE, HANDS, INDEX
from gsac.stages.keypoints.config import KeypointsConfig
from gsac.stages.keypoints.detection import Frame
from gsac.stages.keypoints.hands import Arm, Hand, HandNetworks
from gsac.stages.keypoints.pose import Pose
from gsac.stages.keypoints.tracking import Follower

POSE33 = {
    "nose": 0, "left_eye": 2, "right_eye": 5, "left_ear": 7, "right_ear": 8, "left_shoulder": 11, "right_shoulder": 12,
    "left_elbow": 13, "right_elbow": 14, "left_wrist": 15, "right_wrist": 16, "left_hip": 23, "right_hip": 24,
    "left_knee": 25, "right_knee": 26, "left_ankle": 27, "right_ankle": 28, "left_heel": 29, "right_heel": 30,
    "left_big_toe": 31, "right_big_toe": 32}
"""COCO-WholeBody name -> BlazePose index. BlazePose has no small toes: their score stays 0."""
BODY133 = np.array([INDEX[name] for name in POSE33])
BODY33 = np.array(list(POSE33.values()))
ARM33 = {"left": (13, 15, 17, 19), "right": (14, 16, 18, 20)}
"""Elbow, wrist, pinky knuckle, index knuckle."""
LIMBS33 = ((11, 12), (11, 23), (12, 24), (23, 24), (23, 25), (24, 26), (25, 27), (26, 28), (11, 13), (12, 14))


class Mediapipe:
    """models: name -> file, those of `config.models()`."""

    def __init__(self, models: dict[str, Path], config: KeypointsConfig):
        self._config = config
        self._follower = Follower(models, config)
        self._hands = HandNetworks(models, threads=1)
        self._face = FaceMesh(models, threads=1)

    def follow(self, image: np.ndarray) -> Callable[[], Frame]:
        """image: (H, W, 3) uint8 RGB, the next frame of the clip. What it gives finds the rest, in any thread."""
        frame = Frame()
        pose = self._follower.look(image, frame)
        return lambda: frame if pose is None else self._filled(frame, image, pose)

    def _filled(self, frame: Frame, image: np.ndarray, pose: Pose) -> Frame:
        write_body(frame, pose)
        head = region_of_head(pose.points[:11])
        face = self._face.find(image, head, head_yaw(pose.world), self._config.face_threshold)
        if face is not None:
            write_face(frame, face)
        hands = self._hands.find(image, arms_of(pose), self._config.hand_threshold, self._config.hand_reach)
        for side, hand in hands.items():
            write_hand(frame, side, hand)
        return frame


def pixels_per_metre(pose: Pose) -> float:
    """The scale that best maps the pose's metres onto its pixels."""
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


def write_body(frame: Frame, pose: Pose) -> None:
    frame.xy[BODY133] = pose.points[BODY33]
    frame.score[BODY133] = (pose.visibility * pose.presence * pose.score)[BODY33]
    frame.world[BODY133] = pose.world[BODY33]
    frame.pose33[:] = np.column_stack([pose.points, pose.visibility])


def write_face(frame: Frame, face: Face) -> None:
    """Also moves the body's nose and eyes: the mesh places them to a pixel or two, the body network does not."""
    frame.face_mesh[:] = face.points
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
