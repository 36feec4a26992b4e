"""Recipe `paper` on the GPU, against the published formulas and the CPU path: every gradient of a step, neighbours, trainings."""

from types import SimpleNamespace

import numpy as np
import pytest

from gsac.avatar.cuda import why_not

pytestmark = pytest.mark.skipif(why_not() is not None, reason=f"CUDA path: {why_not()}")
LIMIT, SWAPS = 1e-3, 1e-3
ROWS = {"mu": slice(0, 3), "quat": slice(3, 7), "scale_logit": slice(7, 10), "rgb": slice(10, 13)}
"""Rows of Adam's moments on the device."""


@pytest.fixture(scope="module")
def figure():
    from gsac.benchmarks.gpu.synthetic_clip import figure

    return figure(5, 101, 67, 3000)


def task_of(figure, **values):
    """The figure's frames as a stage's task; betas off zero."""
    from gsac.avatar.body import Body, BodyParams
    from gsac.stages.train.config import TrainConfig
    from gsac.stages.train.poses.poses import Poses
    from gsac.stages.train.task import Task
    from gsac.stages.train.views import View

    body, camera = Body.load(), figure.shots[0].camera
    pose = figure.pose.copy()
    pose[:, 22] = 0
    params = BodyParams.from_pose(pose, figure.transl, np.linspace(-0.3, 0.3, body.num_betas),
                                  np.zeros((len(pose), len(body.expression_names))), camera.focal, camera.center)
    views = [View(shot.camera, shot.pixels, (0, 0)) for shot in figure.shots]
    return Task(views, np.arange(len(views)), np.arange(0), Poses(body, params), TrainConfig(recipe="paper", **values),
                lambda *args: None)


@pytest.fixture
def trainers(figure):
    """trainers(batch, steps): the same start in a PaperTrainer and in the CPU's Trainer, a step of the latter, and the views."""
    from gsac.avatar.cuda.paper import PaperGaussians, PaperTrainer
    from gsac.stages.train.gpu import open_trainer
    from gsac.stages.train.paper import cuda as paper_cuda
    from gsac.stages.train.paper import trainer

    opened = []

    def make(batch, steps, network=None, **values):
        task, other = (task_of(figure, steps=steps, **values) for _ in range(2))
        rng = np.random.default_rng(1)
        cpu = trainer.Trainer(other, rng)
        shape = {name: v.shape for name, v in cpu.values.items()}
        cpu.values = {"mu": rng.normal(0, 0.1, shape["mu"]), "quat": rng.normal(size=shape["quat"]),
                      "scale_logit": rng.normal(-1.5, 0.7, shape["scale_logit"]), "rgb": rng.normal(0.5, 0.3, shape["rgb"])}
        cpu.values = {name: v.astype(np.float32) for name, v in cpu.values.items()}
        v, start = cpu.values, paper_cuda.init_gaussians(len(cpu.face), rng)
        recipe = paper_cuda.make_recipe(task)
        recipe.batch = batch
        for name in ("order", "background", "centre"):
            setattr(recipe, name, np.ascontiguousarray(getattr(recipe, name)[:, :batch]))
        recipe.counts[:] = True  # the places' gradients of the first steps too
        views = trainer.crop_views(task)
        gaussians = PaperGaussians(cpu.face, v["mu"], v["quat"], v["scale_logit"], v["rgb"], start.opacity)
        context = open_trainer(PaperTrainer, task.poses, task.trained, [views], gaussians, recipe, network)
        cuda = context.__enter__()
        opened.append(context)

        def step(number, of):
            order, background, centre = (part[number] for part in (recipe.order, recipe.background, recipe.centre))
            return cpu.step({int(t): views[int(t)] for t in order}, of, steps, background, centre)

        return cuda, cpu, step, views

    yield make
    for context in opened:
        context.__exit__(None, None, None)


@pytest.mark.parametrize("batch, text", [(1, False), (4, False), (4, True)])
def test_every_gradient_of_a_step_is_that_of_the_cpu_path(trainers, batch, text):
    from gsac.benchmarks.gpu.check import relative

    cuda, cpu, step, _ = trainers(batch, 110, paper_text=text)
    cuda.poison()
    cuda.train(1)
    moves = {}
    cpu.body = SimpleNamespace(step=moves.update)
    loss = step(0, 101)  # a step that counts
    assert cuda.state().step == 1 and abs(cuda.losses()[0].mean() - loss) < 1e-5 * loss
    # from empty moments the first step leaves a tenth of the gradient in them
    first, leave = cuda.buffers["first"].read(), int(SWAPS * cuda.count)
    found = {name: relative(first[rows].T, cpu.first[name], leave) for name, rows in ROWS.items()}
    length, hits = cuda.pulls()
    found |= {"pulls": relative(length, cpu.densifier.length, leave),
              "vertices": relative(cuda.buffers["grad_vertices"].read().reshape(-1, 3) / batch,
                                   np.concatenate([moves[t] for t in cuda.order[0].tolist()]), 3 * batch * leave)}
    assert max(found.values()) < LIMIT, found
    assert (hits != cpu.densifier.hits).mean() < SWAPS


