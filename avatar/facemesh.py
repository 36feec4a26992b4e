"""The 468-point face mesh: where to look, the network, and its correspondence to the 68 iBUG points.

BlazeFace short range on a crop about a rough face box, then the face mesh, then the face mesh again on the crop that
its own points give. Crop factors are those of the networks' training.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from gsac.avatar.logistic import clipped_sigmoid
from gsac.avatar.region import Region, around_points, crop, upright_angle
from gsac.avatar.ssd_decode import anchor_centers, decode, suppress
from gsac.avatar.tflite import Network
from gsac.avatar.yaw import yaw_of

MODELS = ("face_detection_short_range", "face_landmark")
POINTS = 468
RIGHT_EYE, LEFT_EYE = 33, 263
"""Outer corners; right is the person's right."""
RIGHT_SIDE, LEFT_SIDE = 234, 454
"""Where the face ends before the ears."""
EYE_POINTS = {"right": (33, 133, 159, 145), "left": (263, 362, 386, 374)}
"""Mesh points of the corners and lids of each eye; their mean is its centre."""
NOSE_TIP = 4
YAW_LIMIT = np.radians(115)
"""A head turned further has no face in the image."""
YAW_DOUBT = np.radians(40)
"""A mesh whose yaw differs more from the body's head is rejected."""

IBUG68 = np.array([
    162, 234, 93, 58, 172, 136, 149, 148, 152, 377, 378, 365, 397, 288, 323, 454, 389,
    70, 63, 105, 66, 107, 336, 296, 334, 293, 300, 168, 197, 5, 4, 75, 97, 2, 326, 305,
    33, 160, 158, 133, 153, 144, 362, 385, 387, 263, 373, 380,
    61, 39, 37, 0, 267, 269, 291, 405, 314, 17, 84, 181, 78, 82, 13, 312, 308, 317, 14, 87])
"""(68,) mesh point of each iBUG-68 point: contour, brows, nose, eyes, mouth."""


@dataclass(frozen=True)
class Face:
    """One reading of the mesh network."""

    points: np.ndarray
    """(468, 3) px; z away from the camera, in pixels at the face's scale, 0 near the face's middle."""
    presence: float
    """0..1: the network's own confidence that there is a face."""

    @property
    def yaw(self) -> float:
        """Radians: 0 toward the camera, growing to the frame's right."""
        across = self.points[LEFT_SIDE] - self.points[RIGHT_SIDE]
        return float(np.arctan2(across[2], across[0]))

    def facing(self) -> np.ndarray:
        """(468,) 0..1: 1 for points that face the camera, 0 for those that the head itself hides.

        The outward direction of a point is that from the middle between the ears."""
        out = self.points - (self.points[LEFT_SIDE] + self.points[RIGHT_SIDE]) / 2
        toward = -out[:, 2] / np.maximum(np.linalg.norm(out, axis=1), 1e-6)
        return np.clip(toward / 0.3 + 1, 0, 1)


class MeshNetwork(Protocol):
    """Anything that reads a face's points off a crop."""

    width: int
    """px of the crop."""

    def __call__(self, image: np.ndarray, /) -> Sequence[np.ndarray]:
        """Points, 468 times x, y, z px of the crop, and the presence before the sigmoid. image: (width, width, 3) in 0..1."""
        ...


class FaceMesh:
    """Detector and mesh network."""

    def __init__(self, models: dict[str, Path], threads: int | None = None):
        """models: name -> file, at least `MODELS`; threads: of each network, as `Network`."""
        self._detector = Network(models["face_detection_short_range"], threads)
        self._mesh = Network(models["face_landmark"], threads)
        self._anchors = anchor_centers(self._detector.width, (8, 16, 16, 16))

    def find(self, image: np.ndarray, rough: Region, yaw: float | None = None, threshold: float = 0.5) -> Face | None:
        """The face in an image; None where no crop gives a mesh that both the network and the head's yaw support.

        image: (H, W, 3) uint8; rough: a region about three face boxes wide, eyes level; yaw: rad of the head by the body's
        points, as `Face.yaw`, None where unknown. On a profile the networks often fit a frontal mesh to half a face with a high
        presence: hence a mesh more than `YAW_DOUBT` from that yaw is rejected, and beyond `YAW_LIMIT` no face is looked for.
        """
        if yaw is not None and abs(yaw) > YAW_LIMIT:
            return None
        for look in (rough, Region(rough.center, rough.side), rough.scaled(2 / 3), rough.scaled(4 / 3)):
            region = self.detect(image, look, threshold)
            if region is None:
                continue
            first = read_face(self._mesh, image, region)
            again = read_face(self._mesh, image, region_of(first.points))
            for face in (again, first):
                if face.presence >= threshold and (yaw is None or abs(_wrap(face.yaw - yaw)) < YAW_DOUBT):
                    return face
        return None

    def detect(self, image: np.ndarray, rough: Region, threshold: float = 0.5) -> Region | None:
        """The mesh network's region from the best detection inside `rough`, None without one. image: (H, W, 3) uint8."""
        size = self._detector.width
        raw, logits = self._detector(crop(image, rough, size, outside="black") * 2 - 1)
        found = suppress(decode(raw, logits, self._anchors, size, threshold))
        if not len(found):
            return None
        points = rough.to_frame(found.points[0])
        right, left = points[0], points[1]
        return around_points(points, upright_angle(right, left, 0.0)).scaled(2.0).moved(0.0, -0.1)


def read_face(network: MeshNetwork, image: np.ndarray, region: Region, mirror: np.ndarray | None = None) -> Face:
    """Runs a mesh network on one crop.

    image: (H, W, 3) uint8; mirror: (468,) index of each point's mirror image, to run it on the mirrored crop.
    """
    size = network.width
    seen = crop(image, region, size)
    raw, presence = network(seen if mirror is None else seen[:, ::-1])
    points = raw.reshape(POINTS, 3).astype(np.float64) / size
    if mirror is not None:
        points = points[mirror]
        points[:, 0] = 1 - points[:, 0]
    xy = region.to_frame(points[:, :2])
    return Face(np.hstack([xy, points[:, 2:] * region.side]), float(clipped_sigmoid(presence.reshape(-1)[0])))


def region_of(points: np.ndarray) -> Region:
    """The region that centres the points (468, 2 or 3), px, as in the networks' training."""
    angle = upright_angle(points[RIGHT_EYE, :2], points[LEFT_EYE, :2], 0.0)
    return around_points(points[:, :2], angle).scaled(1.5)


def _wrap(angle: float) -> float:
    """Radians in -pi..pi."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def region_of_head(points: np.ndarray) -> Region:
    """The rough region for `FaceMesh.find`. points: (11, 2) px, BlazePose's nose, eyes, ears and mouth."""
    return around_points(points, upright_angle(points[5], points[2], 0.0)).scaled(3.0)


def head_yaw(world: np.ndarray) -> float:
    """Yaw as `Face.yaw`, rad. world: (11, 3) m, BlazePose's nose, eyes, ears and mouth."""
    return float(yaw_of(world[0] - (world[7] + world[8]) / 2))
