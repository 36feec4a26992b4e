"""InstantHMR (2026), a body regressor that the user brings as ONNX: 70 points of the Momentum Human Rig (MHR) in picture and space.

Inputs: `image`, a square crop of 224 px, RGB normalised by ImageNet's mean and deviation, and `cliff_cond`, where the person's box
lies in the frame (centre in -1..1, longer side over the frame's). Outputs by name: `joints_2d` (70, 2) in -1..1 of the crop and
`joints_3d` (70, 3) m about the body's middle, x right, y down, z away; `mhr_params`, `shape_params` and `cam_trans` are not used.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gsac.avatar.brought_network import shape_fits
from gsac.avatar.onnx_network import NetworkError, open_network, run_checked
from gsac.avatar.wholebody import HANDS, INDEX

SIZE = 224
POINTS = 70
MEAN = np.array([0.485, 0.456, 0.406], np.float32)
DEVIATION = np.array([0.229, 0.224, 0.225], np.float32)
PADDING = 1.2
"""Side of the crop, in longer sides of the person's box."""
TAKES = {"image": [None, 3, SIZE, SIZE], "cliff_cond": [None, 3]}
GIVES = {"joints_2d": [None, POINTS, 2], "joints_3d": [None, POINTS, 3]}
BODY = ("nose", "left_eye", "right_eye", "left_ear", "right_ear", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow",
        "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle", "right_ankle", "left_big_toe", "left_small_toe",
        "left_heel", "right_big_toe", "right_small_toe", "right_heel")
"""The network's points 0 to 20; then the right hand's, 21 to 40, its wrist, the left hand's, 42 to 61, its wrist."""
HAND_BEGINS = {"right": 21, "left": 42}
FINGER_POINTS = 4
"""Of each of five, thumb first, the tip before its joints down to the palm."""


class InstantHmr:
    """path: the file; name: that it was brought under. Raises NetworkError where it is no such network."""

    def __init__(self, path: Path, name: str):
        self._session, self._name = open_network(path, name), name
        told = {each.name: each.shape for each in (*self._session.get_inputs(), *self._session.get_outputs())}
        if not all(called in told and shape_fits(told[called], wanted) for called, wanted in (TAKES | GIVES).items()):
            raise NetworkError(f"model file {name} has {told}; expected InstantHMR's inputs {TAKES} and, among others, its outputs "
                               f"{GIVES}")

    def read(self, image: np.ndarray, box: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The points of one person: xy (70, 2) px of the frame, and (70, 3) m. image: (H, W, 3) uint8 RGB; box: (4,) px, the
        person's left, top, right, bottom. Raises NetworkError where it cannot be run, or gives NaN."""
        crop, corner, side = cut_person(image, box)
        ready = ((crop / np.float32(255) - MEAN) / DEVIATION).transpose(2, 0, 1)[None]
        beside = {"cliff_cond": _condition(image, box)[None]}
        xy, points = run_checked(lambda given: self._session.run(list(GIVES), {"image": given} | beside), ready.astype(np.float32),
                                 self._name)
        return corner + (xy[0].astype(float) + 1) / 2 * side, points[0].astype(float)


def cut_person(image: np.ndarray, box: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """The square about a box as the network takes it, (224, 224, 3) uint8, black outside the frame; its corner (2,) px and side,
    px. image: (H, W, 3) uint8 RGB; box: (4,) px."""
    import cv2

    side = float((box[2:] - box[:2]).max()) * PADDING
    corner = (box[:2] + box[2:]) / 2 - side / 2
    scale = side / SIZE
    matrix = np.array([[scale, 0, corner[0] + scale / 2 - 0.5], [0, scale, corner[1] + scale / 2 - 0.5]])  # pixel centres
    return cv2.warpAffine(image, matrix, (SIZE, SIZE), flags=cv2.WARP_INVERSE_MAP | cv2.INTER_LINEAR), corner, side


def to_wholebody(points: np.ndarray) -> np.ndarray:
    """The 70 points (70, D) in COCO-WholeBody's order, (133, D); NaN where the network has none."""
    out = np.full((133, points.shape[1]), np.nan)
    out[[INDEX[name] for name in BODY]] = points[:len(BODY)]
    for side, begin in HAND_BEGINS.items():
        fingers = points[begin:begin + 5 * FINGER_POINTS].reshape(5, FINGER_POINTS, -1)[:, ::-1]
        wrist = points[begin + 5 * FINGER_POINTS]
        out[HANDS[side]] = np.concatenate([wrist[None], fingers.reshape(5 * FINGER_POINTS, -1)])
        out[INDEX[f"{side}_wrist"]] = wrist
    return out


def _condition(image: np.ndarray, box: np.ndarray) -> np.ndarray:
    size = np.array(image.shape[1::-1], float)
    middle = (box[:2] + box[2:]) / size - 1
    return np.array([*middle, (box[2:] - box[:2]).max() / size.max()], np.float32)
