"""What a detector gets wrong of one person in every frame is told apart from the pose, and joints may lie off the betas."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gsac.avatar import rotation
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.wholebody import INDEX
from gsac.stages.smplx import detector_errors
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.detector_errors import Detector
from gsac.stages.smplx.lm.fit import fit_clip
from gsac.stages.smplx.lm.person_offsets import JOINTS
from gsac.stages.smplx.sightings import Sightings
from gsac.stages.smplx.state import to_params
from gsac.stages.smplx.symmetry import mirror_directions

WIDTH, HEIGHT, FOCAL, FRAMES = 360, 640, 700.0, 10
UP = 0.03


def turn(body: Body) -> BodyParams:
    pose = np.zeros((FRAMES, 55, 3))
    yaw = np.linspace(0, 1.8 * np.pi, FRAMES)[:, None]
    pose[:, 0] = (Rotation.from_euler("x", np.pi) * Rotation.from_euler("y", yaw)).as_rotvec().reshape(FRAMES, 3)
    pose[:, 16, 2], pose[:, 17, 2] = -0.9, 0.9
    return BodyParams.from_pose(pose, np.tile([0.0, 0, 2.4], (FRAMES, 1)), np.zeros(body.num_betas), np.zeros((FRAMES, 52)), FOCAL,
                                (WIDTH / 2, HEIGHT / 2), model=body.digest)


def fitted(body: Body, truth: BodyParams, config: dict, hips_up: float = 0.0):
    """The fit of exact points but for the hips, which lie so many metres too high along the pelvis in every frame."""
    points = body.keypoints(body.posed(truth)[0])
    world = points - points[:, [INDEX["left_hip"]]]
    seen = points.copy()
    up = rotation.exp(truth.pose[:, 0].astype(float))[:, :, 1]
    for name in ("left_hip", "right_hip"):
        seen[:, INDEX[name]] += hips_up * up
    xy = truth.camera(WIDTH, HEIGHT).project(seen)
    score = np.isfinite(xy).all(-1).astype(float)
    sightings = Sightings(np.nan_to_num(xy), score, np.full(score.shape, 0.5), world, np.arange(FRAMES) / 10, WIDTH, HEIGHT, FOCAL)
    height = float(np.ptp(body.v_template[:, 1]))
    return fit_clip(body, sightings, [], SmplxConfig(silhouette=0, height_m=height, **config), lambda *a: None)


def joint_error_mm(body: Body, fit, truth: BodyParams) -> float:
    found = to_params(body, fit.state, np.array([WIDTH / 2, HEIGHT / 2]))
    a, b = body.posed(found)[1][:, :22], body.posed(truth)[1][:, :22]
    return float(1e3 * np.linalg.norm((a - a[:, :1]) - (b - b[:, :1]), axis=-1).mean())


def test_hips_seen_too_high_in_every_frame_are_told_apart_from_the_pose(body, monkeypatch):
    truth = turn(body)
    fit = fitted(body, truth, {}, UP)
    moved = Detector.load("", body).own @ fit.state.own
    assert moved[INDEX["left_hip"], 1] > UP / 4 and moved[INDEX["left_hip"], 1] == moved[INDEX["right_hip"], 1]
    assert not fit.joint_offset.any()
    monkeypatch.setattr(detector_errors, "PERSONAL", {})
    assert joint_error_mm(body, fit, truth) < 0.9 * joint_error_mm(body, fitted(body, truth, {}, UP), truth)


def test_offsets_are_mirrored_and_the_middle_stays_in_the_middle():
    moves, spread = mirror_directions({"hip": (1, 0, 2), "neck": (5, 5, 5)}, {"left_hip": 0, "right_hip": 1, "neck": 2}, 3)
    assert np.allclose(spread, [0.001, 0.002, 0.005, 0.005])
    assert np.array_equal(moves @ [1, 2, 3, 4], [[1, 0, 2], [-1, 0, 2], [0, 3, 4]])


def test_joints_lie_off_the_shape_only_where_asked_and_alike_on_both_sides(body):
    truth = turn(body)
    truth.pose[3:7, 18:20, 1] = [-1.2, 1.2]
    offset = fitted(body, truth, {"joint_offsets": 0.02}).joint_offset
    left = [body.joint_names.index(f"left_{n}") for n in ("elbow", "wrist", "hip", "knee")]
    right = [body.joint_names.index(f"right_{n}") for n in ("elbow", "wrist", "hip", "knee")]
    assert np.abs(offset[left]).max() > 1e-4 and np.allclose(offset[left], offset[right] * [-1, 1, 1])
    others = [j for j, name in enumerate(body.joint_names) if not name.endswith(JOINTS)]
    assert not offset[others].any()
