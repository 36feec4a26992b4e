"""The made clip: the open body turning once, textured by other gaussians than those that are trained, poses disturbed."""

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
"""Of the image's height that the person fills."""
CLOTH = 0.01
"""m by which the truth stands off the body."""
TURN_ERROR, SHIFT_ERROR = 0.005, 0.002


@dataclass
class Figure:
    body: BodyArrays
    shots: list[Shot]
    pose: np.ndarray
    """(T, 55, 3) as training is told it; `true_pose` is what the shots show."""
    transl: np.ndarray
    true_pose: np.ndarray
    true_transl: np.ndarray

    def vertices(self, pose: np.ndarray, transl: np.ndarray) -> np.ndarray:
        """(V, 3) m of one pose (55, 3), as the CPU path skins it."""
        b = self.body
        transforms = joint_transforms(pose[None], b.joints.astype(np.float64), b.parents)[0].astype(np.float32)
        return skin(b.rest[0], transforms, b.skin_index, b.skin_weight) + transl.astype(np.float32)

    def scaled(self, by: int) -> list[Shot]:
        """The shots, so many times smaller."""
        import cv2

        sizes = [(s.camera.width // by, s.camera.height // by) for s in self.shots]
        return [Shot(cv2.resize(s.pixels, size, interpolation=cv2.INTER_AREA), s.camera.scaled(*size))
                for s, size in zip(self.shots, sizes, strict=True)]


def figure(frames: int, width: int, height: int, truth: int = 60000, seed: int = 0) -> Figure:
    """truth: how many gaussians draw the shots."""
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
    """Grey gaussians spread by area."""
    return Gaussians.area(body.rest[0], body.faces, count, seed)


def _textured(rest, faces, count, seed) -> Gaussians:
    g = Gaussians.area(rest, faces, count, seed)
    frames = face_frames(rest, faces)
    g.mu[:, 1] += (CLOTH / np.maximum(frames.k[g.face], 1e-6)).astype(np.float32)
    x, y, z = bind(frames, g.face, g.mu, g.quat, g.log_scale).means.T
    stripes = 0.5 + 0.5 * np.sin(60 * y)
    checks = (np.floor(x * 18) + np.floor(y * 18) + np.floor(z * 18)) % 2
    g.rgb = np.stack([0.15 + 0.7 * stripes, 0.2 + 0.6 * checks, 0.5 + 0.4 * np.sin(25 * x)], 1).astype(np.float32)
    return g
