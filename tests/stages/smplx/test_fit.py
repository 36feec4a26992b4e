"""The fit against finite differences and against bodies whose pose is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsac.avatar import rotation
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.camera import Camera
from gsac.avatar.zbuffer import silhouette
from gsac.stages.contract import BadInput, make_config
from gsac.stages.smplx import STAGE
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.detector import Detector
from gsac.stages.smplx.fit import BODY_POINTS, HIPS, Sightings, fit_clip, observations, to_params
from gsac.stages.smplx.jacobians import pairs_of, positions
from gsac.stages.smplx.lm.person_offsets import Personal
from gsac.stages.smplx.lm.problem import Problem, State
from gsac.stages.smplx.lm.solver import System
from gsac.stages.smplx.lm.stance import Held
from gsac.stages.smplx.prior import BODY_JOINTS
from gsac.stages.smplx.silhouette import Outline, outline_points, read_outline
from gsac.turntable.shell import drape

WIDTH, HEIGHT, FOCAL = 360, 640, 700.0


@pytest.fixture(scope="module")
def body() -> Body:
    return Body.load()


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


def sightings_of(body: Body, params: BodyParams, noise: float = 0.0, seconds: bool = True) -> Sightings:
    """Exact or noisy detections of a posed body."""
    vertices, _ = body.posed(params)
    points = body.keypoints(vertices)
    xy = params.camera(WIDTH, HEIGHT).project(points)
    xy = xy + np.random.default_rng(1).normal(0, noise, xy.shape)
    score = np.isfinite(xy).all(-1).astype(float)
    world = points - points[:, list(HIPS)].mean(1, keepdims=True)
    time = np.arange(params.frames) / 10 if seconds else None
    return Sightings(np.nan_to_num(xy), score, np.full(score.shape, max(noise, 0.5)), world, time, WIDTH, HEIGHT, FOCAL)


def outlines_of(body: Body, params: BodyParams, folder) -> list[Outline]:
    from gsac.avatar.artifacts import write_alpha

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


def test_a_clean_turn_is_recovered_to_millimetres(body, tmp_path):
    truth = turning_person(body, 12)
    seen = sightings_of(body, truth)
    fit = fit_clip(body, seen, outlines_of(body, truth, tmp_path), SmplxConfig(height_m=height_of(body, truth)), lambda *a: None)
    found = to_params(body, fit.state, np.array([WIDTH / 2, HEIGHT / 2]))
    error = joint_error_mm(body, found, truth)
    assert np.median(error) < 12 and error.mean() < 18
    assert np.nanmin(fit.iou) > 0.9


def test_clothes_that_the_outline_shows_are_worn_and_leave_the_joints_alone(body, tmp_path):
    bare = turning_person(body, 8)
    clothed = replace(bare, betas=bare.betas + 1.5 * (np.arange(body.num_betas) >= body.num_figure))
    outlines = outlines_of(body, clothed, tmp_path)
    found = {}
    for name, betas in (("with", body.num_betas), ("without", body.num_figure)):
        tailor = body if name == "with" else replace(body, clothes=(), shapedirs=body.shapedirs[:, :, :betas])
        fit = fit_clip(tailor, sightings_of(body, bare), outlines, SmplxConfig(height_m=height_of(body, bare)), lambda *a: None)
        params = to_params(tailor, fit.state, np.array([WIDTH / 2, HEIGHT / 2]))
        found[name] = np.nanmean(fit.iou), joint_error_mm(body, params, bare).mean(), params.betas[body.num_figure:]
    assert found["with"][0] > found["without"][0] + 0.01 and found["with"][1] < found["without"][1]
    trunk = [body.clothes.index(name) for name in ("chest", "belly", "thighs")]
    assert (found["with"][2][trunk] > 0.5).all()  # the prior alone gives 0.4


def test_a_shirt_that_hangs_over_the_waist_lifts_the_pelvis_less_than_without_a_waist_of_cloth(body, tmp_path):
    waist = body.num_figure + body.clothes.index("waist")
    other = replace(body, clothes=tuple(n for n in body.clothes if n != "waist"), shapedirs=np.delete(body.shapedirs, waist, 2))
    lifted = np.zeros(2)
    for seed in (2, 3):
        bare = turning_person(body, 12, seed)
        seen = sightings_of(body, bare)
        seen.score[:, HIPS] = 0  # the shirt hides them
        outlines = outlines_of(*in_a_shirt(body, bare), tmp_path)
        for i, tailor in enumerate((body, other)):
            fit = fit_clip(tailor, seen, outlines, SmplxConfig(height_m=height_of(body, bare)), lambda *a: None)
            found = to_params(tailor, fit.state, np.array([WIDTH / 2, HEIGHT / 2]))
            lifted[i] += pelvis_height(tailor, found) - pelvis_height(body, bare)
    assert 0 < lifted[0] < 0.8 * lifted[1]


def in_a_shirt(body: Body, bare: BodyParams) -> tuple[Body, BodyParams]:
    """Cloth that falls from the chest to the hips; joints stay where they are."""
    rest, joints = body.rest(bare.betas)
    trunk = (rest[:, 1] > 0.07) & (rest[:, 1] < 0.52) & (np.abs(rest[:, 0]) < 0.2)
    shirt = replace(body, v_template=body.v_template + drape(rest, trunk * np.clip((0.52 - rest[:, 1]) / 0.08, 0, 1)) - rest)
    return shirt, replace(bare, joint_offset=joints - shirt.rest(bare.betas)[1])


def pelvis_height(body: Body, params: BodyParams) -> float:
    """Metres above the ankles, mean over the frames."""
    joints = body.posed(params)[1]
    return float((joints[:, 7:9, 1].mean(1) - joints[:, 0, 1]).mean())


def height_of(body: Body, params: BodyParams) -> float:
    vertices, _ = body.rest(params.betas)
    return float(np.ptp(vertices[:, 1]))


@pytest.mark.parametrize("frames,seconds", [(1, True), (2, True), (4, False)])
def test_one_frame_two_frames_and_photos_without_times_are_fitted(body, tmp_path, frames, seconds):
    truth = turning_person(body, frames)
    seen = sightings_of(body, truth, seconds=seconds)
    fit = fit_clip(body, seen, outlines_of(body, truth, tmp_path), SmplxConfig(rounds=1), lambda *a: None)
    assert np.isfinite(rotation.log(fit.state.local)).all()
    assert np.median(fit.reprojection) < 3


def test_frames_in_which_nobody_was_seen_lie_between_their_neighbours(body, tmp_path):
    truth = turning_person(body, 10)
    seen = sightings_of(body, truth)
    seen.score[4:6] = 0
    seen.world[4:6] = np.nan
    fit = fit_clip(body, seen, outlines_of(body, truth, tmp_path), SmplxConfig(silhouette=0.0), lambda *a: None)
    found = to_params(body, fit.state, np.array([WIDTH / 2, HEIGHT / 2]))
    assert joint_error_mm(body, found, truth)[4:6].mean() < 120
    assert fit.sigma_joints[4:6, 7:9].mean() > fit.sigma_joints[:3, 7:9].mean()


def test_the_body_never_faces_the_wrong_way(body, tmp_path):
    truth = turning_person(body, 16, seed=3)
    seen = sightings_of(body, truth, noise=3.0)
    fit = fit_clip(body, seen, outlines_of(body, truth, tmp_path), SmplxConfig(rounds=1), lambda *a: None)
    front = fit.state.local[:, 0, :, 2]
    true_front = rotation.exp(truth.pose[:, 0].astype(float))[..., 2]
    assert (np.einsum("tc,tc->t", front, true_front) > np.cos(np.radians(25))).all()


def test_arms_that_reach_forward_are_not_left_hanging(body):
    """The fit begins with hanging arms, far from hands held before the chest."""
    truth = turning_person(body, 14)
    lift = np.clip(np.minimum(np.arange(14) - 2, 11 - np.arange(14)) / 2, 0, 1)
    pose = truth.pose.copy()
    pose[:, 0] = [np.pi, 0, 0]
    for shoulder, elbow, side in ((16, 18, -1), (17, 19, 1)):
        forward = Rotation.from_euler("y", side * 1.4 * lift[:, None])
        pose[:, shoulder] = (forward * Rotation.from_euler("z", side * (0.9 - 0.8 * lift)[:, None])).as_rotvec()
        pose[:, elbow] = np.stack([0 * lift, side * (0.3 + 1.2 * lift), 0 * lift], 1)
    truth = BodyParams.from_pose(pose, truth.transl, truth.betas, np.zeros((14, 52)), FOCAL, (WIDTH / 2, HEIGHT / 2))
    config = SmplxConfig(silhouette=0, height_m=height_of(body, truth))
    fit = fit_clip(body, sightings_of(body, truth), [], config, lambda *a: None)
    arms = joint_error_mm(body, to_params(body, fit.state, np.array([WIDTH / 2, HEIGHT / 2])), truth)[:, 18:22].mean(1)
    assert arms[4:10].max() < 250  # hanging: 400


def test_derivatives_agree_with_finite_differences(body, tmp_path):
    truth = turning_person(body, 3)
    outlines = outlines_of(body, truth, tmp_path)
    seen = observations(sightings_of(body, truth, 2.0), Detector.measured("", body), BODY_POINTS,
                        np.array([WIDTH / 2, HEIGHT / 2]), (FOCAL, 0.1), SmplxConfig(height_m=1.8), outlines)
    detector = Detector.measured("mediapipe", body)
    personal = Personal.of(body, detector.own, 0.01)
    moves = np.concatenate([detector.slopes(body), personal.points], 2)[BODY_POINTS]
    pairs = pairs_of(body, body.keypoint_matrix[BODY_POINTS], None, moves)
    rng = np.random.default_rng(0)
    state = State(rotation.exp(truth.pose.astype(float) + rng.normal(0, 0.05, truth.pose.shape)),
                  truth.transl.astype(float) + 0.02, np.append(rng.normal(0, 0.3, body.num_figure), np.zeros(len(body.clothes))),
                  float(np.log(FOCAL)), np.zeros(0), np.zeros(len(personal.spread)))
    problem = Problem(body, pairs, HIPS, seen, BODY_JOINTS, 1.0, 0.0, personal)
    camera = Camera((FOCAL, FOCAL), (WIDTH / 2, HEIGHT / 2), WIDTH, HEIGHT)
    chain = problem.skeleton.pose(state.local, state.shape)
    surface = pairs_of(body, body.keypoint_matrix[BODY_POINTS])
    x = positions(chain, surface, state.shape)[0] + state.transl[0]
    vertices, _ = body.posed(to_params(body, state, problem.seen.center), [0])
    assert np.allclose(x, body.keypoints(vertices)[0][BODY_POINTS], atol=2e-3)
    state.betas[body.num_figure:] = rng.normal(0, 1, len(body.clothes))
    assert np.allclose(positions(problem.skeleton.pose(state.local, state.shape), surface, state.shape)[0] + state.transl[0], x,
                       atol=1e-3)
    state.own[:] = rng.normal(0, 1, len(state.own)) * personal.spread
    for t, outline in enumerate(outlines):
        vertices, _ = body.posed(to_params(body, state, problem.seen.center), [t])
        problem.outline_pairs[t] = outline_points(body, vertices[0], camera, outline, t)[0]
    check_gradient(problem, state, rng, 1e-5, 2e-3)
    problem.outline_weight = 1.0
    # the distance field is sampled to 1/32 pixel, so its slope shows only over longer steps
    check_gradient(problem, state, rng, 3e-3, 0.08)


def check_gradient(problem: Problem, state: State, rng, h: float, tolerance: float) -> None:
    """Half the cost's slope along random directions is the system's gradient (exact where no point is an outlier)."""
    import gsac.stages.smplx.lm.problem as module

    robust = module.robust
    module.robust = lambda residual, limit: (residual**2, np.ones_like(residual))
    try:
        system = problem.linearise(state)
        for _ in range(4):
            step = rng.normal(0, 1, (len(state.local), problem.size))
            shared = rng.normal(0, 1, 1 + len(state.shape) + len(state.held) + len(state.level)) * 0.3
            shared[1 + len(state.betas): 1 + len(state.shape)] *= 0.03  # mostly metres
            slope = (problem.cost(problem.move(state, h * step, h * shared))
                     - problem.cost(problem.move(state, -h * step, -h * shared))) / (2 * h)
            expected = 2 * ((system.gradient * step).sum() + system.shared_gradient @ shared)
            assert slope == pytest.approx(expected, rel=tolerance)
    finally:
        module.robust = robust


def test_derivatives_of_what_is_held_agree_with_finite_differences(body):
    """Gradient and, as these residuals have no outliers and hardly bend, the normal equations too."""
    truth = turning_person(body, 4)
    local = rotation.exp(truth.pose[:, :22].astype(float) + np.random.default_rng(2).normal(0, 0.05, (4, 22, 3)))
    held = Held(BODY_JOINTS)
    value = held.learn(local, np.zeros(68)) + np.random.default_rng(3).normal(0, 0.05, 68)
    system = System.zeros(4, 69, 17 + 68)
    held.add(system, local, rotation.log(local), value, 17)

    def residual(step: np.ndarray, shared: np.ndarray) -> np.ndarray:
        moved = local @ rotation.exp(step)
        return held.residual(moved, rotation.log(moved), value + shared).ravel()

    steps = np.concatenate([np.eye(4 * 66).reshape(-1, 4, 22, 3), np.zeros((68, 4, 22, 3))])
    shared = np.concatenate([np.zeros((4 * 66, 68)), np.eye(68)])
    columns = [(residual(1e-5 * a, 1e-5 * b) - residual(-1e-5 * a, -1e-5 * b)) / 2e-5 for a, b in zip(steps, shared, strict=True)]
    jacobian = np.stack(columns, 1)
    frames, clip = np.split(jacobian.T @ residual(0 * steps[0], 0 * shared[0]), [4 * 66])
    assert np.allclose(system.gradient[:, :66].ravel(), frames, atol=1e-4)
    assert np.allclose(system.shared_gradient[17:], clip, atol=1e-4)
    normal = jacobian.T @ jacobian
    assert np.allclose(system.shared[17:, 17:], normal[4 * 66:, 4 * 66:], atol=1e-3)
    for t in range(4):
        own = slice(66 * t, 66 * t + 66)
        assert np.allclose(system.band[t, :66, :66], normal[own, own], atol=1e-3)
        assert np.allclose(system.arrow[t, :66, 17:], normal[own, 4 * 66:], atol=1e-3)


def test_who_turns_is_held_and_who_moves_is_let_go(body):
    turning = rotation.exp(turning_person(body, 20).pose[:, :22].astype(float))
    squatting = rotation.exp(np.zeros((20, 22, 3)) + np.eye(22)[[1, 2, 4, 5]].sum(0)[:, None] * [1, 0, 0]
                             * np.linspace(0, 1.6, 20)[:, None, None])
    waving = turning.copy()
    waving[:, 16] = rotation.exp(np.linspace(-1, 1, 20)[:, None] * [0.0, 0, 1])
    held = Held(BODY_JOINTS)
    finite = {}
    for name, local in (("turning", turning), ("squatting", squatting), ("waving", waving)):
        held.learn(local, np.zeros(68))
        finite[name] = np.isfinite(held.spread).any(1)
    assert finite["turning"].all() and not finite["squatting"].any()
    assert not finite["waving"][[13, 16, 18, 20]].any() and finite["waving"][[1, 4, 14, 17]].all()


@pytest.mark.parametrize("values,name", [({"method": "magic"}, "smplx.method"), ({"height_m": 17.0}, "smplx.height_m"),
                                         ({"focal_px": -1.0}, "smplx.focal_px"), ({"rounds": 0}, "smplx.rounds"),
                                         ({"joint_offsets": -0.1}, "smplx.joint_offsets"),
                                         ({"betas": 3}, "smplx.betas")])
def test_a_wrong_parameter_is_named(values, name):
    with pytest.raises(BadInput, match=name):
        make_config(STAGE, values)
