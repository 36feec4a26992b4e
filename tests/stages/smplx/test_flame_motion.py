"""FLAME's expression in an SMPL-X body whose expressions mean something else."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from gsac.avatar import rotation
from gsac.avatar.artifacts import ArtifactError
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.flame_file import EXPRESSIONS, Flame, read_flame_ids
from gsac.avatar.joints import JAW, J
from gsac.avatar.joints import NAMES as JOINTS
from gsac.stages.contract import BadInput, Job, make_config
from gsac.stages.smplx import STAGE
from gsac.stages.smplx.flame_motion import JawedHead, read_shared, translate_flame

USED = 10
"""Expressions of either model."""


@pytest.fixture(scope="module")
def flame() -> Flame:
    """FLAME's shapes with random, smooth-less numbers: every vertex moves by a few mm a unit of expression."""
    rng = np.random.default_rng(5)
    template = rng.uniform(-0.1, 0.1, (5023, 3)).astype(np.float32)
    weights = np.zeros((5023, 5), np.float32)
    weights[:, 1] = 1
    weights[:1500, 2], weights[:1500, 1] = 0.8, 0.2
    regressor = np.zeros((5, 5023), np.float32)
    regressor[:, :7] = 1 / 7
    return Flame(template, np.zeros((9976, 3), np.int32), np.zeros((5023, 3, 300), np.float32),
                 rng.normal(0, 0.003, (5023, 3, EXPRESSIONS)).astype(np.float32), np.zeros((5023, 3, 36), np.float32), regressor,
                 weights, np.array([-1, 0, 1, 1, 1]))


@pytest.fixture(scope="module")
def ids() -> np.ndarray:
    return np.random.default_rng(6).permutation(6000)[:5023]


@pytest.fixture(scope="module")
def official(flame, ids) -> Body:
    """A body that holds FLAME's head among its vertices, scattered, and acts mixtures of its expressions."""
    rng = np.random.default_rng(7)
    count = 6000
    vertices, directions = rng.uniform(-1, 1, (count, 3)).astype(np.float32), np.zeros((count, 3, USED), np.float32)
    vertices[ids] = flame.v_template + [0, 1.5, 0]
    directions[ids] = flame.exprdirs[:, :, :USED] @ (np.eye(USED) + rng.normal(0, 0.4, (USED, USED)))
    weights, regressor = np.zeros((count, J), np.float32), np.zeros((J, count), np.float32)
    weights[:, 15] = 1
    weights[ids[:1500], JAW], weights[ids[:1500], 15] = 0.8, 0.2
    regressor[:, ids[:7]] = 1 / 7
    return Body(vertices, np.zeros((9, 3), np.int32), np.zeros((count, 3, 4), np.float32), directions, regressor, weights,
                np.arange(-1, J - 1), JOINTS, tuple(f"expression{i}" for i in range(USED)), (), np.zeros((USED, 3)),
                csr_matrix((133, count)), None, None, "made-up")


def test_the_shared_vertices_move_as_flame_moves_them_though_the_bases_are_mixed(flame, official, ids):
    rng = np.random.default_rng(8)
    expression = np.zeros((4, 50), np.float32)
    expression[:, :USED] = rng.normal(0, 1.5, (4, USED))
    jaw = np.array([[0, 0, 0], [0.35, 0, 0], [0.2, 0.1, 0.02], [0.05, -0.1, 0]], np.float32)
    found, turned = translate_flame(official, np.zeros(4), flame, ids, flame.v_template, expression, jaw)
    theirs, ours = JawedHead.of_flame(flame, flame.v_template, 50), JawedHead.of_body(official, np.zeros(4), ids)
    for t in range(4):
        wanted = theirs.moves(expression[t].astype(float), jaw[t].astype(float))
        off = np.linalg.norm(ours.moves(found[t].astype(float), turned[t].astype(float)) - wanted, axis=1)
        copied = np.linalg.norm(ours.moves(expression[t, :USED].astype(float), jaw[t].astype(float)) - wanted, axis=1)
        assert off.max() < 1e-3 < copied.max(), "m; copied by index it is wrong"
    np.testing.assert_allclose(turned, jaw, atol=1e-3)


