"""Parameters of keypoints."""

from __future__ import annotations

from dataclasses import dataclass

from gsac.stages.contract import BadInput

MODELS = {
    "mediapipe": ("pose_detection", "pose_landmark_full", "hand_recrop", "palm_detection_full", "hand_landmark_full",
                  "face_detection_short_range", "face_landmark"),
    "onnx-wholebody": ("pose_detection", "pose_landmark_full", "onnx-wholebody", "face_detection_short_range",
                       "face_landmark"),
}
"""Detector -> the network files it needs."""


@dataclass
class KeypointsConfig:
    detector: str = "mediapipe"
    """Which networks look: `mediapipe`, or `onnx-wholebody`: a SimCC whole-body network (RTMW, DWPose) that you bring by
    `gsac models add onnx-wholebody FILE`."""
    person_threshold: float = 0.5
    """Least confidence, 0..1, for a person to count as seen."""
    hand_threshold: float = 0.5
    """Least confidence, 0..1, for a hand to count as seen."""
    face_threshold: float = 0.5
    """Least confidence, 0..1, for a face to count as seen."""
    hand_reach: float = 0.5
    """Farthest a hand's wrist may lie from the body's wrist, in forearm lengths; beyond it the hand was not seen."""

    def check(self) -> None:
        if self.detector not in MODELS:
            raise BadInput(f"keypoints.detector is {self.detector!r}; choices: {', '.join(MODELS)}")
        for name in ("person_threshold", "hand_threshold", "face_threshold"):
            value = getattr(self, name)
            if not 0 < value < 1:
                raise BadInput(f"keypoints.{name} is {value}; expected a number between 0 and 1")
        if not self.hand_reach > 0:
            raise BadInput(f"keypoints.hand_reach is {self.hand_reach}; expected a number above 0")

    def models(self) -> tuple[str, ...]:
        """Names of the network files that the detector needs."""
        return MODELS[self.detector]
