"""The detector that takes its points from a SimCC whole-body network of the user's (`avatar/simcc.py`).

BlazePose finds the person and gives the points in metres; the face mesh network gives what `face` reads.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from gsac.avatar.blazepose import Pose
from gsac.avatar.facemesh import Face
from gsac.avatar.onnx_network import NetworkError
from gsac.avatar.simcc import SimccNetwork, crop_matrix
from gsac.avatar.wholebody import HANDS
from gsac.stages.contract import BadInput
from gsac.stages.keypoints.config import KeypointsConfig
from gsac.stages.keypoints.detection import Frame
from gsac.stages.keypoints.detector import Detector
from gsac.stages.keypoints.simcc_scores import calibrate


@contextmanager
def brought() -> Iterator[None]:
    """What is wrong with the network is the user's to mend."""
    try:
        yield
    except NetworkError as error:
        raise BadInput(str(error)) from error


class Wholebody(Detector):
    def __init__(self, models: dict[str, Path], config: KeypointsConfig):
        with brought():
            self._network = SimccNetwork(models["onnx-wholebody"])
        super().__init__(models, config)

    def write_points(self, frame: Frame, image: np.ndarray, pose: Pose, face: Face | None) -> None:
        """image: (H, W, 3) uint8 RGB. All 133 points, scored by their peaks; those in metres stay BlazePose's."""
        network = self._network
        with brought():
            frame.xy[:], frame.score[:] = network.read(image, crop_matrix(pose.points, network.width, network.height))
        drop_doubled_hand(frame)

    def settle(self, frames: list[Frame]) -> None:
        settle_scores(frames, "model file onnx-wholebody")


def settle_scores(frames: list[Frame], source: str) -> None:
    """Makes scores of the peaks that the frames of a clip hold. source: whose they are, for the error."""
    with brought():
        scores = calibrate(np.array([frame.score for frame in frames]), source)
    for frame, score in zip(frames, scores, strict=True):
        frame.score[:] = score


def drop_doubled_hand(frame: Frame) -> None:
    """Where both hands' points lie on one hand of the image, sets the score of the less certain one to 0."""
    left, right = HANDS["left"], HANDS["right"]
    size = min(np.ptp(frame.xy[left], axis=0).max(), np.ptp(frame.xy[right], axis=0).max())
    if np.median(np.linalg.norm(frame.xy[left] - frame.xy[right], axis=1)) < size / 4:
        loser = left if frame.score[left].mean() < frame.score[right].mean() else right
        frame.score[loser] = 0
