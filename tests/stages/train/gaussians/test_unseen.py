"""Gaussians that no frame shows, and what the avatar looks like in poses that no frame has."""

from dataclasses import replace

import numpy as np
import pytest

from gsac.avatar.binding import face_frames
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.camera import Camera
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.raster import render_bound
from gsac.avatar.threads import Workspace
from gsac.stages.train.fast.initial_gaussians import centres_at_rest
from gsac.stages.train.gaussians import heights, shown, unseen
from gsac.stages.train.gaussians.merge import merge_to_size
from gsac.stages.train.judge import heldout, novel_poses
from gsac.stages.train.poses.poses import Poses


@pytest.fixture(scope="module")
def body():
    return Body.load()


def at_rest(body):
    """Frames of its faces."""
    return face_frames(body.v_template, body.faces)


def covering(body, count=4000):
    gaussians = Gaussians.area(body.v_template, body.faces, count, 0)
    return gaussians, centres_at_rest(gaussians, body.v_template, body.faces)


def standing(body):
    """Vertices before a camera that looks at the front."""
    middle = (body.v_template.min(0) + body.v_template.max(0)) / 2
    vertices = (body.v_template - middle) @ np.diag([1.0, -1.0, -1.0]) + [0, 0, 4.0]
    return np.float32(vertices), Camera((300.0, 300.0), (110.0, 110.0), 220, 220)


def test_a_front_view_shows_the_chest_and_neither_back_nor_soles(body):
    gaussians, at = covering(body)
    vertices, camera = standing(body)
    pixels = shown.front_pixels(gaussians, vertices, body.faces, camera, Workspace(1))
    normal = at_rest(body).R[gaussians.face, :, 1]
    height = (at[:, 1] - at[:, 1].min()) / np.ptp(at[:, 1])
    trunk, soles = (np.abs(at[:, 0]) < 0.1) & (height > 0.55) & (height < 0.75), (height < 0.01) & (normal[:, 1] < -0.8)
    assert np.median(pixels[trunk & (normal[:, 2] > 0.5)]) > 0.5
    assert np.quantile(pixels[trunk & (normal[:, 2] < -0.2)], 0.9) < 0.05
    assert soles.sum() > 10 and np.quantile(pixels[soles], 0.9) < 0.05


def test_unseen_gaussians_lie_flat_and_no_higher_than_their_neighbours_and_seen_ones_stay(body):
    gaussians, at = covering(body)
    rng = np.random.default_rng(0)
    seen = at[:, 1] > at[:, 1].min() + 0.05
    gaussians.mu[~seen] += rng.normal(0, 2, (int((~seen).sum()), 3)).astype(np.float32)
    gaussians.quat[~seen] = rng.normal(size=(int((~seen).sum()), 4))
    out = unseen.flatten_unseen(gaussians, seen, at_rest(body))
    np.testing.assert_array_equal(out.quat[~seen], [[1, 0, 0, 0]] * int((~seen).sum()))
    assert out.mu[~seen, 1].max() < 1e-3, "the neighbours lie on the surface"
    np.testing.assert_array_equal(out.opacity, gaussians.opacity)
    np.testing.assert_array_equal(out.mu[seen], gaussians.mu[seen])
    np.testing.assert_array_equal(gaussians.quat[~seen, 0] == 1, False)


def from_behind(body):
    """Vertices before a camera that looks at the back."""
    vertices, camera = standing(body)
    return np.float32((vertices - [0, 0, 4.0]) @ np.diag([-1.0, 1.0, -1.0]) + [0, 0, 4.0]), camera


