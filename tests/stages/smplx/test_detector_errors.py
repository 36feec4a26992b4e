"""What is measured of a detector, and that the fit takes it off."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from gsac.avatar import rotation
from gsac.avatar.artifacts import read_arrays, write_arrays
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.wholebody import INDEX
from gsac.avatar.yaw import yaw as turn_yaw
from gsac.pipeline.model_check import check_model
from gsac.stages.contract import BadInput, Job
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.detector_errors import HARMONICS, PERSONAL, Detector, find_errors, harmonics
from support.scripts import script

detector_offsets = script("detector_offsets")

WRIST, OTHER = INDEX["left_wrist"], INDEX["right_wrist"]


def turn(frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Poses (T, 55, 3) of one turn, upright before the camera, and the yaw (T,)."""
    yaw = np.linspace(-np.pi, np.pi, frames, endpoint=False)
    pose = np.zeros((frames, 55, 3))
    turned = np.stack([[[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]] for a in yaw])
    pose[:, 0] = rotation.log(np.diag([1.0, -1, -1]) @ turned)
    return pose, yaw


def sight(body: Body, offset: np.ndarray, habit: np.ndarray) -> detector_offsets.SeenClip:
    """One turn as a detector with this offset (3,) m and habit (2 H + 1, 2) at the left wrist, mirrored at the right, sees it."""
    pose, _ = turn(48)
    still = np.zeros((48, 52))
    params = BodyParams.from_pose(pose, np.tile([0, 0, 3.0], (48, 1)), np.zeros(body.num_betas), still, 900.0, (360, 640))
    points = body.keypoints(body.posed(params)[0])
    turns = detector_offsets.chain_rotations(body, params.pose)
    yaw = turn_yaw(turns[:, 0])
    moved = points.astype(float).copy()
    for point, joint, sign in ((WRIST, 20, 1), (OTHER, 21, -1)):
        moved[:, point] += np.einsum("tab,b->ta", turns[:, joint], offset * [sign, 1, 1])
    moved, points = np.nan_to_num(moved, nan=1.0), np.nan_to_num(points.astype(float), nan=1.0)
    xy = 900.0 * moved[..., :2] / moved[..., 2:] + [360, 640]
    xy[:, WRIST] += 500.0 * harmonics(yaw) @ habit
    xy[:, OTHER] += 500.0 * harmonics(-yaw) @ habit * [-1, 1]
    known = np.tile(body.known_keypoints, (48, 1))
    return detector_offsets.SeenClip(xy, known, 500.0, points, turns, 900.0, np.array([360.0, 640.0]), np.zeros(body.num_figure))


def test_a_planted_offset_is_found_and_other_points_keep_theirs(body):
    planted = np.array([0.02, -0.01, 0.03])
    offsets, quality = detector_offsets.measure_offsets(body, [sight(body, planted, np.zeros((2 * HARMONICS + 1, 2)))])
    assert np.allclose(offsets[WRIST], planted, atol=2e-3)
    assert np.allclose(offsets[OTHER], planted * [-1, 1, 1], atol=2e-3)
    assert np.abs(offsets[INDEX["left_knee"]]).max() < 1e-3
    assert quality[WRIST, 1] < 0.2 * quality[WRIST, 0]


def test_a_planted_habit_is_found_on_both_sides_and_adds_nothing_elsewhere(body):
    planted = np.zeros((2 * HARMONICS + 1, 2))
    planted[[0, 1, 5], [1, 0, 1]] = 0.01, 0.02, -0.015
    seen = sight(body, np.zeros(3), planted)
    habit, spread = detector_offsets.measure_habits(body, [seen], np.zeros((133, 3)))
    assert np.allclose(habit[WRIST], planted, atol=1.5e-3)
    assert np.abs(habit[INDEX["left_knee"]]).max() < 1e-6
    found = Detector(np.zeros((133, 3)), None, None, habit, spread).error(turn_yaw(seen.turn[:, 0])) * seen.height
    true = seen.xy - seen.project(seen.points)
    assert np.abs(found - true)[:, [WRIST, OTHER]].max() < 1.0


def test_a_persons_own_offset_is_found_beside_what_all_share(body):
    shared, own = np.array([0.02, -0.01, 0.03]), np.array([0.005, 0.012, -0.006])
    offsets = np.zeros((133, 3))
    offsets[[WRIST, OTHER]] = shared, shared * [-1, 1, 1]
    habit = np.zeros((133, 2 * HARMONICS + 1, 2))
    found = detector_offsets.measure_own_offsets(body, sight(body, shared + own, habit[WRIST]), offsets, habit)
    wrist = list(PERSONAL).index("wrist")
    assert np.allclose(found[wrist], own, atol=1e-3)
    assert np.abs(np.delete(found, wrist, 0)).max() < 1e-3


