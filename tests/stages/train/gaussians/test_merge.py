"""Fewer gaussians for the same image: what merging keeps, and what it takes first."""

import numpy as np
import pytest

from gsac.avatar.binding import bind, face_frames
from gsac.avatar.body import Body
from gsac.avatar.camera import Camera
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.raster import render_bound
from gsac.stages.train.gaussians import merge

COUNT = 1500


@pytest.fixture(scope="module")
def body():
    return Body.load()


@pytest.fixture(scope="module")
def rest(body):
    return body.rest(np.zeros(4))[0]


@pytest.fixture
def person(body, rest):
    """Grey below the waist, a pattern as fine as the gaussians above."""
    gaussians = Gaussians.area(rest, body.faces, COUNT)
    middle = rest[body.faces].mean(1)[gaussians.face]
    patterned = middle[:, 1] > 0
    gaussians.rgb[patterned] = np.random.default_rng(0).random((patterned.sum(), 3))
    return gaussians, patterned


def all_skin(body):
    return merge.skin_weights(np.arange(len(body.faces)), body)


def alpha(gaussians, rest, body):
    camera = Camera((150.0, 150.0), (48.0, 48.0), 96, 96)
    placed = (rest - (rest.min(0) + rest.max(0)) / 2) * [1, -1, -1] + [0, 0, 3.2]
    return render_bound(placed.astype(np.float32), body.faces, gaussians, camera).alpha


def test_merging_gives_the_number_asked_for_and_leaves_no_holes(person, rest, body):
    gaussians, _ = person
    fewer, _ = merge.merge_to_size(gaussians, np.ones(COUNT, bool), np.ones(COUNT), 700, body, rest)
    assert len(fewer) == 700
    before, after = alpha(gaussians, rest, body), alpha(fewer, rest, body)
    assert after[before > 0.9].mean() > 0.9 * before[before > 0.9].mean()
    assert after[before < 0.01].max() < 0.5, "nothing grows far beyond the person"


def test_plain_cloth_is_merged_before_a_pattern(person, rest, body):
    gaussians, patterned = person
    fewer, _ = merge.merge_to_size(gaussians, np.ones(COUNT, bool), np.ones(COUNT), 1000, body, rest)
    above = rest[body.faces].mean(1)[fewer.face][:, 1] > 0
    assert above.sum() / patterned.sum() > 1.3 * (~above).sum() / (~patterned).sum()


def test_what_frames_show_outlives_what_none_shows(person, rest, body):
    gaussians, _ = person
    gaussians.rgb[:] = 0.5
    left = rest[body.faces].mean(1)[gaussians.face][:, 0] > 0
    fewer, seen = merge.merge_to_size(gaussians, left, left.astype(float), 1000, body, rest)
    still = rest[body.faces].mean(1)[fewer.face][:, 0] > 0
    assert still.sum() > 0.9 * left.sum()
    np.testing.assert_array_equal(seen, still, "what is made of a seen one is seen")
    before, after = alpha(gaussians, rest, body), alpha(fewer, rest, body)
    assert after[before > 0.9].mean() > 0.9 * before[before > 0.9].mean(), "the part that no frame shows stays covered"


def test_a_merged_gaussian_lies_where_the_one_that_shows_more_lay(person, rest, body):
    gaussians, _ = person
    frames = face_frames(rest, body.faces)
    bound = bind(frames, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
    shown = np.ones(COUNT)
    pair = merge.find_cheapest_pairs(gaussians, bound, shown, frames, all_skin(body), 1)
    shown[pair[0, 0]] = 9
    _, fewer, _ = merge.merge_pairs(gaussians, bound, shown, pair, frames)
    places = bind(frames, fewer.face, fewer.mu, fewer.quat, fewer.log_scale).means
    wanted = 0.9 * bound.means[pair[0, 0]] + 0.1 * bound.means[pair[0, 1]]
    assert np.linalg.norm(places - wanted, axis=1).min() < 1e-5


def test_fingers_are_not_merged_with_each_other(rest, body):
    gaussians = Gaussians.area(rest, body.faces, 12000)
    frames = face_frames(rest, body.faces)
    bound = bind(frames, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
    i, j = merge.find_cheapest_pairs(gaussians, bound, np.ones(len(gaussians)), frames, all_skin(body), len(gaussians)).T
    part = merge.skin_weights(gaussians.face, body)
    finger = np.zeros((len(gaussians), 10))
    for f in range(10):
        finger[:, f] = part[:, 25 + 3 * f:28 + 3 * f].sum(1)
    sure = (finger.max(1)[i] > 0.9) & (finger.max(1)[j] > 0.9)
    assert sure.sum() > 100 and (finger.argmax(1)[i] == finger.argmax(1)[j])[sure].all()


def test_the_cheapest_pairs_are_the_same_however_few_are_asked_for(person, rest, body):
    gaussians, _ = person
    frames = face_frames(rest, body.faces)
    bound = bind(frames, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale)
    shown = np.random.default_rng(1).random(COUNT) + 0.1
    every, few = (merge.find_cheapest_pairs(gaussians, bound, shown, frames, all_skin(body), most) for most in (COUNT, 40))
    assert len(few) == 40 < len(every) < COUNT / 2 and len(np.unique(every)) == every.size
    np.testing.assert_array_equal(few, every[:40])


def test_gaussians_at_one_place_are_merged_with_each_other_not_with_themselves(rest, body):
    gaussians = Gaussians.area(rest, body.faces, COUNT)[np.repeat(np.arange(300), 5)]
    fewer, _ = merge.merge_to_size(gaussians, np.ones(COUNT, bool), np.ones(COUNT), 1000, body, rest)
    assert len(fewer) == 1000 and len(np.unique(fewer.face)) == len(np.unique(gaussians.face))
