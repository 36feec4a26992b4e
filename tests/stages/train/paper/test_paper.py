"""Recipe `paper`: its losses against finite differences, its densification by counts, its loop on the small person."""

import json

import numpy as np
import pytest

from gsac.avatar.artifacts import read_arrays
from gsac.avatar.camera import Camera
from gsac.avatar.lpips import NETS, shapes
from gsac.avatar.raster import render, render_backward, screen_gradients
from gsac.stages.train.paper import densify, knn, trainer
from gsac.stages.train.paper.densify import Densifier, make_children
from gsac.stages.train.paper.losses import dice, perceptual, sobel_magnitude
from gsac.stages.train.stage import run


def slope(function, at, direction, h):
    return (function(at + h * direction) - function(at - h * direction)) / (2 * h)


def test_the_edge_loss_has_the_gradient_that_it_gives_and_is_zero_for_equal_images():
    rng = np.random.default_rng(0)
    image, target, direction = (rng.random((9, 11, 3)).astype(np.float32) for _ in range(3))
    gradient = np.zeros_like(image)
    sobel_magnitude(image, target, 0.7, gradient)
    measured = slope(lambda x: sobel_magnitude(x.astype(np.float32), target, 0.7, np.zeros_like(image)), image, direction, 1e-3)
    assert (gradient * direction).sum() == pytest.approx(measured, rel=2e-2)
    assert sobel_magnitude(image, image, 0.7, np.zeros_like(image)) == 0


def test_dice_counts_the_pixels_outside_of_the_box_and_has_the_gradient_that_it_gives():
    rng = np.random.default_rng(1)
    alpha, direction = rng.random((6, 8)), rng.normal(size=(6, 8))
    pixels = rng.integers(0, 256, (6, 8, 4)).astype(np.uint8)
    gradient = np.zeros_like(alpha)
    value = dice(alpha, pixels, 50, 0.1, gradient)
    measured = slope(lambda a: dice(a, pixels, 50, 0.1, np.zeros_like(alpha)), alpha, direction, 1e-5)
    assert (gradient * direction).sum() == pytest.approx(measured, rel=1e-4)
    whole_alpha, whole = np.zeros((14, 7)), np.zeros((14, 7, 4), np.uint8)  # the same 48 pixels and 50 empty ones
    whole_alpha.flat[:48], whole.reshape(-1, 4)[:48] = alpha.ravel(), pixels.reshape(-1, 4)
    assert dice(whole_alpha, whole, 0, 0.1, np.zeros_like(whole_alpha)) == pytest.approx(value)
    assert dice(pixels[..., 3] * 0.0, pixels * np.uint8(0), 0, 0.1, np.zeros_like(alpha)) == pytest.approx(0)


class Squares:
    """A network whose distance is a weighed sum of squares, so that places matter."""

    @staticmethod
    def weights(shape):
        return np.arange(np.prod(shape), dtype=np.float32).reshape(shape) / np.prod(shape)

    def gradient(self, image, target, scaled):
        assert not scaled, "the paper's code hands its images over as they are"
        weights = self.weights(image.shape)
        return float((weights * (image - target) ** 2).sum()), 2 * weights * (image - target)


@pytest.mark.parametrize("centre", [(150.0, 140.0), (0.0, 0.0), (400.0, 300.0), (399.0, 5.0)])
def test_the_perceptual_window_is_that_of_the_whole_frame(centre):
    rng = np.random.default_rng(5)
    background, corner, frame = rng.random(3).astype(np.float32), np.array([90, 30]), (400, 300)
    image, target = rng.random((2, 200, 120, 3)).astype(np.float32)
    gradient = np.ones_like(image)
    value = perceptual(Squares(), image, target, background, corner, frame, np.array(centre), 0.5, gradient)
    whole = np.tile(background, (2, 300, 400, 1))
    whole[:, 30:230, 90:210] = image, target
    x, y = np.clip(np.array(centre).astype(int) - 128, 0, [400 - 256, 300 - 256])
    window = np.s_[y:y + 256, x:x + 256]
    expected, slopes = Squares().gradient(*(part[window] for part in whole), False)
    assert value == pytest.approx(0.5 * expected, rel=1e-4) and value > 0
    on_frame = np.zeros((300, 400, 3))
    on_frame[window] = slopes
    np.testing.assert_allclose(gradient, 1 + 0.5 * on_frame[30:230, 90:210], rtol=1e-5)


