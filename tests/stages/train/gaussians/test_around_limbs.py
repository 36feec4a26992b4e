"""Colours of what no frame shows: a figure that was seen from the front alone."""

from dataclasses import replace

import numpy as np
import pytest

from gsac.avatar.binding import bind, face_frames
from gsac.avatar.body import Body
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import HEAD
from gsac.avatar.light import shade
from gsac.stages.train.fast.initial_gaussians import centres_at_rest
from gsac.stages.train.gaussians.around_limbs import POLE, find_scalp, middle_means, stretch
from gsac.stages.train.gaussians.merge import skin_weights
from gsac.stages.train.gaussians.nearest import find_nearest
from gsac.stages.train.gaussians.unseen import colour_unseen

SHIRT, TROUSERS, PRINT, SLEEVE = np.float32([[0.8, 0.7, 0.2], [0.1, 0.1, 0.4], [0.0, 0.0, 0.0], [0.2, 0.6, 0.2]])
HEM, CUFF = 0.0, 0.4
"""m of y where the shirt ends, and of x where sleeves do."""


class Front:
    """Gaussians on the body at rest, and which of them the front shows."""

    def __init__(self):
        self.body = Body.load()
        self.gaussians = Gaussians.area(self.body.v_template, self.body.faces, 12000, 0)
        self.at = centres_at_rest(self.gaussians, self.body.v_template, self.body.faces)
        self.normals = face_frames(self.body.v_template, self.body.faces).R[self.gaussians.face, :, 1]
        self.seen = self.normals[:, 2] > 0
        self.pixels = np.where(self.seen, 5.0, 0.0)

    def colours(self) -> np.ndarray:
        """(N, 3) after what the front shows, from any colours."""
        unknown = np.random.default_rng(0).random((int((~self.seen).sum()), 3))
        self.gaussians.rgb[~self.seen] = unknown
        return colour_unseen(self.gaussians, self.pixels, self.seen, face_frames(self.body.v_template, self.body.faces), self.body)


@pytest.fixture
def front():
    return Front()


def test_a_hem_and_a_cuff_go_on_straight_round_the_limb(front):
    x, y = np.abs(front.at[:, 0]), front.at[:, 1]
    arm = x > 0.25
    front.gaussians.rgb[:] = np.where((arm & (x > CUFF))[:, None], SLEEVE, np.where((y > HEM)[:, None], SHIRT, TROUSERS))
    truth = front.gaussians.rgb.copy()
    off = np.abs(front.colours() - truth).max(1)
    hidden = ~front.seen & (front.normals[:, 2] < -0.3)
    trunk, forearm = hidden & (x < 0.15) & (np.abs(y - HEM) < 0.2), hidden & arm & (np.abs(x - CUFF) < 0.12)
    assert trunk.sum() > 200 and forearm.sum() > 50
    assert np.quantile(off[trunk & (np.abs(y - HEM) > 0.03)], 0.95) < 0.05
    assert np.quantile(off[forearm & (np.abs(x - CUFF) > 0.03)], 0.95) < 0.05


def test_a_print_on_the_chest_does_not_come_through_to_the_back(front):
    x, y = np.abs(front.at[:, 0]), front.at[:, 1]
    chest = (x < 0.06) & (y > 0.2) & (y < 0.32)
    front.gaussians.rgb[:] = np.where((chest & front.seen)[:, None], PRINT, SHIRT)
    back = chest & (front.normals[:, 2] < -0.5)
    assert back.sum() > 20 and np.abs(front.colours()[back] - SHIRT).max() < 0.1


def test_hair_goes_on_as_far_from_the_crown_behind_as_it_does_at_the_temples(front):
    rest = face_frames(front.body.v_template, front.body.faces)
    bound = bind(rest, front.gaussians.face, front.gaussians.mu, front.gaussians.quat, front.gaussians.log_scale)
    places = stretch(bound, front.gaussians.face, rest, front.body)
    weight = skin_weights(front.gaussians.face, front.body)[:, HEAD]
    head = weight > 0.9
    known, back = np.flatnonzero(front.seen), np.flatnonzero(head & (front.normals[:, 2] < -0.5))
    crown = front.at[head][np.argmax(front.at[head] @ POLE)]
    along = np.linalg.norm(front.at - crown, axis=1)
    taken, beside = (known[find_nearest(where[known], where[back], 9)] for where in (places, front.at))
    assert len(back) > 50 and (weight[taken] > 0.5).mean() > 0.98
    assert 2 * np.median(np.abs(along[taken] - along[back, None])) < np.median(np.abs(along[beside] - along[back, None]))


def test_the_back_of_a_head_takes_the_hair_over_the_forehead_and_not_the_skin_of_a_face(front):
    """Of short hair the front shows little, of the face much, as far from the crown."""
    scalp = find_scalp(front.gaussians.face, front.body)
    front.gaussians.rgb[:] = np.where(scalp[:, None], TROUSERS, SHIRT)
    assert 0.02 < front.seen[scalp].mean() < 0.4
    behind = scalp & (front.normals[:, 2] < -0.5)
    assert behind.sum() > 50
    hair = np.abs(front.colours()[behind] - TROUSERS).max(1) < 0.02
    assert hair.mean() > 0.9, "all but what lies beside the ears"
    assert not find_scalp(front.gaussians.face, replace(front.body, clothes=())).any()


def test_what_was_seen_well_counts_more_than_what_was_seen_at_a_slant(front):
    slant = front.seen & (front.normals[:, 2] < 0.7)
    front.pixels[slant] = 0.2
    front.gaussians.rgb[:] = np.where(slant[:, None], TROUSERS, SHIRT)
    trunk = (np.abs(front.at[:, 0]) < 0.15) & (front.at[:, 1] > 0.1) & (front.at[:, 1] < 0.4)

    def bluish() -> float:
        """Share of the hidden trunk with the colour that was seen at a slant."""
        colours = front.colours()[trunk & ~front.seen]
        return float((np.abs(colours - TROUSERS) < np.abs(colours - SHIRT)).all(1).mean())

    little = bluish()
    front.pixels[slant] = 5.0
    assert 2 * little < bluish()


def test_a_figure_seen_on_its_lit_side_alone_shows_no_colour_outside_of_the_seen_ones(front):
    light = np.tile([[0.9], [0.4], [0.0], [0.1]], 3).astype(np.float32)
    front.gaussians.light = light
    front.gaussians.rgb[:] = np.random.default_rng(0).uniform([0.5, 0.1, 0.2], [0.6, 0.2, 0.3], (len(front.gaussians), 3))
    front.seen[:] = front.normals[:, 0] > -0.1
    front.pixels[:] = np.where(front.seen, 5.0, 0.0)
    known, factor = front.gaussians.rgb.copy(), shade(light, front.normals)
    low, high = (known * factor)[front.seen].min(0), (known * factor)[front.seen].max(0)
    assert (known * factor)[~front.seen].min() < 0.8 * low.min(), "the light goes on falling where no frame looked"
    after = front.colours()
    lit = (after * factor)[~front.seen]
    assert (lit >= low - 1e-5).all() and (lit <= high + 1e-5).all()
    np.testing.assert_array_equal(after[front.seen], known[front.seen])


def test_a_colour_is_the_mean_of_the_middle_of_those_around():
    values = np.array([[5.0, 1.0, 2.0, 100.0], [0.0, 7.0, 7.0, 7.0]])
    weight = np.array([[0.35, 0.1, 0.45, 0.1], [0.3, 0.2, 0.2, 0.3]])
    np.testing.assert_allclose(middle_means(values, weight), [(0.2 * 2 + 0.1 * 5) / 0.3, 7])
