"""The face's 468 points: by two networks, averaged over several crops, and aligned to remove the head's motion."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np

from gsac.avatar.facemesh import LEFT_EYE, LEFT_SIDE, POINTS, RIGHT_EYE, RIGHT_SIDE, Face, read_face, region_of
from gsac.avatar.tflite import Network
from gsac.stages.face.attention_mesh import AttentionMesh
from gsac.stages.face.config import ATTENTIVE, PLAIN

STABLE = np.array([168, 6, 197, 195, 5, 10, 151, 9, 8, RIGHT_EYE, 133, 362, LEFT_EYE, RIGHT_SIDE, LEFT_SIDE, 127, 356,
                   162, 389, 21, 251, 54, 284, 103, 332, 67, 297, 109, 338])
"""Points that facial actions hardly move: nose bridge, forehead, corners of the eyes, temples."""
TURNS = np.radians((-6.0, 0.0, 6.0))
"""Turns of the crops, rad."""
LIDS = 32
"""Points of an eye's part, its first, on the lids' rims and the ring about them; the others lie on cheek and brow."""


class TwoMeshes:
    """Lips and lids by the network with attention, all else by the plain one, whose brows waver less."""

    def __init__(self, models: dict[str, Path]):
        """models: name -> file, `PLAIN` and `ATTENTIVE` among them."""
        self._plain, self._attentive = Network(models[PLAIN], threads=1), AttentionMesh(models[ATTENTIVE], threads=1)
        lips, *eyes = self._attentive.parts
        self._finer = np.concatenate([lips.points, *(eye.points[:LIDS] for eye in eyes)])
        self.width = self._plain.width

    def __call__(self, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points (468, 3) px of the crop, and the presence before the sigmoid. image: (192, 192, 3) float32 in 0..1."""
        raw, presence = self._plain(image)
        points = raw.reshape(POINTS, 3)
        points[self._finer] = self._attentive(image)[0][self._finer]
        return points, presence


def read_averaged(network: TwoMeshes, image: np.ndarray, points: np.ndarray, mirror: np.ndarray) -> Face:
    """image: (H, W, 3) uint8; points: (468, 2 or 3) px, roughly right; mirror: (468,) each point's mirror image.

    The mean over slightly turned and mirrored crops: on one crop the network's noise exceeds a small action.
    """
    region = region_of(points)
    faces = [read_face(network, image, type(region)(region.center, region.side, region.angle + turn), flip)
             for turn, flip in itertools.product(TURNS, (None, mirror))]
    return Face(np.mean([face.points for face in faces], axis=0), float(np.mean([face.presence for face in faces])))


def align(points: np.ndarray, neutral: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """points: (468, 3) px with y down, z away; neutral: (468, 3) m, y up, z out of the face; weight: (468,).

    Returns the points (468, 3) m under the similarity that brings their `STABLE` ones nearest to the neutral's (Umeyama), and the
    direction (3,) in which the face looks, y up, z toward the camera, unit length.
    """
    points = points * [1, -1, -1]
    source, target, w = points[STABLE], neutral[STABLE], weight[STABLE] / weight[STABLE].sum()
    a, b = source - w @ source, target - w @ target
    u, _, vt = np.linalg.svd((b * w[:, None]).T @ a)
    turn = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    turned = a @ turn.T
    size = (w @ (turned * b).sum(axis=1)) / (w @ (turned * turned).sum(axis=1))
    return size * (points - w @ source) @ turn.T + w @ target, turn[2]
