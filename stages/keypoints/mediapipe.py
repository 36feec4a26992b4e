"""The MediaPipe networks in the order of its Holistic pipeline, each frame on its own but for whom to follow."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from gsac.avatar.facemesh import EYE_POINTS, IBUG68, NOSE_TIP, Face, FaceMesh, head_yaw, region_of_head
from gsac.avatar.region import Region
from gsac.avatar.wholebody import FACE, HANDS, INDEX
from gsac.stages.keypoints.config import KeypointsConfig
from gsac.stages.keypoints.frame import Frame
from gsac.stages.keypoints.hands import Arm, Hand, HandNetworks
from gsac.stages.keypoints.pose import Person, Pose, PoseNetworks

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
SECOND_SCORE = 0.7
"""A second person is reported when detector and landmark network together are this sure."""


class Mediapipe:
    """Follows one person: the largest and most central at first, then the nearest to where it was."""

    def __init__(self, models: dict[str, Path], config: KeypointsConfig):
        self._config = config
        self._pose = PoseNetworks(models)
        self._hands = HandNetworks(models)
        self._face = FaceMesh(models)
        self._last: Region | None = None

    def look(self, image: np.ndarray) -> Frame:
        """image: (H, W, 3) uint8 RGB, the next frame of the clip."""
        persons = self._pose.persons(image, self._config.person_threshold)
        pose = self._follow(image, persons)
        frame = Frame()
        if pose is None:
            return frame
        self._last = pose.region
        self._second(image, persons, pose, frame)
        write_body(frame, pose)
        head = region_of_head(pose.points[:11])
        face = self._face.find(image, head, head_yaw(pose.world), self._config.face_threshold)
        if face is not None:
            write_face(frame, face)
        hands = self._hands.find(image, arms_of(pose), self._config.hand_threshold, self._config.hand_reach)
        for side, hand in hands.items():
            write_hand(frame, side, hand)
        return frame

    def _follow(self, image: np.ndarray, persons: list[Person]) -> Pose | None:
        """The followed person's pose; None when nobody is seen."""
        least = self._config.person_threshold
        if self._last is None:
            order = sorted(persons, key=lambda p: -prominence(p.region, image.shape[1], image.shape[0]))
        else:
            last = self._last
            order = sorted(persons, key=lambda p: apart(p.region, last))
            if not order or apart(order[0].region, last) > 0.5:
                # The detector may have missed the person whom the landmark network still sees where it was.
                pose = self._pose.pose(image, last)
                if pose.score >= least:
                    return pose
        for person in order:
            pose = self._pose.pose(image, person.region)
            if pose.score >= least:
                return pose
        return None

    def _second(self, image: np.ndarray, persons: list[Person], pose: Pose, frame: Frame) -> None:
        """Writes the surest person who is not the followed one."""
        for person in persons:
            if apart(person.region, pose.region) < 0.4:
                continue
            other = self._pose.pose(image, person.region)
            score = min(person.score, other.score)
            middles = [points[[11, 12, 23, 24]].mean(axis=0) for points in (other.points, pose.points)]
            far = np.hypot(*(middles[0] - middles[1])) > 0.15 * min(other.region.side, pose.region.side)
            if far and score >= SECOND_SCORE and score > frame.person2_score:
                low, high = other.points.min(axis=0), other.points.max(axis=0)
                frame.person2 = np.concatenate([low, high])
                frame.person2_score = score


def prominence(region: Region, width: int, height: int) -> float:
    """Size in the frame, less what lies off the middle."""
    off = np.hypot(region.center[0] / width - 0.5, region.center[1] / height - 0.5)
    return region.side / max(width, height) * (1 - off)


def apart(a: Region, b: Region) -> float:
    """Distance of two persons' regions in sizes, plus how much their sizes differ."""
    away = np.hypot(a.center[0] - b.center[0], a.center[1] - b.center[1]) / max(a.side, b.side)
    return float(away + 0.5 * abs(np.log(a.side / b.side)))


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
