"""Scores of a fitted body: each error shows in its own number only."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.body import Body, BodyParams
from gsac.avatar.zbuffer import silhouette
from gsac.benchmarks.fit.score import joint_distances, score
from gsac.benchmarks.fit.truth import Truth, read_truth

TRUTH_A = Path(__file__).parents[2] / ".." / "shared" / "footage" / "truth-a"
SIZE = (90, 160)


@pytest.fixture(scope="module")
def body():
    return Body.load()


@pytest.fixture(scope="module")
def params(body):
    pose = np.zeros((4, 55, 3))
    pose[:, 0, 0] = np.pi
    pose[:, 16, 2] = -0.9 + 0.05 * np.arange(4) ** 2
    transl = np.tile([0, 0.9, 3.5], (4, 1)) + np.linspace(0, 0.1, 4)[:, None]
    return BodyParams.from_pose(pose, transl, np.zeros(body.num_betas), np.zeros((4, 52)), 180.0, (45.0, 80.0))


@pytest.fixture(scope="module")
def truth(body, params):
    vertices, joints = body.posed(params)
    camera = params.camera(*SIZE)
    masks = np.stack([silhouette(v, body.faces, camera) for v in vertices])
    points = camera.project(body.keypoints(vertices)[:, :23])
    return Truth(np.arange(22), joints[:, :22], vertices, points, 180.0, (45.0, 80.0), masks)


def test_the_truth_itself_has_no_error(body, params, truth):
    got = score(body, params, truth)
    assert got["joints_mean_mm"] < 1e-3 and got["vertices_mean_mm"] < 1e-3 and got["reprojection_px"] < 1e-3
    assert got["iou_worst"] == got["iou_of_truth"] == 1
    assert got["acceleration_ratio"] == pytest.approx(1, abs=1e-6) and got["focal_error"] == 0


def test_distance_and_one_scale_of_the_clip_do_not_count_as_joint_error(body, params, truth):
    far = dataclasses.replace(truth, joints=1.1 * truth.joints + [0.2, 0.1, 0.5], vertices=1.1 * truth.vertices)
    got = score(body, params, far)
    assert got["joints_mean_mm"] < 1e-3 and got["scale"] == pytest.approx(1.1)
    assert got["joints_metric_mm"] > 20


def test_clothes_count_on_the_surface_and_not_on_the_skin(body, params, truth):
    betas = params.betas.copy()
    betas[body.num_figure:] = 1
    got = score(body, dataclasses.replace(params, betas=betas), truth)
    assert got["vertices_mean_mm"] > 3 and got["skin_mean_mm"] < 1e-3


def test_a_wrong_joint_is_measured_in_millimetres(body, params, truth):
    moved = truth.joints.copy()
    moved[:, 20] += [0, 0.03, 0]
    off = joint_distances(body, params, dataclasses.replace(truth, joints=moved)).mean(0)
    assert np.argmax(off) == list(truth.joint).index(20) and off.max() == pytest.approx(30, abs=3)


def test_shaking_raises_the_acceleration(body, params, truth):
    shaking = dataclasses.replace(params, global_orient=params.global_orient + 0.02 * np.array([1, -1, 1, -1])[:, None])
    got = score(body, shaking, truth)
    assert got["acceleration_ratio"] > 2 and got["acceleration_error_ratio"] > 2


def test_a_wrong_focal_length_is_a_share(body, params, truth):
    assert score(body, dataclasses.replace(params, focal=np.full(2, 198.0)), truth)["focal_error"] == pytest.approx(0.1)


@pytest.mark.footage
def test_the_other_rigs_truth_names_the_same_joints(body):
    if not TRUTH_A.is_dir():
        pytest.skip("no footage")
    truth = read_truth(TRUTH_A)
    names = [body.joint_names[j] for j in truth.joint]
    assert names == list(body.joint_names[:22])
    assert truth.joints.shape == (60, 22, 3) and truth.keypoints.shape == (60, 23, 2)
    head, foot = truth.joints[:, names.index("head"), 1], truth.joints[:, names.index("left_ankle"), 1]
    assert (foot - head > 1).all()