def test_a_perceptual_window_beside_the_person_costs_nothing():
    gradient = np.zeros((10, 10, 3), np.float32)
    image = np.ones_like(gradient)
    assert perceptual(Squares(), image, 0 * image, np.zeros(3), np.array([900, 0]), (1000, 300), np.zeros(2), 1.0, gradient) == 0
    assert not gradient.any()


def test_the_neighbour_term_has_the_gradient_of_its_definition():
    rng = np.random.default_rng(2)
    places, values = rng.random((40, 3)), rng.random((40, 4))
    near = knn.Neighbours()
    gradient = near.distance_gradient(places, 0.01, 0)
    index = near.index
    assert (index[:, 0] == np.arange(40)).all()

    def distance(p):
        return 0.01 * ((p[:, None] - p[index]) ** 2).sum(2).mean()

    def spread(x):
        return 0.01 * x[index].std(1, ddof=1).mean()

    direction = rng.normal(size=(40, 3))
    assert (gradient * direction).sum() == pytest.approx(slope(distance, places, direction, 1e-6), rel=1e-3)
    direction = rng.normal(size=(40, 4))
    assert (near.spread_gradient(values, 0.01) * direction).sum() == pytest.approx(slope(spread, values, direction, 1e-6), rel=1e-3)
    assert not near.spread_gradient(np.ones((40, 2)), 0.01).any()


def test_the_gradient_of_the_image_places_is_that_of_a_shift_along_the_image_plane():
    """Far away a shift by z / f metres is a shift by one pixel and changes nothing else."""
    focal, depth = 4e5, 1e4
    camera = Camera((focal, focal), (16.0, 16.0), 32, 32)
    means, scales = np.array([[0.03, -0.05, depth]]), np.full((1, 3), 0.08)
    weights = np.random.default_rng(3).random((32, 32, 3))

    def image_sum(shift):
        moved = means + np.append(shift, 0) * depth / focal
        rendering = render(moved, np.eye(3)[None], scales, np.full((1, 3), 0.7), np.array([0.8]), camera)
        return rendering, float((rendering.rgb * weights).sum())

    rendering, _ = image_sum(np.zeros(2))
    render_backward(rendering.state, weights, np.zeros((32, 32)))
    gradient, visible = screen_gradients(rendering.state)
    measured = [(image_sum(h)[1] - image_sum(-h)[1]) / 2e-5 for h in 1e-5 * np.eye(2)]
    assert visible.all()
    np.testing.assert_allclose(gradient[0], measured, rtol=1e-3)


def rows(count, scale_logit):
    return {"mu": np.zeros((count, 3), np.float32), "quat": np.tile(np.float32([1, 0, 0, 0]), (count, 1)),
            "scale_logit": np.full((count, 3), scale_logit, np.float32),
            "rgb": np.random.default_rng(0).random((count, 3)).astype("f4")}


def test_a_large_gaussian_is_split_outwards_and_a_small_one_cloned():
    rng = np.random.default_rng(4)
    large, small = rows(5, -1.0), rows(5, -4.0)
    new = make_children(large, np.array([1, 3]), rng)
    assert (new["mu"][:, 1] > 0).all() and (large["mu"][[1, 3], 1] > 0).all() and not large["mu"][[0, 2, 4]].any()
    act = densify.LARGEST / (1 + np.exp(-new["scale_logit"]))
    np.testing.assert_allclose(act, densify.LARGEST / (1 + np.exp(1)) / 1.6, rtol=1e-5)
    np.testing.assert_array_equal(new["rgb"], large["rgb"][[1, 3]])
    new = make_children(small, np.array([2]), rng)
    assert not new["mu"].any() and not small["mu"].any() and (small["scale_logit"] == -4).all()


