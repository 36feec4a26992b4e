"""A synthetic clip: the open body turns once, drawn by other gaussians than those to train; poses are disturbed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsac.avatar.binding import bind, face_frames
from gsac.avatar.body import Body
from gsac.avatar.camera import Camera
from gsac.avatar.cuda.arrays import BodyArrays, Shot
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.raster import render_bound
from gsac.avatar.rotation import log
from gsac.avatar.skinning import joint_transforms, rotation_matrices, skin
from gsac.avatar.threads import Workspace

SHARE = 0.8
"""Height of the person over that of the image."""
CLOTH = 0.01
"""Distance of the drawn gaussians from the body, m."""
TURN_ERROR, SHIFT_ERROR = 0.005, 0.002
"""Standard deviation of the errors of pose, rad, and translation, m."""


@dataclass
class Figure:
    """A body, T shots of it, and its poses."""

    body: BodyArrays
    shots: list[Shot]
    pose: np.ndarray
    """(T, 55, 3) rad, disturbed: training starts from it."""
    transl: np.ndarray
    """(T, 3) m, disturbed."""
    true_pose: np.ndarray
    """(T, 55, 3) rad, as in the shots."""
    true_transl: np.ndarray
    """(T, 3) m, as in the shots."""

    def vertices(self, pose: np.ndarray, transl: np.ndarray) -> np.ndarray:
        """Vertices (V, 3) m, skinned by the CPU path. pose: (55, 3) rad; transl: (3,) m."""
        b = self.body
        transforms = joint_transforms(pose[None], b.joints.astype(np.float64), b.parents)[0].astype(np.float32)
        return skin(b.rest[0], transforms, b.skin_index, b.skin_weight) + transl.astype(np.float32)

    def scaled(self, by: int) -> list[Shot]:
        """The shots at 1 / `by` of their size."""
        import cv2

        sizes = [(s.camera.width // by, s.camera.height // by) for s in self.shots]
        return [Shot(cv2.resize(s.pixels, size, interpolation=cv2.INTER_AREA), s.camera.scaled(*size))
                for s, size in zip(self.shots, sizes, strict=True)]


def figure(frames: int, width: int, height: int, truth: int = 60000, seed: int = 0) -> Figure:
    """Makes the clip. width, height: px; truth: number of gaussians that draw the shots."""
    random = np.random.default_rng(seed)
    model = Body.load()
    rest, joints = model.rest(np.zeros(model.num_betas, np.float32))
    body = BodyArrays(rest[None], np.zeros(frames, np.int32), joints, np.asarray(model.parents), model.skin_index,
                      model.skin_weight, model.faces)
    tall = float(np.ptp(rest[:, 1]))
    camera = Camera((1.3 * height, 1.3 * height), (width / 2, height / 2), width, height)
    pose = random.normal(0, 0.03, (frames, 55, 3))
    pose[:, 16, 2] -= 0.9
    pose[:, 17, 2] += 0.9
    angle = np.linspace(0, 2 * np.pi, frames, endpoint=False)
    upright = rotation_matrices(np.array([[np.pi, 0, 0]]))[0]
    turned = rotation_matrices(np.stack([0 * angle, angle, 0 * angle], 1))
    pose[:, 0] = log(upright @ turned)
    middle = (rest[:, 1].max() + rest[:, 1].min()) / 2  # turned over about the pelvis it lies at 2 pelvis - middle
    transl = np.tile([0.0, middle - 2 * joints[0, 1], 1.3 * tall / SHARE], (frames, 1))
    out = Figure(body, [], pose + random.normal(0, TURN_ERROR, pose.shape), transl + random.normal(0, SHIFT_ERROR, transl.shape),
                 pose, transl)
    drawn, workspace = _textured(rest, model.faces, truth, seed + 1), Workspace()
    for t in range(frames):
        rendering = render_bound(out.vertices(pose[t], transl[t]), model.faces, drawn, camera, workspace)
        rgba = np.dstack([rendering.rgb, rendering.alpha])
        out.shots.append(Shot(np.uint8(np.clip(np.round(rgba * 255), 0, 255)), camera))
    return out


def start(body: BodyArrays, count: int, seed: int = 3) -> Gaussians:
    """Grey gaussians spread by area, to start a training from."""
    return Gaussians.area(body.rest[0], body.faces, count, seed)


def _textured(rest: np.ndarray, faces: np.ndarray, count: int, seed: int) -> Gaussians:
    """Gaussians with stripes and checks, `CLOTH` off the body."""
    g = Gaussians.area(rest, faces, count, seed)
    frames = face_frames(rest, faces)
    g.mu[:, 1] += (CLOTH / np.maximum(frames.k[g.face], 1e-6)).astype(np.float32)
    x, y, z = bind(frames, g.face, g.mu, g.quat, g.log_scale).means.T
    stripes = 0.5 + 0.5 * np.sin(60 * y)
    checks = (np.floor(x * 18) + np.floor(y * 18) + np.floor(z * 18)) % 2
    g.rgb = np.stack([0.15 + 0.7 * stripes, 0.2 + 0.6 * checks, 0.5 + 0.4 * np.sin(25 * x)], 1).astype(np.float32)
    return g