def drawn_frames(cuda, views, name):
    """(h, w, 4) each: what buffer `name`, image or grad_image, holds of the last step's frames; zero where no gaussian reaches."""
    out = []
    for b, t in enumerate(cuda.order[cuda.state().step - 1]):
        h, w = views[int(t)].pixels.shape[:2]
        rows, columns, s = -(-h // 16), -(-w // 16), cuda.scene
        reached = cuda.buffers["tile_count"].read()[b * s.max_tiles:][: rows * columns].reshape(rows, columns) > 0
        reached = np.repeat(np.repeat(reached, 16, 0), 16, 1)[:h, :w, None]
        out.append(np.where(reached, cuda.buffers[name].read()[b * s.max_pixels:][: h * w].reshape(h, w, 4), 0))
    return out


@pytest.mark.parametrize("text", [False, True], ids=["code", "text"])
def test_loss_and_gradient_of_the_images_are_the_published_ones(trainers, text):
    """Of the images as this GPU drew them."""
    import torch

    from gsac.benchmarks.gpu.published import formulas as haha

    cuda, cpu, _, views = trainers(4, 4, paper_text=text)
    cuda.poison()
    cuda.train(1)
    boxes, side = [], cpu.side
    drawn, pixels = np.zeros((2, 4, side, side, 4))
    for b, (t, image) in enumerate(zip(cuda.order[0], drawn_frames(cuda, views, "image"), strict=True)):
        (x, y), (h, w) = views[int(t)].corner, image.shape[:2]
        boxes.append(np.s_[b, y:y + h, x:x + w])
        drawn[boxes[-1]], pixels[boxes[-1]] = image, views[int(t)].pixels / 255
    rgb, alpha = (torch.tensor(part, requires_grad=True) for part in (drawn[..., :3], drawn[..., 3]))
    pixels = torch.tensor(pixels)
    ground = torch.tensor(cuda.recipe.background[0]).double()
    expected = haha.image_losses(rgb, alpha, pixels[..., :3], pixels[..., 3], ground, text)
    expected.backward()
    pulled = cuda.buffers["pull_value"].read().mean() / 2.0**60
    assert cuda.losses()[0].mean() - pulled == pytest.approx(expected.item(), rel=1e-5)
    for box, slope in zip(boxes, drawn_frames(cuda, views, "grad_image"), strict=True):
        wanted = torch.cat([rgb.grad[box], alpha.grad[box][..., None]], -1).numpy() * 4  # a frame's own, not the mean's
        wanted = np.where((slope != 0).any(2, keepdims=True), wanted, 0)
        for part in (np.s_[..., :3], np.s_[..., 3]):
            assert np.linalg.norm(slope[part] - wanted[part]) < 1e-4 * np.linalg.norm(wanted[part])


def test_lpips_of_a_window_of_every_frame_is_in_loss_and_gradient(trainers):
    from gsac.avatar.cuda import perceptual
    from gsac.avatar.lpips import Lpips, shapes
    from gsac.stages.train.paper.losses import Picture
    from gsac.stages.train.paper.losses import perceptual as on_cpu
    from gsac.stages.train.task import LPIPS_WEIGHT

    if why := perceptual.why_not():
        pytest.skip(why)
    rng = np.random.default_rng(0)
    network = Lpips("lpips-vgg", {own: np.float32(rng.random(shape) if own.startswith("lin") else rng.normal(size=shape) * (
        0.1 if len(shape) == 1 else np.sqrt(2 / np.prod(shape[1:])))) for own, shape in shapes("lpips-vgg").items()})
    (cuda, cpu, _, views), (without, *_) = trainers(3, 4, network), trainers(3, 4)
    for each in (cuda, without):
        each.poison()
        each.train(1)
    windows, images = cuda.windows, drawn_frames(cuda, views, "image")
    slopes, plain = drawn_frames(cuda, views, "grad_image"), drawn_frames(without, views, "grad_image")
    for b, t in enumerate(cuda.order[0]):
        view, ground, seen = views[int(t)], cuda.recipe.background[0, b], []

        class Kept:
            def gradient(self, *shown, scaled, b=b, seen=seen):
                seen.extend(shown)
                return float(windows.values[b]), windows.slopes[b].cpu().numpy()

        pixels = view.pixels.astype(np.float32) / np.float32(255)
        render, target = (part[..., :3] + (1 - part[..., 3:]) * ground for part in (images[b], pixels))
        centre = view.camera.project(cuda.buffers["vertices"].read()[b, cuda.recipe.centre[0, b]]) + view.corner
        picture = Picture(images[b][..., :3], images[b][..., 3], view.pixels, ground, view.corner, cpu.side)
        expected = np.zeros_like(render)
        value = on_cpu(Kept(), render, target, picture, centre, LPIPS_WEIGHT, expected)
        np.testing.assert_allclose(windows.images[b].cpu().numpy(), seen, atol=2e-6)
        assert float(windows.values[b]) == pytest.approx(network.distance(*seen, scaled=False), rel=1e-4)
        assert cuda.losses()[0, b] - without.losses()[0, b] == pytest.approx(value, rel=1e-3) and value > 0
        found = slopes[b][..., :3] - plain[b][..., :3]
        expected = np.where((slopes[b] != 0).any(2, keepdims=True), expected, 0)
        assert np.linalg.norm(found - expected) < 1e-3 * np.linalg.norm(expected) > 0
    cuda.train(3)
    assert cuda.state().step == 4 and np.isfinite(cuda.losses()).all()


def test_value_and_gradient_of_the_neighbour_term_are_the_published_ones(trainers):
    import torch

    from gsac.benchmarks.gpu.published import formulas as haha

    cuda, cpu, _, _ = trainers(2, 4)
    start = {name: value.copy() for name, value in cuda.values().items()}
    cuda.train(1)
    n = cuda.count
    for b in range(2):
        index = torch.tensor(cuda.buffers["nearest_gaussian"].read()[b]).long()
        vertices = torch.tensor(cuda.buffers["vertices"].read()[b].astype(float))
        posed = haha.posed(vertices, torch.tensor(cpu.faces).long(), torch.tensor(cuda.face).long(),
                           *(torch.tensor(start[name].astype(float)) for name in ("mu", "quat", "scale_logit")))
        parts = [part.detach().requires_grad_() for part in (*posed, torch.tensor(start["rgb"].astype(float)))]
        squares = ((parts[0][index] - parts[0][:, None]) ** 2).sum(-1)
        expected = haha.KNN * (sum(values[index].std(dim=1).mean() for values in parts[1:]) + squares.mean())
        expected.backward()
        pull = cuda.buffers["pull"].read()[b] / 2.0**60
        assert cuda.buffers["pull_value"].read()[b] / 2.0**60 == pytest.approx(expected.item(), rel=1e-5)
        for columns, leaf in zip((np.s_[:3], np.s_[3:7], np.s_[7:10], np.s_[10:]), parts, strict=True):
            wanted = leaf.grad.numpy()
            assert pull.shape == (n, 13) and np.linalg.norm(pull[:, columns] - wanted) < 1e-4 * np.linalg.norm(wanted)


@pytest.mark.parametrize("batch", [1, 4])
def test_what_is_learned_of_the_body_takes_the_vertices_gradient_as_on_the_cpu(trainers, batch):
    """From the GPU's own gradient of the vertices: the sums also hold the gaussians that lie at one depth and swap."""
    from gsac.benchmarks.gpu.check import relative

    cuda, cpu, _, _ = trainers(batch, 10)
    cuda.poison()
    cuda.train(1)
    frames = cuda.order[0].tolist()
    cpu.body.step({t: grad / np.float32(batch) for t, grad in zip(frames, cuda.buffers["grad_vertices"].read(), strict=True)})
    got, expected = cuda.buffers["pose_first"].read()[frames], cpu.body.pose[0][frames]
    size = cpu.body.expression.shape[2]
    expression = cuda.buffers["expression_first"].read()[frames]
    limbs = np.arange(55) != 22  # this jaw's turn is three expressions
    found = {"pose": relative(got[:, :-1][:, limbs], expected[:, :-1][:, limbs]), "transl": relative(got[:, -1], expected[:, -1]),
             "betas": relative(cuda.buffers["beta_first"].read(), cpu.body.betas[0]),
             "expression": relative(expression[:, :size], cpu.body.expression[0][frames]),
             "jaw": relative(expression[:, size:], expected[:, 22])}
    assert max(found.values()) < 1e-4, found
    poses = cpu.poses
    np.testing.assert_allclose(cuda.betas(), poses.betas - poses.params.betas, rtol=0.01)
    learned = cuda.expressions()[frames]
    np.testing.assert_allclose(learned[:, :size], poses.expression[frames], rtol=0.01, atol=1e-8)
    np.testing.assert_allclose(learned[:, size:], poses.pose[frames, 22] - poses.fit_pose[frames, 22], rtol=0.01, atol=1e-8)
    vertices, joints = poses.body.rest(poses.betas)
    np.testing.assert_allclose(cuda.body.rest[0] + cuda.buffers["offset"].read(), vertices, atol=1e-6)
    np.testing.assert_allclose(cuda.buffers["joints"].read(), joints, rtol=0, atol=5e-6)  # sums over 13,718 vertices in float32


def test_the_neighbours_are_the_nearest_as_posed_and_stay_so_while_gaussians_move_and_grow(trainers):
    from scipy.spatial import cKDTree

    def are_nearest():
        for b in range(2):
            places, index = cuda.buffers["posed"].read()[b, :, :3], cuda.buffers["nearest_gaussian"].read()[b]
            expected = cKDTree(places).query(places, k=3)[0]
            found = np.sort(np.linalg.norm(places[index] - places[:, None], axis=2), axis=1)
            np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-6)
            assert all(len(set(row)) == 3 for row in index[::97])

    cuda, _, _, _ = trainers(2, 40)
    for until in (1, 2, 30):
        cuda.train(until - cuda.state().step)
        are_nearest()
    face = np.concatenate([cuda.face, cuda.face[:1001]])
    cuda.grow(face, {name: np.concatenate([v, v[:1001] + np.float32(0.01)]) for name, v in cuda.values().items()})
    cuda.train(3)
    are_nearest()
    assert cuda.state().step == 33 and np.isfinite(cuda.losses()).all()


