"""The fit against bodies whose pose is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsac.avatar import rotation
from gsac.avatar.body import Body, BodyParams
from gsac.stages.smplx.config import SmplxConfig
from gsac.stages.smplx.lm.fit import fit_clip
from gsac.stages.smplx.sightings import HIPS
from gsac.stages.smplx.state import to_params
from gsac.turntable.shell import drape
from support.turning_person import FOCAL, HEIGHT, WIDTH, height_of, joint_error_mm, outlines_of, sightings_of, turning_person


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
