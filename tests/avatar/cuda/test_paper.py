"""Recipe `paper` on the GPU: every gradient of a step, the neighbours, whole trainings, against the CPU path."""

from types import SimpleNamespace

import numpy as np
import pytest

from gsac.avatar.cuda import why_not

pytestmark = pytest.mark.skipif(why_not() is not None, reason=f"CUDA path: {why_not()}")
LIMIT, SWAPS = 1e-3, 1e-3


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
    """trainers(batch, steps): the same start in a PaperTrainer and in the CPU's Trainer, and the CPU's views."""
    from gsac.avatar.cuda.paper import PaperGaussians, PaperTrainer
    from gsac.stages.train.gpu import open_trainer
    from gsac.stages.train.paper import cuda as paper_cuda
    from gsac.stages.train.paper import trainer
    from gsac.stages.train.views import person_crop

    opened = []

    def make(batch, steps):
        task, other = task_of(figure, steps=steps), task_of(figure, steps=steps)
        rng = np.random.default_rng(1)
        cpu = trainer.Trainer(other, rng)
        shape = {name: v.shape for name, v in cpu.values.items()}
        cpu.values = {"mu": rng.normal(0, 0.1, shape["mu"]), "quat": rng.normal(size=shape["quat"]),
                      "scale_logit": rng.normal(-1.5, 0.7, shape["scale_logit"]), "rgb": rng.normal(0.5, 0.3, shape["rgb"])}
        cpu.values = {name: v.astype(np.float32) for name, v in cpu.values.items()}
        v, start = cpu.values, paper_cuda.init_gaussians(len(cpu.face), rng)
        recipe = paper_cuda.make_recipe(task)
        recipe.batch = batch
        views = {t: person_crop(view) for t, view in enumerate(task.views)}
        gaussians = PaperGaussians(cpu.face, v["mu"], v["quat"], v["scale_logit"], v["rgb"], start.opacity)
        context = open_trainer(PaperTrainer, task.poses, task.trained, [views], gaussians, recipe)
        cuda = context.__enter__()
        opened.append(context)
        cpu.rng = SimpleNamespace(random=iter(cuda.buffers["background"].read().reshape(-1, 3)).__next__)
        cpu.rng.random = lambda n, draw=cpu.rng.random: draw()
        return cuda, cpu, views

    yield make
    for context in opened:
        context.__exit__(None, None, None)


@pytest.mark.parametrize("batch", [1, 4])
def test_every_gradient_of_a_step_is_that_of_the_cpu_path(trainers, batch):
    from gsac.avatar.cuda.paper import ROWS
    from gsac.benchmarks.gpu.check import relative

    cuda, cpu, views = trainers(batch, 10)
    cuda.poison()
    cuda.train(1)
    cpu.neighbours.index = cuda.buffers["nearest_gaussian"].read().astype(np.int64)
    frames, moves, step = cuda.order[0].tolist(), {}, cpu.poses.step
    cpu.poses.step = lambda t, grad, *rest: step(t, moves.setdefault(t, grad), *rest)
    loss = cpu.step({t: views[t] for t in frames}, 1, 10)  # not step 0, which would search the neighbours again
    assert cuda.state().step == 1 and abs(cuda.losses()[0].mean() - loss) < 1e-5 * loss
    # from empty moments the first step leaves a tenth of the gradient in them
    first, leave = cuda.buffers["first"].read(), int(SWAPS * cuda.count)
    found = {name: relative(first[rows].T, cpu.first[name], leave) for name, rows in ROWS.items()}
    length, hits = cuda.pulls()
    found |= {"pulls": relative(length, cpu.densifier.length, leave),
              "vertices": relative(cuda.buffers["grad_vertices"].read().reshape(-1, 3) / batch,
                                   np.concatenate([moves[t] for t in frames]), 3 * batch * leave)}
    assert max(found.values()) < LIMIT, found
    assert (hits != cpu.densifier.hits).mean() < SWAPS


@pytest.mark.parametrize("batch", [1, 4])
def test_poses_and_betas_take_the_vertices_gradient_as_on_the_cpu(trainers, batch):
    """From the GPU's own gradient of the vertices: the poses' sums also hold the gaussians that lie at one depth and swap."""
    from gsac.benchmarks.gpu.check import relative

    cuda, cpu, _ = trainers(batch, 10)
    cuda.poison()
    cuda.train(1)
    frames, betas = cuda.order[0].tolist(), np.zeros(len(cpu.poses.betas))
    for t, grad in zip(frames, cuda.buffers["grad_vertices"].read(), strict=True):
        betas += cpu.poses.shape_gradient(*cpu.poses.step(t, grad, 2e-4, 0.0)) / batch
    cpu.poses.step_betas(betas, 2e-4)
    got, expected = cuda.buffers["pose_first"].read()[frames], cpu.poses.moments[0][frames]
    found = {"pose": relative(got[:, :-1], expected[:, :-1]), "transl": relative(got[:, -1], expected[:, -1]),
             "betas": relative(cuda.buffers["beta_first"].read(), cpu.poses.beta_moments[0])}
    assert np.linalg.norm(betas) > 0 and max(found.values()) < 1e-4, found
    np.testing.assert_allclose(cuda.betas(), cpu.poses.betas - cpu.poses.params.betas, rtol=0.01)
    vertices, joints = cpu.poses.body.rest(cpu.poses.betas)
    np.testing.assert_allclose(cuda.body.rest[0] + cuda.buffers["offset"].read(), vertices, atol=1e-6)
    np.testing.assert_allclose(cuda.buffers["joints"].read(), joints, rtol=0, atol=5e-6)  # sums over 13,718 vertices in float32


def test_the_neighbours_are_the_nearest(trainers):
    from scipy.spatial import cKDTree

    cuda, _, _ = trainers(2, 4)
    cuda.train(1)
    face = np.concatenate([cuda.face, cuda.face[:1001]])
    cuda.grow(face, {name: np.concatenate([v, v[:1001] + np.float32(0.01)]) for name, v in cuda.values().items()})
    cuda._find_neighbours()
    places, index = cuda.buffers["place"].read(), cuda.buffers["nearest_gaussian"].read()
    expected = cKDTree(places).query(places, k=3)[0]
    found = np.sort(np.linalg.norm(places[index] - places[:, None], axis=2), axis=1)
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-6)
    start, back = cuda.buffers["near_of_start"].read(), cuda.buffers["near_of"].read()
    for i in (0, 17, len(face) - 1):
        assert sorted(back[start[i]:start[i + 1]]) == sorted(np.flatnonzero((index == i).any(1)))
    cuda.train(3)
    assert cuda.state().step == 4 and np.isfinite(cuda.losses()).all()


def test_forty_steps_follow_the_cpu_path(trainers):
    from gsac.benchmarks.gpu.check import relative

    cuda, cpu, views = trainers(3, 40)
    cuda.train(40)
    losses = [cpu.step({int(t): views[int(t)] for t in cuda.order[step]}, step, 40) for step in range(40)]
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
    body, betas = tasks[0].poses.body, tasks[0].poses.betas
    np.testing.assert_allclose(tasks[0].poses.rest(0)[0], body.rest(betas)[0], atol=1e-6)  # the poses wear what was learned
    assert np.abs(betas - tasks[0].poses.params.betas).max() > 1e-3
    assert abs(len(ours.gaussians) / len(theirs.gaussians) - 1) < 0.03
    assert abs(quality(ours, tasks[0]) - quality(theirs, tasks[2])) < 0.3