def test_forty_steps_follow_the_cpu_path(trainers):
    from gsac.benchmarks.gpu.check import relative

    cuda, cpu, step, _ = trainers(3, 40)
    cuda.train(40)
    losses = [step(number, number) for number in range(40)]
    np.testing.assert_allclose(cuda.losses().mean(1), losses, rtol=0.01)
    ours, theirs = cuda.gaussians(), cpu.gaussians()
    for name in ("mu", "log_scale", "rgb"):
        assert relative(getattr(ours, name), getattr(theirs, name)) < 0.02, name
    params = cpu.poses.params
    moved, learned = cpu.poses.betas - params.betas, cuda.betas()
    assert np.linalg.norm(moved) > 1e-3 and relative(learned, moved) < 0.1
    assert relative(cuda.poses()[1] - cpu.poses.fit_transl, cpu.poses.transl - cpu.poses.fit_transl) < 0.1
    assert np.abs(cuda.offset()).max() < 1e-5  # what moved the body is in the betas


def test_a_whole_training_grows_and_ends_as_on_the_cpu_and_a_seed_gives_one_result(figure):
    from gsac.stages.train.judge.heldout import judge
    from gsac.stages.train.paper import cuda as paper_cuda
    from gsac.stages.train.paper import trainer

    def quality(fit, task):
        rows = judge(fit.gaussians, task.poses, range(5), task.views)
        return 10 * np.log10(1 / np.mean([row["mse_fg"] for row in rows]))

    tasks = [task_of(figure, steps=340) for _ in range(3)]
    ours, again, theirs = paper_cuda.fit(tasks[0]), paper_cuda.fit(tasks[1]), trainer.fit(tasks[2])
    assert len(ours.gaussians) > len(tasks[0].poses.body.faces)
    for name in ("face", "mu", "quat", "log_scale", "rgb", "opacity"):
        np.testing.assert_array_equal(getattr(ours.gaussians, name), getattr(again.gaussians, name))
    np.testing.assert_array_equal(tasks[0].poses.betas, tasks[1].poses.betas)
    poses, betas = tasks[0].poses, tasks[0].poses.betas
    worn = poses.body.rest(betas, poses.expression[0] + poses.body.jaw_actions @ poses.pose[0, 22])[0]
    np.testing.assert_allclose(poses.rest(0)[0], worn, atol=1e-6)  # the poses wear what was learned
    assert 0 < np.abs(poses.expression).max() < 340 * 2e-5 * 1.5
    assert np.abs(betas - tasks[0].poses.params.betas).max() > 1e-3
    assert abs(len(ours.gaussians) / len(theirs.gaussians) - 1) < 0.03
    assert abs(quality(ours, tasks[0]) - quality(theirs, tasks[2])) < 0.3
