"""The published co-registration: its terms, and that it fits."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from gsac.avatar import rotation
from gsac.avatar.body import SMPLX_JOINTS, Body, BodyParams
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.initial import estimate_start
from gsac.stages.smplx.paper.fit import BATCH, PASSES, Pass, fit_clip
from gsac.stages.smplx.paper.head import Head, HeadTerms, faces_camera
from gsac.stages.smplx.paper.kinematics import Kinematics, Mesh, Points, to_matrices, to_six, to_vectors
from gsac.stages.smplx.paper.loss import Objective, Unknowns, box_person
from gsac.stages.smplx.paper.smooth import smooth_linear, smooth_rotations
from gsac.stages.smplx.sightings import HIPS, Sightings

pytestmark = pytest.mark.slow

WIDTH, HEIGHT, FOCAL = 360, 640, 700.0
SHORT = (Pass(60, 0.1, (30, 50), 20, True), Pass(20, 0.01, (10,), 0, True), Pass(10, 0.01, (5,), 0, False))


@pytest.fixture(scope="module")
def body() -> Body:
    return Body.load()


def person(body: Body, frames: int = 4) -> BodyParams:
    pose = np.zeros((frames, 55, 3))
    yaw = np.linspace(0, 1, frames)
    turn = rotation.exp(np.array([np.pi, 0, 0])) @ rotation.exp(np.stack([0 * yaw, yaw, 0 * yaw], 1))
    pose[:, 0] = rotation.log(turn)
    pose[:, 16, 2], pose[:, 17, 2], pose[:, 18, 1] = -1.1, 0.7, -0.6
    betas = np.append(np.random.default_rng(0).normal(0, 0.5, body.num_figure), np.zeros(len(body.clothes)))
    transl = np.tile([0.05, 0, 2.4], (frames, 1))
    return BodyParams.from_pose(pose, transl, betas, np.zeros((frames, 52)), FOCAL, (WIDTH / 2, HEIGHT / 2))


def sightings_of(body: Body, params: BodyParams, seconds: bool = False, face: dict | None = None) -> Sightings:
    points = body.keypoints(body.posed(params)[0])
    xy = params.camera(WIDTH, HEIGHT).project(points)
    score = np.isfinite(xy).all(-1).astype(float)
    world = points - points[:, list(HIPS)].mean(1, keepdims=True)
    time = np.arange(params.frames) / 10 if seconds else None
    return Sightings(np.nan_to_num(xy), score, np.full(score.shape, 1.0), world, time, WIDTH, HEIGHT, FOCAL, face=face)


@pytest.fixture(scope="module")
def fitted(body):
    told = []
    sightings = sightings_of(body, person(body))
    fit = fit_clip(body, sightings, [], SmplxConfig(method="paper"), lambda *done: told.append(done), SHORT)
    return sightings, fit, told


def test_the_schedule_is_the_published_one():
    passes = [(p.steps, p.rate, p.warm_up, p.shared) for p in PASSES]
    assert passes == [(500, 0.1, 100, True), (250, 0.01, 0, True), (250, 0.01, 0, False)]
    assert PASSES[0].decays == (100, 250, 400) and BATCH == 64


def test_every_method_that_can_be_chosen_is_there():
    from gsac.stages.smplx import config, stage

    assert tuple(stage.METHODS) == config.METHODS


def test_six_numbers_and_rotations_say_the_same():
    turns = rotation.exp(np.random.default_rng(1).normal(0, 0.7, (20, 3)))
    tensor = torch.tensor(turns)
    torch.testing.assert_close(to_matrices(3 * to_six(tensor)), tensor)
    np.testing.assert_allclose(to_vectors(tensor).numpy(), rotation.log(turns), atol=1e-5)


def test_points_lie_where_the_posed_body_has_them(body):
    params = person(body)
    params.joint_offset = np.random.default_rng(2).normal(0, 0.01, (55, 3)).astype(np.float32)
    vertices, joints = body.posed(params)
    known = np.flatnonzero(body.known_keypoints)
    chain, points = Kinematics(body), Points(body, body.keypoint_matrix[known])
    betas = torch.tensor(params.betas)
    rest = chain.joints(betas, torch.tensor(params.joint_offset))
    local = torch.tensor(rotation.exp(params.pose.astype(np.float64)), dtype=torch.float32)
    world, place = chain.pose(local, rest)
    transl = params.transl[:, None]
    np.testing.assert_allclose(place.numpy() + transl, joints, atol=1e-5)
    np.testing.assert_allclose(points.at(world, place, rest, betas).numpy() + transl, body.keypoints(vertices)[:, known], atol=1e-5)


def test_every_vertex_lies_where_the_posed_body_has_it(body):
    """The term that holds the mesh to the start looks at all of them."""
    params = person(body)
    params.transl[:] = 0
    betas, local = torch.tensor(params.betas), torch.tensor(rotation.exp(params.pose.astype(np.float64)), dtype=torch.float32)
    kinematics = Kinematics(body)
    rest = kinematics.joints(betas, torch.zeros(55, 3))
    found = Mesh(body).at(*kinematics.pose(local, rest), rest, betas)
    np.testing.assert_allclose(found.numpy().transpose(0, 2, 1), body.posed(params)[0], atol=1e-5)


def test_a_short_descent_lowers_the_reprojection(body, fitted):
    sightings, fit, told = fitted
    start = estimate_start(body, sightings, FOCAL, np.array([WIDTH / 2, HEIGHT / 2]))
    objective = Objective(body, sightings, start, np.array([WIDTH / 2, HEIGHT / 2]))
    before = objective.pixels(start.local, start.transl, start.betas, np.zeros((55, 3))) - sightings.xy[:, objective.known]
    assert np.median(fit.reprojection) < 0.5 * np.median(np.linalg.norm(before, axis=-1))
    assert told[-1] == (90, 90, "steps") and fit.steps == 90
    assert np.isfinite(fit.sigma_joints).all()


def test_pelvis_and_hips_never_move_and_all_other_joints_may(fitted):
    offset = fitted[1].joint_offset
    assert not offset[:3].any()
    assert (np.abs(offset[3:22]).max(1) > 0).all() and np.abs(offset).max() < 0.1


def test_joint_offsets_of_both_sides_are_drawn_together(body):
    sightings = sightings_of(body, person(body))
    center = np.array([WIDTH / 2, HEIGHT / 2])
    objective = Objective(body, sightings, estimate_start(body, sightings, FOCAL, center), center)
    unknowns = Unknowns(objective.start, torch.tensor([[0, 0, 2.4]] * 4), body.num_betas)
    losses = []
    for right in (torch.tensor([-0.01, 0.02, 0.0]), torch.tensor([0.01, 0.02, 0.0])):
        unknowns.joint_offset[18], unknowns.joint_offset[19] = torch.tensor([0.01, 0.02, 0.0]), right
        list(unknowns.open_batch(slice(0, 4), True, False))
        objective.target = objective.project(moved(objective, unknowns), slice(0, 4)).detach()
        losses.append(float(objective.loss(unknowns, slice(0, 4), 1.0).detach()))
    assert losses[0] + 0.02 / 24 / 3 == pytest.approx(losses[1], abs=2e-6)
    pairs = {(SMPLX_JOINTS[a], SMPLX_JOINTS[b]) for a, b in zip(objective.left, objective.right, strict=True)}
    assert ("left_wrist", "right_wrist") in pairs and len(pairs) == 24


def moved(objective, unknowns):
    rest = objective.kinematics.joints(unknowns.betas, unknowns.offsets())
    world, place = objective.kinematics.pose(unknowns.local(slice(0, 4)), rest)
    return objective.points.at(world, place, rest, unknowns.betas) + unknowns.batch[3][:, None]


def test_the_farther_of_two_hands_that_lie_on_each_other_does_not_count(body):
    sightings = sightings_of(body, person(body))
    center = np.array([WIDTH / 2, HEIGHT / 2])
    objective = Objective(body, sightings, estimate_start(body, sightings, FOCAL, center), center)
    n = len(objective.known)
    x, uv = torch.zeros(1, n, 3), torch.rand(1, n, 2)
    left, right = objective.hands
    uv[0, right] = uv[0, left]
    x[0, left, 2], x[0, right, 2] = 2.0, 2.3
    count = objective._weigh_points(x, uv, slice(0, 1))[0]
    assert not count[right].any() and count[objective.wrists[1]] == 0
    assert count.sum() == n - len(right) - 1
    uv[0, right] += 5
    assert objective._weigh_points(x, uv, slice(0, 1)).all()


def test_the_square_holds_the_person_at_any_resolution(body):
    sightings = sightings_of(body, person(body))
    corner, side = box_person(sightings)
    xy = sightings.xy[0][sightings.seen[0]]
    at = (xy - corner[0]) / side[0]
    assert at.min() == pytest.approx((1 - 1 / 1.5) / 2, abs=1e-5) and at.max() == pytest.approx(1 - (1 - 1 / 1.5) / 2, abs=1e-5)


def head_of(body: Body, betas: np.ndarray) -> dict:
    """The body's own head as face.npz would bring it, somewhere else."""
    index = np.flatnonzero(body.weights[:, [15, 23, 24]].sum(1) > 0.5)
    place = np.full(len(body.v_template), -1)
    place[index] = np.arange(len(index))
    faces = place[body.faces]
    vertices = body.rest(betas)[0]
    return {"valid": np.ones(4, bool), "head_template": body.v_template[index] + 0.3, "head_vertices": vertices[index] - 0.2,
            "head_faces": faces[(faces >= 0).all(1)], "head_eyes": body.J_regressor[[23, 24]] @ body.v_template + 0.3}


