"""Parameters of keypoints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from gsac.stages.brought_file import NONE
from gsac.stages.contract import BadInput

DetectorName = Literal["mediapipe", "onnx-wholebody", "mmpose-json"]

MODELS: dict[DetectorName, tuple[str, ...]] = {
    "mediapipe": ("pose_detection", "pose_landmark_full", "hand_recrop", "palm_detection_full", "hand_landmark_full",
                  "face_detection_short_range", "face_landmark"),
    "onnx-wholebody": ("pose_detection", "pose_landmark_full", "onnx-wholebody", "face_detection_short_range",
                       "face_landmark"),
    "mmpose-json": ("pose_detection", "pose_landmark_full", "face_detection_short_range", "face_landmark"),
}
"""Detector -> the network files it needs."""


@dataclass
class KeypointsConfig:
    detector: DetectorName = "mediapipe"
    """Networks that find the points. mediapipe: the embedded ones; onnx-wholebody: a SimCC whole-body network (RTMW, DWPose) that
    you bring by `gsac models add onnx-wholebody FILE`; mmpose-json: none, `points` names what mmpose found."""
    points: str = NONE
    """Name under which `gsac models add NAME FILE...` keeps the key points that mmpose's inferencer wrote as JSON for the frames in
    split/frames, one file or one a frame, or none."""
    person_threshold: float = 0.5
    """Least confidence, 0..1, for a person to count as seen."""
    hand_threshold: float = 0.5
    """Least confidence, 0..1, for a hand to count as seen."""
    face_threshold: float = 0.5
    """Least confidence, 0..1, for a face to count as seen."""
    hand_reach: float = 0.5
    """Farthest that a hand's wrist may lie from the body's wrist, in forearm lengths; a hand beyond it is not taken."""

    def uses_device(self) -> bool:
        """Whether a network that the user brings, which may run on a GPU, makes the result."""
        return self.detector == "onnx-wholebody"

    def check(self) -> None:
        if (self.points == NONE) == (self.detector == "mmpose-json"):
            raise BadInput(f"keypoints.detector is {self.detector} and keypoints.points is {self.points}; expected mmpose-json "
                           "with the name of mmpose's file (`gsac models add NAME FILE`), or neither")
        for name in ("person_threshold", "hand_threshold", "face_threshold"):
            value = getattr(self, name)
            if not 0 < value < 1:
                raise BadInput(f"keypoints.{name} is {value}; expected a number between 0 and 1")
        if not self.hand_reach > 0:
            raise BadInput(f"keypoints.hand_reach is {self.hand_reach}; expected a number above 0")

    def models(self) -> tuple[str, ...]:
        """Names of the network files that the detector needs."""
        return (*MODELS[self.detector], *(() if self.points == NONE else (self.points,)))
