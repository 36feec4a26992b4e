"""A whole-body network with SimCC outputs (RTMPose, RTMW, DWPose; 133 points), brought by the user as an ONNX file.

Its input is 3 x H x W (384 x 288 or 256 x 192), RGB normalised by ImageNet's mean and deviation; its outputs, simcc_x and simcc_y,
are a height for each half pixel along x and along y, (1, 133, 2 W) and (1, 133, 2 H). These are the shapes of mmpose's published
configurations.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gsac.avatar.onnx_network import NetworkError, open_network, run_checked, run_session

MEAN = np.array([123.675, 116.28, 103.53], np.float32)
DEVIATION = np.array([58.395, 57.12, 57.375], np.float32)
PADDING = 1.25
"""Side of the crop, in sides of the box of BlazePose's points."""
POINTS = 133


class SimccNetwork:
    """path: the ONNX file; raises NetworkError where it is no such network."""

    def __init__(self, path: Path):
        self._session = open_network(path, "onnx-wholebody")
        shape, outputs = self._session.get_inputs()[0].shape, self._session.get_outputs()
        if len(shape) != 4 or not all(isinstance(n, int) for n in shape[2:]) or len(outputs) != 2:
            raise NetworkError(f"model file onnx-wholebody has input {shape} and {len(outputs)} outputs; expected a SimCC "
                               "network of 133 points: input [N, 3, height, width] and the two outputs simcc_x, simcc_y")
        self.height, self.width = shape[2:]

    def read(self, image: np.ndarray, to_frame: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """image: (H, W, 3) uint8 RGB; to_frame: (2, 3), crop pixels to frame pixels. Returns xy (133, 2) px of the frame
        and peaks (133,), whose scale is the network's own."""
        import cv2

        # OpenCV counts from pixel centres at 0, we from their corners.
        centres = to_frame.copy()
        centres[:, 2] += to_frame[:, :2] @ [0.5, 0.5] - 0.5
        crop = cv2.warpAffine(image, centres, (self.width, self.height), flags=cv2.WARP_INVERSE_MAP | cv2.INTER_LINEAR)
        ready = ((crop - MEAN) / DEVIATION).transpose(2, 0, 1)[None].astype(np.float32)
        x, y = run_checked(lambda given: run_session(self._session, given), ready, "onnx-wholebody")
        if x.shape[:2] != (1, POINTS) or y.shape[:2] != (1, POINTS) or x.size * self.height != y.size * self.width:
            raise NetworkError(f"model file onnx-wholebody gives arrays of shapes {x.shape} and {y.shape}; expected simcc_x "
                               f"(1, {POINTS}, {2 * self.width}) and simcc_y (1, {POINTS}, {2 * self.height}), of "
                               f"COCO-WholeBody's {POINTS} points")
        xy, peaks = decode(x[0], y[0], self.width, self.height)
        return xy @ to_frame[:, :2].T + to_frame[:, 2], peaks


def crop_matrix(points: np.ndarray, width: int, height: int) -> np.ndarray:
    """points: (n, 2) px that span the person. Returns (2, 3), crop pixels to frame pixels: the upright padded box of the points,
    widened to the crop's aspect."""
    low, high = points.min(axis=0), points.max(axis=0)
    scale = float(((high - low) * PADDING / [width, height]).max())
    middle = (low + high) / 2
    return np.array([[scale, 0, middle[0] - scale * width / 2], [0, scale, middle[1] - scale * height / 2]])


def decode(x: np.ndarray, y: np.ndarray, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """x: (n, bins), y: (n, bins) heights along the axes of a width x height crop. Returns places (n, 2) px of the crop and peaks
    (n,), the lesser of both axes' (Li et al. 2022). A place is its bin's: the official decoder refines no further for these
    networks, which were trained on half pixels."""
    at = np.stack([x.argmax(axis=1) * width / x.shape[1], y.argmax(axis=1) * height / y.shape[1]], axis=1)
    return at + 0.5, np.minimum(x.max(axis=1), y.max(axis=1))