def test_face_terms_vanish_at_the_same_head_and_lead_towards_it(body):
    betas = np.random.default_rng(3).normal(0, 1, body.num_betas).astype(np.float32)
    terms = HeadTerms(body, Head.from_arrays(head_of(body, betas), body))
    none, half = (torch.tensor(betas * share, requires_grad=True) for share in (0.0, 0.5))
    terms.loss(half).backward()
    here, midway, there = (float(terms.loss(b.detach())) for b in (torch.tensor(betas), half, none))
    assert here < 0.1 * there and here < midway < there
    assert float((half.grad * torch.tensor(betas)).sum()) < 0


def test_the_face_terms_draw_the_fitted_head_towards_the_one_that_face_found(body, fitted):
    """The same clip without a head mesh leaves the head to the key points."""
    betas = np.append(np.random.default_rng(5).normal(0, 1.5, body.num_figure), np.zeros(len(body.clothes)))
    arrays = head_of(body, betas)
    terms = HeadTerms(body, Head.from_arrays(arrays, body))
    told = fit_clip(body, sightings_of(body, person(body), face=arrays), [], SmplxConfig(method="paper"), lambda *done: None, SHORT)
    with_head, without = (float(terms.loss(torch.tensor(fit.state.betas, dtype=torch.float32))) for fit in (told, fitted[1]))
    assert with_head < 0.5 * without


