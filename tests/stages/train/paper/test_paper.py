"""Recipe `paper` against plain torch transcriptions of the published formulas (benchmarks/gpu/published), and its loop."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from gsac.avatar import binding, vgg_hed
from gsac.avatar.artifacts import read_arrays
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.camera import Camera
from gsac.avatar.draw_rule import MAX_ALPHA
from gsac.avatar.lpips import NETS, shapes
from gsac.avatar.raster import render, render_backward, screen_gradients
from gsac.avatar.threads import Workspace
from gsac.benchmarks.gpu.published import formulas as haha
from gsac.stages.train.config import TrainConfig
from gsac.stages.train.gaussians import kernels
from gsac.stages.train.paper import batches, densify, knn, losses, square, trainer
from gsac.stages.train.paper.body_adam import BodyAdam
from gsac.stages.train.paper.densify import Densifier, make_children
from gsac.stages.train.paper.losses import Picture, dice, perceptual, picture_loss, window_begin
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.stage import run
from gsac.stages.train.task import Task
from gsac.stages.train.views import View
from support.vgg_hed import write_hed

SIDE = 60
BOXES = ((0, 13, 31, 47), (22, 0, 38, 29))
"""Corner x, y, width, height; each at two edges of the square."""


def near(found, expected, rel=1e-4):
    """Whether two arrays differ by at most `rel` of the second's norm."""
    expected = np.asarray(expected, float)
    return np.linalg.norm(np.asarray(found, float) - expected) <= rel * np.linalg.norm(expected) > 0


def made_pictures(seed=0):
    """Boxes of square frames: random where the person can be, background along the box's inner edges."""
    rng = np.random.default_rng(seed)
    for x, y, w, h in BOXES:
        bare = [[square.CLEAR * (first > 0), square.CLEAR * (first + size < SIDE)] for first, size in ((y, h), (x, w))]
        inside = np.pad(np.ones((h - sum(bare[0]), w - sum(bare[1]))), bare)
        alpha, mask = (rng.random((h, w)) * inside for _ in range(2))
        rgb = rng.random((h, w, 3)) * alpha[..., None]
        pixels = np.uint8(255 * np.dstack([rng.random((h, w, 3)) * mask[..., None], mask]))
        yield Picture(rgb, alpha, pixels, rng.random(3), (x, y), SIDE)


def whole(pictures, name):
    """(B, SIDE, SIDE, ...): an attribute of the pictures in their squares, with zeros around."""
    out = []
    for picture, (x, y, w, h) in zip(pictures, BOXES, strict=True):
        values = picture.pixels / 255 if name == "pixels" else getattr(picture, name)
        out.append(np.zeros((SIDE, SIDE, *values.shape[2:])))
        out[-1][y:y + h, x:x + w] = values
    return torch.tensor(np.stack(out))


@pytest.mark.parametrize("text", [False, True], ids=["code", "text"])
def test_the_losses_of_a_batch_and_their_gradients_are_the_published_ones(text):
    pictures = list(made_pictures())
    rgb, alpha, pixels = (whole(pictures, name) for name in ("rgb", "alpha", "pixels"))
    rgb.requires_grad_(), alpha.requires_grad_()
    background = torch.tensor(np.stack([p.background for p in pictures]))
    expected = haha.image_losses(rgb, alpha, pixels[..., :3], pixels[..., 3], background, text)
    expected.backward()
    value, slope = (0.0, 0.0) if text else dice(pictures)
    for b, (picture, (x, y, w, h)) in enumerate(zip(pictures, BOXES, strict=True)):
        loss, grad_rgb, grad_alpha = picture_loss(picture, 1 / 2, text, Workspace(1))
        value += loss
        box = np.s_[b, y:y + h, x:x + w]
        assert near(grad_rgb, rgb.grad[box]) and near(grad_alpha + slope * (1 - picture.mask), alpha.grad[box])
    assert value == pytest.approx(expected.item(), rel=1e-5)