def test_densification_happens_eleven_times_and_only_above_the_threshold():
    class Grown:
        def __init__(self):
            self.values, self.face, self.events = rows(3, -1.0), np.arange(3), []

        def append(self, parents, new):
            self.events.append(parents)
            self.face = np.concatenate([self.face, self.face[parents]])
            self.values = {name: np.concatenate([v, new[name]]) for name, v in self.values.items()}

    grown, densifier, at = Grown(), Densifier(3), []
    for step in range(3000):
        count = len(grown.face)
        gradient = np.zeros((count, 2))
        gradient[0, 0], gradient[1, 1], gradient[2, 0] = 6e-5, 4e-5, 1e-3
        visible = np.ones(count, bool)
        visible[2] = False
        densifier.note(gradient, visible)
        before = len(grown.events)
        densifier.grow(step, grown, np.random.default_rng(step))
        if len(grown.events) > before:
            at.append(step)
    assert at[:2] == [300, 501] and at[-1] == 2310 and len(at) == 11
    assert all(list(parents) == [0] for parents in grown.events)


@pytest.mark.slow
def test_the_recipe_learns_poses_and_betas_and_says_that_the_perceptual_loss_is_left_out(job_anywhere):
    made = job_anywhere(recipe="paper", steps=60, curve=3, pose_test_steps=0)
    run(made)
    figures = json.loads((made.out / "metrics.json").read_text())
    judged = [row["psnr_fg"] for row in figures["curve"] if "psnr_fg" in row]
    assert len(judged) == 3 and judged[-1] > judged[0] > 0
    assert figures["lpips_in_loss"] is False and figures["n_gaussians"] == 27420 and figures["steps"] == 60
    before, after = read_arrays(made.inputs["smplx/body.npz"]), read_arrays(made.out / "body.npz")
    assert 0 < np.abs(after["betas"] - before["betas"]).max() < 60 * 2e-4 * 1.5


@pytest.fixture
def networks(tmp_path):
    """Files of both networks with random weights."""
    rng, files = np.random.default_rng(6), {}
    for name in NETS:
        files[name] = tmp_path / name
        with files[name].open("wb") as file:
            np.savez(file, **{own: np.float32(abs(rng.normal(size=shape)) / np.sqrt(np.prod(shape[1:])))
                              for own, shape in shapes(name).items()})
    return files


@pytest.mark.slow
def test_brought_networks_are_judged_by_and_take_part_in_the_loss_of_the_paper(job, networks, monkeypatch):
    monkeypatch.setattr(trainer, "BATCH", 1)
    seen = []
    for name, models, lpips in (("with", networks, "loss"), ("judged", networks, "judge"), ("without", {}, "loss")):
        made = job(name, frames=6, recipe="paper", steps=2, pose_test_steps=2, lpips=lpips)
        made.models = models
        run(made)
        seen.append(json.loads((made.out / "metrics.json").read_text()))
    one, judged, two = seen
    assert judged["lpips_vgg"] > 0 and not judged["lpips_in_loss"] and judged["curve"][0]["loss"] == two["curve"][0]["loss"]
    assert one["lpips_in_loss"] and not two["lpips_in_loss"]
    assert one["lpips"] == one["lpips_alex"] > 0 and one["lpips_net"] == "lpips-alex" and one["lpips_vgg_ttpo"] > 0
    assert one["lpips_alex_unscaled"] != one["lpips_alex"] and all(row["lpips_vgg"] > 0 for row in one["heldout"])
    assert one["curve"][0]["loss"] > two["curve"][0]["loss"]
    assert two["lpips"] is two["lpips_net"] is two["lpips_vgg"] is two["lpips_ttpo"] is None