def test_the_face_counts_only_when_it_looks_at_the_camera(body):
    yaw = np.radians([0, 30, 60, 90, 180, 270, 330])
    pose = np.zeros((len(yaw), 55, 3))
    pose[:, 0] = rotation.log(rotation.exp(np.array([np.pi, 0, 0])) @ rotation.exp(np.stack([0 * yaw, yaw, 0 * yaw], 1)))
    transl = np.tile([0, 0, 3.0], (len(yaw), 1))
    params = BodyParams.from_pose(pose, transl, np.zeros(20), np.zeros((len(yaw), 52)), FOCAL, (180, 320))
    seen = faces_camera(body.keypoints(body.posed(params)[0]))
    assert seen.tolist() == [True, True, False, False, False, False, True]


def test_without_a_head_mesh_the_fit_says_that_face_terms_are_off(body, fitted):
    assert any("face terms" in note for note in fitted[1].notes)
    sightings = sightings_of(body, person(body), face=head_of(body, np.zeros(body.num_betas)))
    tiny = (Pass(2, 0.1, (1,), 1, True),)
    fit = fit_clip(body, sightings, [], SmplxConfig(method="paper"), lambda *done: None, tiny)
    assert not any("face terms" in note for note in fit.notes)


def test_smoothing_keeps_a_steady_turn_and_takes_out_shaking():
    yaw = np.linspace(0, 2 * np.pi, 40)
    steady = rotation.exp(np.stack([0 * yaw, yaw, 0 * yaw], 1))[:, None]
    np.testing.assert_allclose(smooth_rotations(steady)[5:-5], steady[5:-5], atol=1e-3)
    shaken = steady @ rotation.exp(np.random.default_rng(4).normal(0, 0.05, (40, 1, 3)))
    back = np.swapaxes(steady, -1, -2)
    off = [np.linalg.norm(rotation.log(back @ r), axis=-1).mean() for r in (shaken, smooth_rotations(shaken))]
    assert off[1] < 0.7 * off[0]
    assert smooth_linear(np.ones((5, 3))).shape == (5, 3)


@pytest.mark.parametrize("frames", [1, 65])
def test_one_photo_and_more_frames_than_a_batch_are_fitted(body, frames):
    told = []
    sightings = sightings_of(body, person(body, frames), seconds=frames > 1)
    sightings.score[0, 20:] = 0
    if frames > 1:
        sightings.score[30], sightings.xy[30] = 0, np.nan
    tiny = (Pass(8, 0.1, (4,), 4, True), Pass(2, 0.01, (1,), 0, False))
    fit = fit_clip(body, sightings, [], SmplxConfig(method="paper"), lambda *done: told.append(done), tiny)
    steps = 10 * -(-frames // BATCH)
    assert told[-1] == (steps, steps, "steps")
    assert all(np.isfinite(a).all() for a in (fit.state.local, fit.state.transl, fit.state.betas, fit.sigma_joints))
    turned = fit.state.local[:, 0] @ np.swapaxes(fit.state.local[:, 0], -1, -2)
    np.testing.assert_allclose(turned, np.tile(np.eye(3), (frames, 1, 1)), atol=1e-5)