def test_a_head_moves_as_the_whole_body_does(official, ids):
    rng = np.random.default_rng(9)
    head, expression, jaw = JawedHead.of_body(official, np.zeros(4), ids), rng.normal(0, 1, USED), np.array([0.3, 0.1, 0])
    vertices, joints = official.rest(np.zeros(4), expression)
    turn = rotation.exp(jaw)
    skinned = vertices + official.weights[:, JAW, None] * ((vertices - joints[JAW]) @ (turn - np.eye(3)).T)
    np.testing.assert_allclose(head.moves(expression, jaw), (skinned - official.v_template)[ids], atol=1e-6)


def test_a_head_takes_the_jaws_correctives_of_the_body_along(official, ids):
    posedirs, pose = np.zeros((len(official.v_template), 3, 486), np.float32), np.zeros((1, J, 3), np.float32)
    posedirs[ids, :, 9 * (JAW - 1):9 * JAW] = np.random.default_rng(11).normal(0, 0.003, (5023, 3, 9))
    pose[0, JAW] = 0.3, 0.1, 0
    bent = replace(official, posedirs=posedirs)
    posed = bent.posed(BodyParams.from_pose(pose, np.zeros((1, 3)), np.zeros(4), np.zeros((1, USED)), 500.0, (0, 0)))[0][0]
    moves = JawedHead.of_body(bent, np.zeros(4), ids).moves(np.zeros(USED), pose[0, JAW].astype(float))
    np.testing.assert_allclose(moves, (posed - official.v_template)[ids], atol=1e-5)


def test_the_slopes_are_those_of_the_moves(official, ids):
    rng = np.random.default_rng(10)
    head, at, step = JawedHead.of_body(official, np.zeros(4), ids).take(np.arange(50)), rng.normal(0, 0.3, USED + 3), 1e-5
    slopes = head.slopes(at[:-3], at[-3:])
    for k, axis in enumerate(np.eye(USED + 3) * step):
        near = (head.moves((at + axis)[:-3], (at + axis)[-3:]) - head.moves((at - axis)[:-3], (at - axis)[-3:])) / (2 * step)
        np.testing.assert_allclose(slopes[..., k], near, atol=2e-5)


def test_vertex_numbers_that_do_not_fit_are_refused_by_name(tmp_path, flame_file, body):
    np.save(tmp_path / "ids.npy", np.arange(5023))
    assert read_flame_ids(tmp_path / "ids.npy").shape == (5023,)
    np.save(tmp_path / "few.npy", np.arange(4000))
    with pytest.raises(ArtifactError, match=r"few.npy: expected 5023 vertex numbers, found int64 of shape \(4000,\)"):
        read_flame_ids(tmp_path / "few.npy")
    (tmp_path / "text.npy").write_text("no numbers")
    with pytest.raises(ArtifactError, match="text.npy: not a readable npy"):
        read_flame_ids(tmp_path / "text.npy")
    np.save(tmp_path / "high.npy", np.arange(5023) + 10**6)
    config = make_config(STAGE, {"flame": "flame", "body_model": "mine"})
    job = Job({}, tmp_path, config, {"flame": flame_file, "smplx-flame-ids": tmp_path / "high.npy"})
    with pytest.raises(BadInput, match="smplx.flame_ids is smplx-flame-ids: it names vertex 1005022, but the body model mine has"):
        read_shared(job, body)


def test_the_open_body_takes_no_flame_and_says_so(tmp_path, body):
    with pytest.raises(BadInput, match="smplx.flame is given, but smplx.body_model is open"):
        read_shared(Job({}, tmp_path, make_config(STAGE, {"flame": "flame"})), body)
    assert make_config(STAGE, {"flame": "f", "body_model": "mine"}).models() == ("mine", "f", "smplx-flame-ids")