def test_offsets_that_follow_the_figure_are_told_from_those_that_do_not(body):
    rng = np.random.default_rng(0)
    figures, by = rng.normal(0, 1, (400, body.num_figure)), rng.normal(0, 0.004, (len(PERSONAL), 3, body.num_figure))
    common, alone = rng.normal(0, 0.01, (len(PERSONAL), 3)), rng.normal(0, 1, (len(PERSONAL), 3))
    alone *= 0.02 / np.linalg.norm(alone)
    people = common + np.einsum("pcf,nf->npc", by, figures) + rng.normal(0, 1, (400, 1, 1)) * alone
    shared, by_betas, directions = detector_offsets.measure_people(figures, people)
    left, right = ([INDEX[f"{side}_{n}"] for n in PERSONAL] for side in ("left", "right"))
    assert np.allclose(shared[left], common, atol=2e-3) and np.allclose(by_betas[left], by, atol=1e-3)
    assert np.array_equal(by_betas[right], by_betas[left] * np.array([-1, 1, 1])[:, None])
    assert directions.shape == (133, 3, 1)
    assert np.allclose(np.abs(directions[left, :, 0]), np.abs(alone), atol=2e-3)


def test_the_figure_of_a_person_beyond_the_basis_is_the_nearest_one(body):
    rng = np.random.default_rng(0)
    betas = rng.normal(0, 1, body.num_figure)
    shift = (body.shapedirs[:, :, : body.num_figure] @ betas).astype(float) + rng.normal(0, 1e-4, body.v_template.shape)
    moved = np.array([[0.01, 0.02, 0.0]])
    found = detector_offsets.fit_figure(body, {"betas": betas, "shift": shift + moved, "joint_offset": moved})
    assert np.allclose(found, 2 * betas, atol=0.02)


def test_what_is_kept_was_measured_on_the_embedded_body_and_is_mirror_symmetric(body):
    kept = Detector.load("mediapipe", body)
    other = detector_offsets.find_counterparts()
    assert np.abs(kept.offsets).max() > 0.005
    paired = other != np.arange(133)
    assert np.allclose(kept.offsets[paired], kept.offsets[other][paired] * [-1, 1, 1], atol=1e-6)
    for moves in (kept.by_betas, kept.own):
        assert moves.any() and np.allclose(moves[paired], moves[other][paired] * np.array([-1, 1, 1])[:, None], atol=1e-6)
    yaw = np.linspace(0, 6, 9)
    assert np.allclose(kept.error(yaw)[:, 5:17], kept.error(-yaw)[:, other[5:17]] * [-1, 1], atol=1e-5)
    assert (kept.spread > 0).all() and (kept.spread < 0.02).all()


def test_an_unknown_detector_has_no_habits(body):
    unknown = Detector.load("someone-else", body)
    assert not unknown.offsets.any() and not unknown.habit.any() and (unknown.spread > 0).all()
    assert not unknown.slopes(body).any() and unknown.own.any()


@pytest.fixture
def brought(tmp_path, body):
    """Errors of a detector that nobody knows, 10 cm along x at each point."""
    kept = Detector.load("someone-else", body)
    kept.offsets[:, 0] = 0.1
    write_arrays(tmp_path / "mine.npz", **{f.name: getattr(kept, f.name) for f in fields(kept)}, model=np.array(body.digest))
    return tmp_path / "mine.npz"


def job_of(path: Path, name: str = "mine") -> Job:
    return Job({}, Path(), SmplxConfig(detector_offsets=name), {"mine": path})


def test_errors_that_the_user_measured_are_those_of_the_fit(body, brought):
    assert SmplxConfig(detector_offsets="mine").models() == ("mine",) and SmplxConfig().models() == ()
    check_model("mine", brought)
    kept = Detector.load(find_errors(job_of(brought), body, "mediapipe"), body)
    assert np.allclose(kept.offsets, [0.1, 0, 0]) and kept.own.any()
    assert find_errors(job_of(brought, "none"), body, "mediapipe") == "mediapipe"


def test_errors_measured_on_another_body_or_of_other_shapes_are_refused(body, brought):
    arrays = read_arrays(brought)
    write_arrays(brought, **arrays | {"model": np.array("0" * 64)})
    with pytest.raises(BadInput, match="smplx.detector_offsets is mine: it was measured on the body 0000"):
        find_errors(job_of(brought), body, "mediapipe")
    write_arrays(brought, **arrays | {"spread": np.zeros(17)})
    with pytest.raises(BadInput, match=r"array spread has shape \(17,\), expected \(133,\); it was not added as mine"):
        check_model("mine", brought)
