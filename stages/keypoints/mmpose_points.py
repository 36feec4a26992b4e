"""Key points that mmpose found, brought by the user as its JSON.

BlazePose finds the person, of mmpose's persons the nearest counts, and gives the points in metres; the face mesh network gives what
`face` reads.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gsac.avatar.artifacts import ArtifactError
from gsac.avatar.blazepose import Pose
from gsac.avatar.facemesh import Face
from gsac.avatar.mmpose_file import read_mmpose
from gsac.stages.contract import BadInput
from gsac.stages.counting import counted
from gsac.stages.keypoints.config import KeypointsConfig
from gsac.stages.keypoints.detection import Frame
from gsac.stages.keypoints.detector import BODY133, Detector
from gsac.stages.keypoints.simcc import drop_doubled_hand, settle_scores

FAR = 0.25
"""Median distance of the body's points from BlazePose's, over its body's extent, from which on a person is another one."""


class MmposePoints(Detector):
    def __init__(self, models: dict[str, Path], config: KeypointsConfig):
        try:
            self._found = read_mmpose(models[config.points])
        except ArtifactError as error:
            raise BadInput(f"keypoints.points is {config.points}: {error}") from error
        super().__init__(models, config)

    def write_points(self, frame: Frame, image: np.ndarray, pose: Pose, face: Face | None) -> None:
        """image: (H, W, 3) uint8 RGB. Nothing yet: which frame of the clip this is shows at its end."""

    def settle(self, frames: list[Frame]) -> None:
        source = f"keypoints.points is {self._config.points}: it"
        lacking = sorted(range(len(frames)) - self._found.keys())
        if lacking or len(self._found) > len(frames):
            raise BadInput(f"{source} has {counted(len(self._found), 'frame')}, the clip {len(frames)}"
                           + (f", and none for frame {lacking[0]}" if lacking else "") + "; run mmpose on this run's split/frames")
        for t, frame in enumerate(frames):
            if frame.seen:
                write_nearest(frame, self._found[t])
        settle_scores(frames, source)


def write_nearest(frame: Frame, persons: np.ndarray) -> None:
    """Writes the points of the one of persons (P, 133, 3), px and score, that lies where BlazePose's does; a frame in which none
    does has nobody."""
    body = frame.xy[BODY133]
    away = np.median(np.linalg.norm(persons[:, BODY133, :2] - body, axis=2), axis=1)
    if not len(away) or away.min() > FAR * np.ptp(body, axis=0).max():
        frame.score[:] = 0
        return
    nearest = persons[away.argmin()]
    frame.xy[:], frame.score[:] = nearest[:, :2], nearest[:, 2]
    drop_doubled_hand(frame)