def test_unseen_discs_leave_no_gap_and_the_outline_of_what_is_seen_stays(body):
    gaussians, at = covering(body)
    normal = at_rest(body).R[gaussians.face, :, 1]
    seen = normal[:, 2] > -0.2
    gaussians.log_scale[~seen] -= np.log(2)
    gaussians.opacity[:] = 0.95
    out = unseen.flatten_unseen(gaussians, seen, at_rest(body))

    def alpha(which, view):
        vertices, camera = view(body)
        return render_bound(vertices, body.faces, which, camera, Workspace(1)).alpha

    far = np.linalg.norm(at[~seen][:, None] - at[seen][None, ::7], axis=2).min(1) > 0.08
    trunk = np.flatnonzero(~seen)[far & (np.abs(at[~seen, 0]) < 0.1) & (at[~seen, 1] > 0)]
    back, camera = from_behind(body)
    x, y = camera.project(face_frames(back, body.faces).T[gaussians.face[trunk]].astype(np.float64)).astype(int).T
    before, after = (alpha(replace(which, opacity=np.where(seen, 1e-4, which.opacity)), from_behind)[y, x]
                     for which in (gaussians, out))
    assert len(trunk) > 50 and np.quantile(before, 0.1) < 0.8 and np.quantile(after, 0.1) > 0.9
    for view in (standing, from_behind):
        were, are = alpha(gaussians, view), alpha(out, view)
        assert are[were < 0.004].sum() < 5e-4 * were.sum()


def test_what_merging_opened_is_covered_anew_within_the_outline(body):
    gaussians, at = covering(body)
    normal = at_rest(body).R[gaussians.face, :, 1]
    seen = normal[:, 2] > -0.2
    gaussians.opacity[:] = 0.95
    merged, still = merge_to_size(gaussians, seen, np.where(seen, 10.0, 0.0), 2200, body, body.v_template)
    covered = unseen.cover_unseen(merged, still, at_rest(body))
    back, camera = from_behind(body)
    trunk = np.flatnonzero((normal[:, 2] < -0.9) & (np.abs(at[:, 0]) < 0.1) & (at[:, 1] > 0))
    x, y = camera.project(face_frames(back, body.faces).T[gaussians.face[trunk]].astype(np.float64)).astype(int).T

    def shine_through(which):
        hidden = replace(which, opacity=np.where(still, 1e-4, which.opacity))
        return 1 - render_bound(back, body.faces, hidden, camera, Workspace(1)).alpha[y, x].mean()

    assert (~still).sum() < 0.4 * (~seen).sum() and shine_through(merged) > 0.15
    assert shine_through(covered) < 0.5 * shine_through(merged)
    front, camera = standing(body)
    were, are = (render_bound(front, body.faces, which, camera, Workspace(1)).alpha for which in (merged, covered))
    assert are[were < 0.004].sum() < 5e-4 * were.sum()


def test_where_nothing_or_everything_is_seen_nothing_changes(body):
    gaussians, _ = covering(body, 300)
    for seen in (np.zeros(300, bool), np.ones(300, bool)):
        assert unseen.flatten_unseen(gaussians, seen, at_rest(body)) is gaussians
        assert unseen.colour_unseen(gaussians, 10.0 * seen, seen, at_rest(body), body) is gaussians.rgb


def test_a_floater_is_stray_alpha_and_a_long_gaussian_a_needle(body):
    params = BodyParams.from_pose(np.zeros((1, 55, 3)), np.zeros((1, 3)), np.zeros(4), np.zeros((1, body.exprdirs.shape[2])),
                                  300.0, (64.0, 64.0))
    poses = Poses(body, params)
    gaussians, at = covering(body)
    clean = novel_poses.judge_novel(gaussians, poses)
    assert clean["stray_alpha"] < 1e-4 and clean["needle_share"] == 0
    armpit = int(np.argmin(np.linalg.norm(at - body.keypoint_matrix[5] @ body.v_template, axis=1)))
    gaussians.mu[armpit, 1] += 0.2 / at_rest(body).k[gaussians.face[armpit]]
    gaussians.log_scale[armpit] += 1.5
    assert novel_poses.judge_novel(gaussians, poses)["stray_alpha"] > 10 * max(clean["stray_alpha"], 1e-4)
    gaussians.log_scale[7] += [3, 0, 0]
    assert novel_poses.judge_novel(gaussians, poses)["needle_share"] == pytest.approx(1 / 4000)


def test_the_face_has_a_box_from_the_front_and_none_from_behind(body):
    params = BodyParams.from_pose(np.array([[[np.pi, 0, 0]] + [[0, 0, 0]] * 54, [[0, 0, np.pi]] + [[0, 0, 0]] * 54]),
                                  np.tile([0, 0, 4.0], (2, 1)), np.zeros(4), np.zeros((2, body.exprdirs.shape[2])), 300.0,
                                  (110.0, 110.0))
    poses, camera = Poses(body, params), Camera((300.0, 300.0), (110.0, 110.0), 220, 220)
    front, back = (heldout.find_boxes(poses, t, camera) for t in (0, 1))
    x0, y0, x1, y1 = front["face"]
    assert 5 < x1 - x0 < 30 and 5 < y1 - y0 < 30
    assert "face" not in back


