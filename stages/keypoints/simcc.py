"""A whole-body network with SimCC outputs (RTMPose, RTMW, DWPose; 133 points), brought by the user as an ONNX file.

Its input is 3 x H x W, RGB normalised by ImageNet's mean and deviation; its outputs are a score for each half pixel along x and
along y. BlazePose finds the person and gives the points in metres; the face mesh network gives what `face` reads.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gsac.avatar.blazepose import Pose
from gsac.avatar.facemesh import Face
from gsac.avatar.onnx_network import NetworkError, open_network
from gsac.avatar.wholebody import HANDS
from gsac.stages.contract import BadInput
from gsac.stages.keypoints.config import KeypointsConfig
from gsac.stages.keypoints.detection import Frame
from gsac.stages.keypoints.detector import Detector

MEAN = np.array([123.675, 116.28, 103.53], np.float32)
DEVIATION = np.array([58.395, 57.12, 57.375], np.float32)
PADDING = 1.25
"""Side of the crop, in sides of the box of BlazePose's points."""
POINTS = 133


class SimccNetwork:
    """path: the ONNX file; raises `BadInput` where it is no such network."""

    def __init__(self, path: Path):
        try:
            self._session = open_network(path, "onnx-wholebody")
        except NetworkError as e:
            raise BadInput(str(e)) from e
        self._input = self._session.get_inputs()[0]
        shape, outputs = self._input.shape, self._session.get_outputs()
        if len(shape) != 4 or not all(isinstance(n, int) for n in shape[2:]) or len(outputs) != 2:
            raise BadInput(f"model file onnx-wholebody has input {shape} and {len(outputs)} outputs; expected a SimCC "
                           "network of 133 points: input [N, 3, height, width] and the two outputs simcc_x, simcc_y")
        self.height, self.width = shape[2:]

    def read(self, image: np.ndarray, to_frame: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """image: (H, W, 3) uint8 RGB; to_frame: (2, 3), crop pixels to frame pixels. Returns xy (133, 2) px of the frame
        and score (133,) in 0..1."""
        import cv2

        # OpenCV counts from pixel centres at 0, we from their corners.
        centres = to_frame.copy()
        centres[:, 2] += to_frame[:, :2] @ [0.5, 0.5] - 0.5
        crop = cv2.warpAffine(image, centres, (self.width, self.height), flags=cv2.WARP_INVERSE_MAP | cv2.INTER_LINEAR)
        ready = ((crop - MEAN) / DEVIATION).transpose(2, 0, 1)[None].astype(np.float32)
        x, y = map(np.asarray, self._session.run(None, {self._input.name: ready}))
        if x.shape[1] != POINTS:
            raise BadInput(f"model file onnx-wholebody gives {x.shape[1]} points; expected COCO-WholeBody's {POINTS}")
        xy, score = decode(x[0], y[0], self.width, self.height)
        return xy @ to_frame[:, :2].T + to_frame[:, 2], np.clip(score, 0, 1)


class Wholebody(Detector):
    def __init__(self, models: dict[str, Path], config: KeypointsConfig):
        self._network = SimccNetwork(models["onnx-wholebody"])
        super().__init__(models, config)

    def write_points(self, frame: Frame, image: np.ndarray, pose: Pose, face: Face | None) -> None:
        """image: (H, W, 3) uint8 RGB. All 133 points; those in metres stay BlazePose's."""
        network = self._network
        frame.xy[:], frame.score[:] = network.read(image, crop_matrix(pose.points, network.width, network.height))
        drop_doubled_hand(frame)


def crop_matrix(points: np.ndarray, width: int, height: int) -> np.ndarray:
    """points: (n, 2) px that span the person. Returns (2, 3), crop pixels to frame pixels: the upright padded box of the points,
    widened to the crop's aspect."""
    low, high = points.min(axis=0), points.max(axis=0)
    scale = float(((high - low) * PADDING / [width, height]).max())
    middle = (low + high) / 2
    return np.array([[scale, 0, middle[0] - scale * width / 2], [0, scale, middle[1] - scale * height / 2]])


def decode(x: np.ndarray, y: np.ndarray, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """x: (n, bins), y: (n, bins) scores along the axes of a width x height crop. Returns places (n, 2) px of the crop and scores
    (n,), the lesser of both axes' peaks (Li et al. 2022)."""
    at = np.stack([x.argmax(axis=1) * width / x.shape[1], y.argmax(axis=1) * height / y.shape[1]], axis=1)
    return at + 0.5, np.minimum(x.max(axis=1), y.max(axis=1))


def drop_doubled_hand(frame: Frame) -> None:
    """Where both hands' points lie on one hand of the image, sets the score of the less certain one to 0."""
    left, right = HANDS["left"], HANDS["right"]
    size = min(np.ptp(frame.xy[left], axis=0).max(), np.ptp(frame.xy[right], axis=0).max())
    if np.median(np.linalg.norm(frame.xy[left] - frame.xy[right], axis=1)) < size / 4:
        loser = left if frame.score[left].mean() < frame.score[right].mean() else right
        frame.score[loser] = 0
