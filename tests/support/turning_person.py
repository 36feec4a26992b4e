"""A person of known pose who turns before a camera, and exact or noisy detections of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from gsac.avatar import rotation
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.frame_files import write_alpha
from gsac.avatar.zbuffer import silhouette
from gsac.stages.smplx.sightings import HIPS, Sightings
from gsac.stages.smplx.silhouette import Outline, read_outline

WIDTH, HEIGHT, FOCAL = 360, 640, 700.0


def turning_person(body: Body, frames: int, seed: int = 0) -> BodyParams:
    """A person of some shape who turns, arms hanging and swinging a little."""
    rng = np.random.default_rng(seed)
    pose = np.zeros((frames, 55, 3))
    yaw = np.linspace(0, 1.8 * np.pi, frames)
    pose[:, 0] = (Rotation.from_euler("x", np.pi) * Rotation.from_euler("y", yaw[:, None])).as_rotvec().reshape(frames, 3)
    swing = 0.08 * np.sin(np.linspace(0, 5, frames))
    pose[:, 16, 2], pose[:, 17, 2] = -0.9 + swing, 0.85 + swing
    pose[:, 18, 1], pose[:, 19, 1] = -0.4, 0.5
    betas = np.append(rng.normal(0, 0.5, body.num_figure), np.zeros(len(body.clothes)))
    transl = np.tile([0.05, 0.0, 2.4], (frames, 1))
    return BodyParams.from_pose(pose, transl, betas, np.zeros((frames, 52)), FOCAL, (WIDTH / 2, HEIGHT / 2), model=body.digest)


def facing_person(body: Body, frames: int = 4) -> BodyParams:
    """A person of some shape who faces the camera at first and turns by 1 rad, the arms apart."""
    pose = np.zeros((frames, 55, 3))
    yaw = np.linspace(0, 1, frames)
    turn = rotation.exp(np.array([np.pi, 0, 0])) @ rotation.exp(np.stack([0 * yaw, yaw, 0 * yaw], 1))
    pose[:, 0] = rotation.log(turn)
    pose[:, 16, 2], pose[:, 17, 2], pose[:, 18, 1] = -1.1, 0.7, -0.6
    betas = np.append(np.random.default_rng(0).normal(0, 0.5, body.num_figure), np.zeros(len(body.clothes)))
    transl = np.tile([0.05, 0, 2.4], (frames, 1))
    return BodyParams.from_pose(pose, transl, betas, np.zeros((frames, 52)), FOCAL, (WIDTH / 2, HEIGHT / 2))


def sightings_of(body: Body, params: BodyParams, noise: float = 0.0, seconds: bool = True,
                 face: dict[str, np.ndarray] | None = None) -> Sightings:
    """Exact or noisy detections of a posed body."""
    vertices, _ = body.posed(params)
    points = body.keypoints(vertices)
    xy = params.camera(WIDTH, HEIGHT).project(points)
    xy = xy + np.random.default_rng(1).normal(0, noise, xy.shape)
    score = np.isfinite(xy).all(-1).astype(float)
    world = points - points[:, list(HIPS)].mean(1, keepdims=True)
    time = np.arange(params.frames) / 10 if seconds else None
    return Sightings(np.nan_to_num(xy), score, np.full(score.shape, max(noise, 0.5)), world, time, WIDTH, HEIGHT, FOCAL,
                     face=face)


def outlines_of(body: Body, params: BodyParams, folder: Path) -> list[Outline]:
    out = []
    for t in range(params.frames):
        vertices, _ = body.posed(params, [t])
        path = folder / f"{t:06d}.exr"
        write_alpha(path, silhouette(vertices[0], body.faces, params.camera(WIDTH, HEIGHT)).astype(np.float32))
        out.append(read_outline(path))
    return out


def joint_error_mm(body: Body, found: BodyParams, truth: BodyParams) -> np.ndarray:
    """(T, 22) root-aligned."""
    a, b = body.posed(found)[1][:, :22], body.posed(truth)[1][:, :22]
    return 1e3 * np.linalg.norm((a - a[:, :1]) - (b - b[:, :1]), axis=-1)


def height_of(body: Body, params: BodyParams) -> float:
    vertices, _ = body.rest(params.betas)
    return float(np.ptp(vertices[:, 1]))


def head_of(body: Body, betas: np.ndarray) -> dict:
    """The body's own head as face.npz would bring it, somewhere else."""
    index = np.flatnonzero(body.weights[:, [15, 23, 24]].sum(1) > 0.5)
    place = np.full(len(body.v_template), -1)
    place[index] = np.arange(len(index))
    faces = place[body.faces]
    vertices = body.rest(betas)[0]
    return {"valid": np.ones(4, bool), "head_template": body.v_template[index] + 0.3, "head_vertices": vertices[index] - 0.2,
            "head_faces": faces[(faces >= 0).all(1)], "head_eyes": body.J_regressor[[23, 24]] @ body.v_template + 0.3}