def test_no_gaussian_stands_off_those_around_it_and_the_others_stay(body):
    gaussians, at = covering(body)
    off = np.arange(len(gaussians)) % 50 == 0
    size = at_rest(body).k[gaussians.face]
    gaussians.mu[off, 1] += 0.06 / size[off]
    out = heights.level_heights(gaussians, at_rest(body))
    assert (size * out.mu[:, 1])[off].max() < heights.STEP + 0.005
    np.testing.assert_allclose(out.mu[~off], gaussians.mu[~off], atol=1e-6)
    np.testing.assert_allclose(out.log_scale[:, ::2], gaussians.log_scale[:, ::2], atol=1e-6)


def test_a_disc_that_sticks_out_of_the_surface_shrinks(body):
    gaussians, _ = covering(body)
    size = at_rest(body).k[gaussians.face]
    out_of = np.arange(len(gaussians)) % 50 == 0
    gaussians.quat[out_of] = [np.sqrt(0.5), np.sqrt(0.5), 0, 0]
    gaussians.log_scale[out_of, 2] = np.log(0.05 / size[out_of])
    out = heights.level_heights(gaussians, at_rest(body))
    assert 0.2 * heights.STEP < (size * np.exp(out.log_scale[:, 2]))[out_of].max() < heights.STEP


def test_a_spike_is_cut_and_cloth_that_is_as_uneven_everywhere_stays(body):
    gaussians, at = covering(body)
    frames, arm = at_rest(body), np.abs(at[:, 0]) > 0.3
    size, spike = frames.k[gaussians.face], arm & (np.arange(len(gaussians)) % 50 == 0)
    gaussians.log_scale[spike, 1] = np.log(0.018 / size[spike])
    cloth = ~arm
    gaussians.mu[cloth, 1] += np.random.default_rng(0).normal(0, 0.005, cloth.sum()) / size[cloth]
    gaussians.log_scale[cloth, 1] += np.random.default_rng(1).normal(1, 0.3, cloth.sum())
    out = heights.cut_spikes(gaussians, frames, heights.find_around(gaussians, frames))
    reach = size * (out.mu[:, 1] + heights.EXTENT * np.exp(out.log_scale[:, 1]))
    assert spike.sum() > 10 and reach[spike].max() < heights.TALL + 0.008
    np.testing.assert_allclose(out.log_scale[spike][:, ::2], gaussians.log_scale[spike][:, ::2], atol=1e-6)
    same = (out.mu == gaussians.mu).all(1) & (out.log_scale == gaussians.log_scale).all(1)
    assert same[arm & ~spike].all() and same[cloth].mean() > 0.99


def test_the_discs_of_a_coarse_level_keep_the_width_that_covers_the_body(body):
    gaussians = Gaussians.area(body.v_template, body.faces, heights.SPARSE // 4)
    size = at_rest(body).k[gaussians.face]
    gaussians.quat[:] = [np.sqrt(0.5), np.sqrt(0.5), 0, 0]
    gaussians.log_scale[:, 2] = np.log(1.8 * heights.STEP / size)
    out = heights.level_heights(gaussians, at_rest(body))
    np.testing.assert_allclose(out.log_scale, gaussians.log_scale, atol=1e-6)


def test_what_is_shown_little_for_its_size_is_not_seen(body):
    gaussians, at = covering(body)
    frames = at_rest(body)
    area = (frames.k[gaussians.face] * np.exp(gaussians.log_scale[:, 0])) ** 2
    pixels = 4000 * area
    pixels[:100] *= 0.1
    assert pixels[:100].max() > shown.LEAST_SHOWN
    seen = shown.find_seen(pixels, gaussians, at_rest(body))
    assert not seen[:100].any() and seen[100:][pixels[100:] > shown.LEAST_SHOWN].all()
    assert not shown.find_seen(np.zeros(len(gaussians)), gaussians, at_rest(body)).any()
