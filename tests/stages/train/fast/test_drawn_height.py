"""Up to which height a level of detail is drawn: where it loses a quarter of a decibel to the level before."""

from types import SimpleNamespace

import numpy as np
import pytest

from gsac.avatar.artifacts import Clip
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.camera import Camera
from gsac.avatar.gaussians import Gaussians
from gsac.stages.train.fast import drawn_height
from gsac.stages.train.judge.heldout import Candidate
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.views import View, read_views

STATURE, DISTANCE, FOCAL = 1.7, 3.4, 400.0
"""A person 200 px tall."""


@pytest.fixture
def scene():
    """A level for find_drawn_height, in one view: one joint, straight ahead."""
    vertices = np.array([[0, 0, 0], [0, STATURE, 0]])
    params = SimpleNamespace(joints=np.array([[[0, 0, DISTANCE]]]))
    poses = SimpleNamespace(rest=lambda t: (vertices, None), to_params=lambda: params)
    views = {0: View(Camera((FOCAL, FOCAL), (50, 100), 100, 200), np.zeros((200, 100, 4), np.uint8), (0, 0))}
    return Candidate(None, poses, [0], views)


@pytest.mark.parametrize(("lost", "height"), [
    ([-2, -3, -1], 200), ([.25, 0, 0], 200), ([1.25, -.75, -3], 200 / 2 ** .5), ([3.25, 1.25, -.75], 200 / 2 ** 1.5),
    ([1, 2, -.5], 200 / 2 ** 1.5), ([4, 3, 2], 50)])
def test_it_is_the_largest_height_from_which_on_the_level_loses_no_more_and_at_most_the_one_it_was_fitted_at(
        scene, monkeypatch, lost, height):
    monkeypatch.setattr(drawn_height, "measure_losses", lambda *_: np.array(lost, float))
    assert drawn_height.find_drawn_height(scene, scene) == pytest.approx(height, abs=.5)


def test_the_loss_is_that_of_one_against_the_other_at_three_sizes(job):
    made = job(frames=2)
    params, body = BodyParams.read(made.inputs["smplx/body.npz"]), Body.load()
    clip, poses = Clip.read(made.inputs["split/clip.json"]), Poses(body, params)
    views, _ = read_views(made.inputs["split/frames"], made.inputs["segment/alpha"], params.camera(clip.width, clip.height), 96)
    one = Gaussians.area(poses.rest(0)[0], body.faces, 300)
    level, finer = (Candidate(shown, poses, range(2), dict(enumerate(views))) for shown in (one, one[::9]))
    lost = drawn_height.measure_losses(level, finer)
    np.testing.assert_allclose(drawn_height.measure_losses(finer, level), -lost, atol=1e-9)
    assert lost.shape == (3,) and abs(lost).min() > .01


def test_each_is_looked_at_in_its_own_poses(job):
    made = job(frames=2)
    params, body = BodyParams.read(made.inputs["smplx/body.npz"]), Body.load()
    clip, poses = Clip.read(made.inputs["split/clip.json"]), Poses(body, params)
    views, _ = read_views(made.inputs["split/frames"], made.inputs["segment/alpha"], params.camera(clip.width, clip.height), 96)
    one, aside = Gaussians.area(poses.rest(0)[0], body.faces, 300), poses.copy()
    aside.transl += np.float32(0.1)
    same, off = (Candidate(one, its, range(2), dict(enumerate(views))) for its in (poses, aside))
    assert (drawn_height.measure_losses(off, same) > .1).all()
