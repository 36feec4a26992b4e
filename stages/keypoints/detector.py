"""What all detectors do: they follow one person, write BlazePose's body points and find the face mesh.

A new detector is a file beside `mediapipe.py`, a row in `stage.DETECTORS`, and its name and model files in `config.py`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gsac.avatar.blazepose import Pose
from gsac.avatar.facemesh import Face, FaceMesh, head_yaw, region_of_head
from gsac.avatar.region import Region
from gsac.avatar.wholebody import INDEX
from gsac.stages.keypoints.config import KeypointsConfig
from gsac.stages.keypoints.detection import Frame
from gsac.stages.keypoints.tracking import Tracker

POSE33 = {
    "nose": 0, "left_eye": 2, "right_eye": 5, "left_ear": 7, "right_ear": 8, "left_shoulder": 11, "right_shoulder": 12,
    "left_elbow": 13, "right_elbow": 14, "left_wrist": 15, "right_wrist": 16, "left_hip": 23, "right_hip": 24,
    "left_knee": 25, "right_knee": 26, "left_ankle": 27, "right_ankle": 28, "left_heel": 29, "right_heel": 30,
    "left_big_toe": 31, "right_big_toe": 32}
"""COCO-WholeBody name -> BlazePose index. BlazePose has no small toes: their score stays 0."""
BODY133 = np.array([INDEX[name] for name in POSE33])
BODY33 = np.array(list(POSE33.values()))


class Detector(ABC):
    """models: name -> file, those of `config.models()`. Only whom to follow is handed from frame to frame."""

    def __init__(self, models: dict[str, Path], config: KeypointsConfig):
        self._config = config
        self._tracker = Tracker(models, config)
        self._face = FaceMesh(models, threads=1)

    def start(self, image: np.ndarray) -> Callable[[], Frame]:
        """image: (H, W, 3) uint8 RGB, the next frame of the clip. Finds the person; the function it returns finds the rest, in any
        thread."""
        frame = Frame()
        pose = self._tracker.track(image, frame)
        return lambda: frame if pose is None else self._finish(frame, image, pose)

    def look(self, image: np.ndarray, region: Region) -> Frame | None:
        """image: (H, W, 3) uint8 RGB. What is found of a person in that region of it; None where none is."""
        pose = self._tracker.look(image, region)
        return None if pose is None else self._finish(Frame(), image, pose)

    def _finish(self, frame: Frame, image: np.ndarray, pose: Pose) -> Frame:
        write_body(frame, pose)
        face = self._face.find(image, region_of_head(pose.points[:11]), head_yaw(pose.world), self._config.face_threshold)
        if face is not None:
            frame.face_mesh[:] = face.points
        self.write_points(frame, image, pose, face)
        return frame

    @abstractmethod
    def write_points(self, frame: Frame, image: np.ndarray, pose: Pose, face: Face | None) -> None:
        """Writes the points that this detector finds. image: (H, W, 3) uint8 RGB; the frame holds the body's points already."""


def write_body(frame: Frame, pose: Pose) -> None:
    frame.xy[BODY133] = pose.points[BODY33]
    frame.score[BODY133] = (pose.visibility * pose.presence * pose.score)[BODY33]
    frame.world[BODY133] = pose.world[BODY33]
    frame.region = pose.region
    frame.pose33[:] = np.column_stack([pose.points, pose.visibility])