def test_each_loss_alone_is_the_published_one():
    """In the sum a wrong small one would not show."""
    pictures = list(made_pictures(1))
    alpha, pixels = whole(pictures, "alpha").requires_grad_(), whole(pictures, "pixels")
    expected = haha.DICE * haha.dice(alpha, pixels[..., 3])
    expected.backward()
    value, slope = dice(pictures)
    assert value == pytest.approx(expected.item(), rel=1e-5) and near(slope * (1 - pixels[..., 3]), alpha.grad)
    for picture, (x, y, w, h), b in zip(pictures, BOXES, range(2), strict=True):
        ground = torch.tensor(np.broadcast_to(picture.background, (1, SIDE, SIDE, 3)).copy())
        image, target = ground.clone(), ground.clone()
        image[0, y:y + h, x:x + w] = torch.tensor(picture.rgb + (1 - picture.alpha[..., None]) * picture.background)
        target[0, y:y + h, x:x + w] = pixels[b, y:y + h, x:x + w, :3] + (1 - pixels[b, y:y + h, x:x + w, 3:]) * ground[0, 0, 0]
        image.requires_grad_()
        expected = torch.nn.functional.l1_loss(haha.strength(image), haha.strength(target))
        expected.backward()
        gradient, box = np.zeros((h, w, 3)), np.s_[0, y:y + h, x:x + w]
        value = losses.edge_strength(image.detach().numpy()[box], target.numpy()[box], picture, 1 / SIDE**2, gradient)
        assert value == pytest.approx(expected.item(), rel=1e-5) and near(gradient, image.grad[box])


def made_mesh(seed, faces=30):
    """Vertices (V, 3) before a camera and faces (F, 3), and local values of two gaussians a face."""
    rng = np.random.default_rng(seed)
    vertices = rng.normal(0, 0.06, (faces // 2 + 2, 3)) + [0, 0, 2]
    corners = np.array([rng.choice(len(vertices), 3, replace=False) for _ in range(faces)], np.int32)
    face = np.tile(np.arange(faces, dtype=np.int32), 2)
    n = len(face)
    return vertices, corners, face, {"mu": rng.normal(0, 0.015, (n, 3)), "quat": rng.normal(size=(n, 4)) * 2,
                                     "scale_logit": rng.normal(-2.5, 0.3, (n, 3)), "rgb": rng.normal(0.5, 0.3, (n, 3))}


def as_torch(vertices, values):
    """Vertices and values of gaussians as leaves, float64."""
    return [torch.tensor(np.asarray(a, float), requires_grad=True) for a in (vertices, *values.values())]


def test_the_neighbour_term_is_that_of_posed_gaussians_and_pulls_the_body_too():
    vertices, faces, face, values = made_mesh(2)
    leaves = as_torch(vertices, values)
    places, quats, scales = haha.posed(leaves[0], torch.tensor(faces).long(), torch.tensor(face).long(), *leaves[1:4])
    expected = haha.knn(places, quats, scales, leaves[4])
    expected.backward()
    local = values["mu"], values["quat"], np.log(densify.LARGEST / (1 + np.exp(-values["scale_logit"])))
    bound = binding.bind(binding.face_frames(vertices, faces), face, *local)
    assert np.abs(knn.posed_quats(bound.rotations) - quats.detach().numpy()).max() < 1e-12
    pull = knn.pull_together(*bound, values["rgb"], haha.KNN)
    back = binding.bind_backward(vertices, faces, face, *local, pull.places, pull.rotations, pull.scales)
    assert pull.value == pytest.approx(expected.item(), rel=1e-5)
    for found, leaf in zip((back.vertices, back.mu, back.quat, back.log_scale / (1 + np.exp(values["scale_logit"])), pull.rgb),
                           leaves, strict=True):
        assert near(found, leaf.grad)


def test_gaussians_in_one_place_and_of_one_look_are_not_pulled():
    pull = knn.pull_together(np.ones((5, 3)), np.tile(np.eye(3), (5, 1, 1)), np.ones((5, 3)), np.ones((5, 3)), 1.0)
    assert pull.value == 0 and not any(part.any() for part in pull[1:])


FOCAL, CENTRE, SIZE = 170.0, (33.0, 29.5), (64, 56)


def made_trainer(seed, **config):
    """A Trainer of two frames, 64x56 px, of a small mesh, without a body; what it hands to the body's Adam is in `moves`."""
    rng = np.random.default_rng(seed)
    vertices, faces, face, values = made_mesh(seed)
    posed = [vertices, vertices + rng.normal(0, 0.01, vertices.shape)]
    poses = SimpleNamespace(body=SimpleNamespace(faces=faces, v_template=vertices), pose=np.zeros((2, 55, 3)), betas=np.zeros(3),
                            transl=np.zeros((2, 3)), expression=np.zeros((2, 4)), vertices=lambda t: posed[t].astype(np.float32))
    views = []
    for _ in posed:
        mask = np.pad(rng.random((40, 36)), [(8, 8), (14, 14)])
        views.append(View(Camera((FOCAL, FOCAL), CENTRE, *SIZE),
                          np.uint8(255 * np.dstack([rng.random((56, 64, 3)) * mask[..., None], mask])), (0, 0)))
    task = Task(views, np.arange(2), np.arange(0), poses, TrainConfig(recipe="paper", **config), lambda *args: None)
    made, moves = trainer.Trainer(task, rng), {}
    made.body = SimpleNamespace(step=moves.update)
    made.face = face
    made.values = {name: value.astype(np.float32) for name, value in values.items()}
    made.first, made.second = ({name: np.zeros_like(v) for name, v in made.values.items()} for _ in range(2))
    made.densifier.reset(len(face))
    return made, trainer.crop_views(task), views, posed, moves


@pytest.mark.parametrize("text", [False, True], ids=["code", "text"])
def test_a_whole_step_has_the_loss_and_every_gradient_of_the_published_one(text):
    """From gaussians on a mesh through drawing to the loss; those of the places in the image in half widths of the square."""
    made, crops, views, posed, moves = made_trainer(3, paper_text=text)
    values = {name: value.copy() for name, value in made.values.items()}
    grounds = np.random.default_rng(4).random((2, 3)).astype(np.float32)
    loss = made.step(crops, 150, 3000, grounds, np.zeros(2, int))

    leaves = as_torch(posed[0], values)[1:]
    meshes = [torch.tensor(mesh.astype(np.float32).astype(float), requires_grad=True) for mesh in posed]
    shifts = [torch.zeros((len(made.face), 2), dtype=torch.float64, requires_grad=True) for _ in posed]
    faces, face = (torch.tensor(a).long() for a in (made.faces, made.face))
    side, drawn, pixels, near_ones = 64, [], [], 0.0
    for mesh, shift, view in zip(meshes, shifts, views, strict=True):
        places, quats, scales = haha.posed(mesh, faces, face, *leaves[:3])
        drawn.append(haha.draw(places, quats, scales, leaves[3], torch.sigmoid(torch.tensor(6.0, dtype=torch.float64)),
                               torch.tensor([FOCAL, FOCAL]), torch.tensor(CENTRE) + torch.tensor([0, 4]), (side, side), shift,
                               MAX_ALPHA))
        pixels.append(np.pad(view.pixels / 255, [(4, 4), (0, 0), (0, 0)]))  # GSAC's square
        near_ones = near_ones + haha.knn(places, quats, scales, leaves[3]) / 2
    rgb, alpha = (torch.stack(part) for part in zip(*drawn, strict=True))
    pixels = torch.tensor(np.stack(pixels))
    expected = near_ones + haha.image_losses(rgb, alpha, pixels[..., :3], pixels[..., 3], torch.tensor(grounds).double(), text)
    expected.backward()
    assert loss == pytest.approx(expected.item(), rel=1e-5)
    for (name, moments), leaf in zip(made.first.items(), leaves, strict=True):
        assert near(10 * moments, leaf.grad), name  # from empty moments a step leaves a tenth of the gradient
    for t, mesh in enumerate(meshes):
        assert near(moves[t], mesh.grad)
    lengths = sum((shift.grad * side / 2).norm(dim=-1) for shift in shifts)
    assert near(made.densifier.length, lengths) and (made.densifier.hits == 2).all()


def test_an_event_takes_the_gaussians_that_the_published_rule_takes():
    rng = np.random.default_rng(5)
    steps = [0, 40, 100, *range(101, 301, 9), 300]
    gradients = rng.exponential(4e-5, (len(steps), 4, 300, 1)) * rng.normal(size=(len(steps), 4, 300, 2))
    gradients[:3] *= 50  # before the first step that counts
    radii = rng.integers(0, 3, (len(steps), 4, 300))
    radii[:, :, :10] = 0
    densifier = Densifier(300)
    for step, images, seen in zip(steps, gradients, radii, strict=True):
        for gradient, radius in zip(images, seen, strict=True):
            densifier.note(step, gradient, radius > 0)
    total, times = torch.zeros(2, 300, dtype=torch.float64)
    for step, images, seen in zip(steps, torch.tensor(gradients), torch.tensor(radii), strict=True):
        if haha.counts(step):
            haha.note(total, times, images, seen)
    expected = haha.selected(total, times).numpy()
    assert 20 < expected.sum() < 280
    np.testing.assert_array_equal(densifier.choose(), np.flatnonzero(expected))


def test_clones_and_halves_have_the_published_places_and_sizes():
    rng = np.random.default_rng(6)
    values = {"mu": rng.normal(0, 0.1, (40, 3)), "quat": rng.normal(size=(40, 4)), "scale_logit": rng.normal(-3, 1, (40, 3)),
              "rgb": rng.random((40, 3))}
    before = {name: value.copy() for name, value in values.items()}
    chosen = np.sort(rng.choice(40, 25, replace=False))
    splits = (densify.LARGEST / (1 + np.exp(-values["scale_logit"][chosen]))).max(1) > densify.SMALL
    assert 3 < splits.sum() < 22
    samples = np.random.default_rng(7).normal(size=(2, splits.sum(), 3))
    parents, new = make_children(values, chosen, np.random.default_rng(7))
    theirs = {name: torch.tensor(value) for name, value in before.items()}
    clone, split, rows = haha.grow(theirs, torch.tensor(np.isin(np.arange(40), chosen)), torch.tensor(samples))
    np.testing.assert_array_equal(parents, torch.cat([clone, split]))
    for name in values:
        np.testing.assert_allclose(values[name], theirs[name], atol=1e-6)
        np.testing.assert_allclose(new[name], rows[name], atol=1e-6)


class Grown:
    """Gaussians that a Densifier adds to."""

    def __init__(self):
        self.values, self.face, self.events = {"mu": np.zeros((3, 3)), "scale_logit": np.full((3, 3), -1.0)}, np.arange(3), []

    def append(self, parents, new):
        self.events.append(parents)
        self.face = np.concatenate([self.face, self.face[parents]])
        self.values = {name: np.concatenate([v, new[name]]) for name, v in self.values.items()}


def test_densification_happens_eleven_times_and_only_above_the_threshold():
    grown, densifier, at = Grown(), Densifier(3), []
    for step in range(3000):
        count = len(grown.face)
        gradient = np.zeros((count, 2))
        gradient[0, 0], gradient[1, 1], gradient[2, 0] = 6e-5, 4e-5, 1e-3
        visible = np.ones(count, bool)
        visible[2] = False
        densifier.note(step, gradient, visible)
        before = len(grown.events)
        densifier.grow(step, grown, np.random.default_rng(step))
        if len(grown.events) > before:
            at.append(step)
    assert at[:2] == [300, 501] and at[-1] == 2310 and len(at) == 11
    assert all(list(parents) == [0] for parents in grown.events)


def test_the_sums_go_on_where_an_event_adds_nothing():
    grown, densifier = Grown(), Densifier(3)
    densifier.note(200, np.full((3, 2), 1e-5), np.ones(3, bool))
    densifier.grow(300, grown, np.random.default_rng(0))
    assert densifier.hits.tolist() == [1, 1, 1] and not grown.events
    densifier.note(400, np.full((3, 2), 1.0), np.ones(3, bool))
    densifier.grow(501, grown, np.random.default_rng(0))
    assert not densifier.hits.any() and len(densifier.hits) == len(grown.face) == 6


def test_adam_is_torchs_for_small_gradients_too():
    rng = np.random.default_rng(8)
    start, grads = rng.normal(size=(20, 3)), rng.normal(size=(6, 20, 3)) * np.logspace(-10, -2, 20)[:, None]
    ours, first, second = start.copy(), np.zeros((20, 3)), np.zeros((20, 3))
    theirs = torch.tensor(start, requires_grad=True)
    adam = torch.optim.Adam([theirs], lr=5e-3)
    for step, grad in enumerate(grads):
        kernels.adam(ours, grad, first, second, step + 1, 5e-3)
        theirs.grad = torch.tensor(grad)
        adam.step()
    np.testing.assert_allclose(ours, theirs.detach(), rtol=1e-12)
    assert trainer.mu_rates(3000)[[0, 700, 2999]].tolist() == pytest.approx([haha.xyz_rate(step) for step in (0, 700, 2999)])


def made_poses(frames):
    """The open body's Poses in some pose; its jaw opens the mouth."""
    body, rng = Body.load(), np.random.default_rng(9)
    pose = rng.normal(0, 0.1, (frames, 55, 3))
    pose[:, 23:25] = 0
    return Poses(body, BodyParams.from_pose(pose, np.tile([0, 0, 3.0], (frames, 1)), rng.normal(0, 0.3, body.num_betas),
                                            rng.random((frames, body.exprdirs.shape[2])), 500.0, (0, 0)))


def test_pose_jaw_expression_and_betas_are_learned_by_torchs_adam_at_the_published_rates():
    poses, rng = made_poses(2), np.random.default_rng(10)
    assert poses.body.jaw_actions.any()
    push = rng.normal(size=poses.vertices(0).shape) * 1e-6
    start = {name: getattr(poses, name).copy() for name in ("pose", "transl", "expression", "betas")}

    def pushed(name, at, h):
        getattr(poses, name)[at] += h
        poses.forget_rests(), poses.forget_expressions()
        found = float((poses.vertices(0) * push).sum(dtype=np.float64))
        getattr(poses, name)[at] -= h
        return found

    adam, other = BodyAdam(poses), torch.tensor(start["expression"][0], requires_grad=True)
    theirs = torch.optim.Adam([other], lr=2e-5)
    other.grad = torch.tensor(poses.expression_gradient(poses.gradients(0, push)[2]), dtype=torch.float64)
    theirs.step()
    adam.step({0: push})
    assert not np.array_equal(poses.pose[0], start["pose"][0]) and np.array_equal(poses.pose[1], start["pose"][1])
    for name, at, rate, h in (("pose", (0, 4, 1), 2e-4, 1e-2), ("pose", (0, 30, 2), 2e-5, 1e-1), ("pose", (0, 22, 0), 2e-5, 1e-1),
                              ("transl", (0, 1), 2e-4, 1e-2), ("expression", (0, 3), 2e-5, 1), ("betas", (2,), 2e-4, 1)):
        moved = getattr(poses, name)[at] - start[name][at]
        slope = (pushed(name, at, h) - pushed(name, at, -h)) / (2 * h)
        assert moved == pytest.approx(-rate * slope / (abs(slope) + 1e-8), rel=0.02), name
    assert not poses.pose[:, 23:25].any()
    np.testing.assert_allclose(poses.expression[0], other.detach(), atol=1e-9)


def test_the_jaw_opens_the_mouth_as_it_is_learned_and_as_it_is_written():
    poses = made_poses(1)
    before = poses.vertices(0)
    poses.pose[0, 22, 0] += 0.2
    poses.forget_expressions()
    opened = poses.vertices(0)
    assert np.abs(opened - before).max() > 1e-3
    np.testing.assert_allclose(poses.body.posed(poses.to_params())[0][0], opened, atol=1e-5)


def test_a_round_ends_with_its_last_batch_once_more_and_what_fills_none_is_left_out():
    found = batches.draw_batches(11, 4, 60, 500, seed=3)
    again = batches.draw_batches(11, 4, 60, 500, seed=3)
    assert all(np.array_equal(a, b) for a, b in zip(found, again, strict=True))
    for step in range(0, 60, 3):
        assert len(set(found.order[step:step + 2].flat)) == 8
        if step + 2 < 60:
            np.testing.assert_array_equal(found.order[step + 2], found.order[step + 1])
            np.testing.assert_array_equal(found.background[step + 2], found.background[step + 1])
    assert len(np.unique(found.background.reshape(-1, 3), axis=0)) == 4 * 40 and found.centre.max() < 500
    assert (batches.draw_batches(2, 2, 5, 9, 0).order.sum(1) == 1).all()


def test_a_frame_lies_in_the_middle_of_its_square_and_what_can_show_the_person_is_kept():
    pixels = np.zeros((50, 30, 4), np.uint8)
    pixels[10:40, 5:25] = np.arange(30)[:, None, None] + 50
    view = View(Camera((40.0, 40.0), (15.0, 25.0), 30, 50), pixels, (0, 0))
    vertices = np.array([[-0.9, 0.0, 1.0], [0.1, 0.2, 1.0], [5.0, 5.0, -1.0]])  # the first is beside the frame, the last behind us
    assert square.side_of([view]) == 50
    found = square.square_crop(view, 50, vertices)
    (x, y), (h, w) = found.corner, found.pixels.shape[:2]
    np.testing.assert_allclose(found.camera.project(vertices[:2]) + (x, y), view.camera.project(vertices[:2]) + (10, 0))
    assert x == 0 and x + w == 35 + 12 and (y, y + h) == (0, 50) and (found.camera.width, found.camera.height) == (w, h)
    np.testing.assert_array_equal(found.pixels[10 - y:40 - y, 15 - x:35 - x], pixels[10:40, 5:25])
    assert found.pixels.sum() == pixels.sum()
    of_crop = square.square_crop(view.crop(3, 8, 27, 44), square.side_of([view.crop(3, 8, 27, 44)]), vertices)
    assert (of_crop.camera, of_crop.corner) == (found.camera, found.corner)
    np.testing.assert_array_equal(of_crop.pixels, found.pixels)


class Squares:
    """A network whose distance is a weighed sum of squares, so that places matter."""

    @staticmethod
    def weights(shape):
        return np.arange(np.prod(shape), dtype=np.float32).reshape(shape) / np.prod(shape)

    def gradient(self, image, target, scaled):
        assert not scaled, "the paper's code hands its images over as they are"
        weights = self.weights(image.shape)
        return float((weights * (image - target) ** 2).sum()), 2 * weights * (image - target)


@pytest.mark.parametrize("centre", [(150.0, 140.7), (-3.0, 0.0), (400.0, 300.0), (399.0, 5.0)])
def test_the_perceptual_window_is_the_published_one_of_the_whole_square(centre):
    rng = np.random.default_rng(5)
    background, corner, side = rng.random(3).astype(np.float32), (90, 30), 400
    image, target = rng.random((2, 200, 120, 3)).astype(np.float32)
    picture = Picture(image, image[..., 0], np.zeros((200, 120, 4), np.uint8), background, corner, side)
    gradient = np.ones_like(image)
    value = perceptual(Squares(), image, target, picture, np.array(centre), 0.5, gradient)
    frame = np.tile(background, (2, 400, 400, 1))
    frame[:, 30:230, 90:210] = image, target
    x, y = (haha.window(c, side) for c in centre)
    window = np.s_[y:y + 256, x:x + 256]
    expected, slopes = Squares().gradient(*(part[window] for part in frame), False)
    assert value == pytest.approx(0.5 * expected, rel=1e-4) and value > 0
    on_square = np.zeros((400, 400, 3))
    on_square[window] = slopes
    np.testing.assert_allclose(gradient, 1 + 0.5 * on_square[30:230, 90:210], rtol=1e-5)


def test_a_square_smaller_than_the_window_is_seen_whole():
    assert [window_begin(c, side) for side in (200, 256, 257) for c in (0.0, 100.0, 300.0)] == [0] * 9
    assert window_begin(300.0, 258) == 1


def test_a_perceptual_window_beside_the_person_costs_nothing():
    gradient = np.zeros((10, 10, 3), np.float32)
    image = np.ones_like(gradient)
    picture = Picture(image, image[..., 0], np.zeros((10, 10, 4), np.uint8), np.zeros(3), (900, 0), 1000)
    assert perceptual(Squares(), image, 0 * image, picture, np.zeros(2), 1.0, gradient) == 0
    assert not gradient.any()


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
    for name in ("expression", "jaw_pose"):
        assert 0 < np.abs(after[name] - before[name]).max() < 60 * 2e-5 * 1.5


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
    seen, h5 = [], networks["lpips-vgg"].parent / "hed.h5"
    write_hed(h5)
    np.savez(h5.with_suffix(".npz"), **vgg_hed.convert(h5))
    features = {vgg_hed.NAME: h5.with_suffix(".npz")}
    for name, models, lpips in (("with", networks, "loss"), ("judged", networks, "judge"), ("without", {}, "loss"),
                                ("features", features, "vgg-hed")):
        made = job(name, frames=6, recipe="paper", steps=2, pose_test_steps=2, lpips=lpips)
        made.models = models
        run(made)
        seen.append(json.loads((made.out / "metrics.json").read_text()))
    one, judged, two, three = seen
    assert judged["lpips_vgg"] > 0 and not judged["lpips_in_loss"] and judged["curve"][0]["loss"] == two["curve"][0]["loss"]
    assert one["lpips_in_loss"] and not two["lpips_in_loss"]
    assert one["lpips"] == one["lpips_alex"] > 0 and one["lpips_net"] == "lpips-alex" and one["lpips_vgg_ttpo"] > 0
    assert one["lpips_alex_unscaled"] != one["lpips_alex"] and all(row["lpips_vgg"] > 0 for row in one["heldout"])
    assert one["curve"][0]["loss"] > two["curve"][0]["loss"]
    assert three["vgg_hed_in_loss"] and not three["lpips_in_loss"] and three["curve"][0]["loss"] > two["curve"][0]["loss"]
    assert three["vgg_hed"] > 0 and three["vgg_hed_ttpo"] > 0 and all(row["vgg_hed"] > 0 for row in three["heldout"])
    assert three["lpips"] is None and not any("vgg_hed" in name for name in one)
    assert two["lpips"] is two["lpips_net"] is two["lpips_vgg"] is two["lpips_ttpo"] is None
