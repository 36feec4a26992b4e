"""Recipe `fast` on the GPU, part by part and as a whole, against the CPU's."""

import numpy as np
import pytest

from gsac.avatar import rotation
from gsac.avatar.cuda import why_not

pytestmark = pytest.mark.skipif(why_not() is not None, reason=f"CUDA path: {why_not()}")
LIGHT = np.float32([[0.7, 0.8, 0.7], [0.5, 0.3, 0.3], [-0.2, 0, 0.1], [0.3, 0.2, 0.2]])


@pytest.fixture(scope="module")
def figure():
    from gsac.benchmarks.gpu.synthetic_clip import figure

    return figure(4, 101, 67, 3000)


@pytest.fixture
def one_at_a_time(monkeypatch):
    """The CPU works out one step at a time, as the GPU does, not two side by side."""
    from gsac.stages.train.fast import cpu, trainer

    for module in (cpu, trainer):
        monkeypatch.setattr(module, "AT_ONCE", 1)


@pytest.mark.parametrize("exposure", [False, True])
def test_a_whole_training_follows_the_recipe_of_the_cpu(figure, exposure):
    from dataclasses import replace
    from types import SimpleNamespace

    from gsac.avatar.body import Body, BodyParams
    from gsac.avatar.cuda.arrays import Shot
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu.check import relative
    from gsac.benchmarks.gpu.synthetic_clip import start
    from gsac.stages.train.config import TrainConfig
    from gsac.stages.train.fast.cuda import make_recipe
    from gsac.stages.train.fast.schedule import GAIN_RATE, OFFSET_SHARE, shortest_axis
    from gsac.stages.train.fast.trainer import Step, Trainer
    from gsac.stages.train.gaussians.cloth_offsets import fold
    from gsac.stages.train.poses.poses import Poses
    from gsac.stages.train.views import View

    still = replace(figure, pose=figure.pose.copy())
    still.pose[:, 22] = 0  # a jaw that turns would ask for expressions, which the figure does not wear
    body, steps = Body.load(), 80
    camera = figure.shots[0].camera
    if exposure:
        dim = np.array([0.9, 0.7, 0.8, 1])
        still.shots = [Shot(np.uint8(s.pixels * dim), camera) if t % 2 else s for t, s in enumerate(figure.shots)]
    params = BodyParams.from_pose(still.pose, still.transl, np.zeros(body.num_betas), np.zeros((4, len(body.expression_names))),
                                  camera.focal, camera.center)
    task = SimpleNamespace(config=TrainConfig(steps=steps, exposure=exposure), poses=Poses(body, params), trained=np.arange(4),
                           views=still.shots, growth=np.ones(len(body.faces)))
    gaussians = start(still.body, 2000)
    gaussians.light = LIGHT
    cpu, recipe = Trainer(gaussians, task), make_recipe(task.config, 2000, least=shortest_axis(task))
    cuda = CudaTrainer(still.body, [still.shots], task.poses.pose, task.poses.transl, gaussians, recipe)
    backgrounds, losses = cuda.buffers["background"].read()[:, 0], []
    for step in range(steps):
        if cpu.offsets and step / steps >= OFFSET_SHARE:
            cpu.fold_offsets()
        t = int(cuda.order[step, 0])
        shot = still.shots[t]
        losses += cpu.learn([Step(t, View(shot.camera, shot.pixels, (0, 0)), step / steps, backgrounds[step], step)])
    cuda.train(int(np.ceil(steps * OFFSET_SHARE)))
    cuda.replace(fold(cuda.gaussians(), still.body.rest[0], cuda.offset(), still.body.faces))
    cuda.train(steps)
    got, ours, theirs = cuda.losses()[:, 0], cuda.gaussians(), cpu.gaussians()
    pose, transl = cuda.poses()
    gains = cuda.gains()
    cuda.close()
    assert np.array_equal(ours.light, LIGHT)
    np.testing.assert_allclose(got, losses, rtol=0.02)
    if exposure:
        expected = np.array([cpu.gains[t] for t in range(4)])
        assert np.abs(expected - 1).max() > 5 * GAIN_RATE
        assert np.abs(gains - expected).max() < 2.5 * GAIN_RATE
    else:
        assert (gains == 1).all()
    assert relative(ours.rgb, theirs.rgb) < 0.02 and relative(ours.mu, theirs.mu) < 0.05
    moved = task.poses.pose - task.poses.fit_pose
    assert relative(pose - task.poses.fit_pose, moved) < 0.2 and relative(transl, task.poses.transl) < 1e-3


def test_poses_alone_are_moved_to_their_images_as_on_the_cpu_and_the_gaussians_stay(figure):
    from gsac.avatar.body import Body, BodyParams
    from gsac.benchmarks.gpu.check import relative
    from gsac.benchmarks.gpu.synthetic_clip import start
    from gsac.stages.train.fast.cpu import Cpu
    from gsac.stages.train.fast.cuda import Cuda
    from gsac.stages.train.poses.poses import Poses
    from gsac.stages.train.views import View

    body, camera = Body.load(), figure.shots[0].camera
    pose = figure.pose.copy()
    pose[:, 22] = 0
    params = BodyParams.from_pose(pose, figure.transl, np.zeros(body.num_betas), np.zeros((4, len(body.expression_names))),
                                  camera.focal, camera.center)
    views, gaussians, moved = [View(camera, shot.pixels, (0, 0)) for shot in figure.shots], start(figure.body, 3000), []
    gaussians.log_scale[:, 0] += 3  # beyond recipe fast's limits, which must not touch a finished avatar
    for backend in (Cuda(), Cpu()):
        poses = Poses(body, params)
        backend.align_poses(gaussians, poses, np.array([0, 1, 3]), views, 15)
        assert (poses.pose[2] == poses.fit_pose[2]).all() and (poses.transl[2] == poses.fit_transl[2]).all()
        moved.append((poses.pose - poses.fit_pose, poses.transl - poses.fit_transl))
    for got, expected in zip(*moved, strict=True):
        assert np.linalg.norm(expected) > 1e-3 and relative(got, expected) < 0.05


def turning(holdout=(), size=(101, 67), **values):
    """A task of 12 frames, 30 degrees from one to the next."""
    from gsac.avatar.body import Body, BodyParams
    from gsac.benchmarks.gpu.synthetic_clip import figure
    from gsac.stages.train.config import TrainConfig
    from gsac.stages.train.poses.poses import Poses
    from gsac.stages.train.task import Task
    from gsac.stages.train.views import View

    made, body = figure(12, *size, 3000), Body.load()
    camera, pose = made.shots[0].camera, made.pose.copy()
    pose[:, 22] = 0
    params = BodyParams.from_pose(pose, made.transl + [0.02, 0, 0], np.zeros(body.num_betas),
                                  np.zeros((12, len(body.expression_names))), camera.focal, camera.center)
    return Task([View(camera, shot.pixels, (0, 0)) for shot in made.shots], np.setdiff1d(np.arange(12), holdout), np.array(holdout),
                Poses(body, params), TrainConfig(**values), lambda *args: None)


def test_rounds_that_move_the_poses_end_as_with_the_cpus_learning(one_at_a_time):
    from gsac.benchmarks.gpu.check import relative
    from gsac.stages.train.fast import prealign
    from gsac.stages.train.fast.cpu import Cpu
    from gsac.stages.train.fast.cuda import Cuda

    found = []
    for backend in (Cuda(), Cpu()):
        task = turning((2, 7), pose_rounds=4)
        prealign.adjust(task, backend)
        found.append((task.poses.pose - task.poses.fit_pose, task.poses.transl - task.poses.fit_transl, task.poses.offset))
    for got, expected in zip(*found, strict=True):
        assert np.linalg.norm(expected) > 1e-3 and relative(got, expected) < 0.1


def test_what_no_frame_shows_is_laid_and_rests_and_the_avatar_is_as_good_as_the_cpus(monkeypatch):
    from gsac.stages.train.fast import schedule
    from gsac.stages.train.fast.cpu import Cpu
    from gsac.stages.train.fast.cuda import Cuda
    from gsac.stages.train.judge.heldout import judge

    monkeypatch.setattr(schedule, "LATE", dict.fromkeys(schedule.LATE, (0.45, 0.6, 0.75)))
    monkeypatch.setattr(schedule, "AVERAGED", dict.fromkeys(schedule.AVERAGED, 0.1))  # a fifth of so few steps is too old
    found = []
    for backend in (Cuda(), Cpu()):
        task = turning(size=(160, 240), steps=300, gaussians=3000)
        trainer, _, coarse = backend.train(task, 3000)
        gaussians, seen = trainer.finish(coarse)
        rows = judge(gaussians, task.poses, range(12), task.views)
        found.append((gaussians, seen, 10 * np.log10(1 / np.mean([row["mse_fg"] for row in rows]))))
    (ours, seen, quality), (theirs, expected, target) = found
    assert np.array_equal(ours.light, theirs.light) and (seen != expected).mean() < 0.02
    unseen = ~seen & ~expected
    assert unseen.sum() > 100
    np.testing.assert_array_equal(ours.quat[unseen], np.tile(np.float32([1, 0, 0, 0]), (unseen.sum(), 1)))
    assert abs(quality - target) < 0.3


def test_poses_of_all_frames_are_corrected_midway_as_on_the_cpu(one_at_a_time, monkeypatch):
    from gsac.benchmarks.gpu.check import relative
    from gsac.stages.train.fast import schedule
    from gsac.stages.train.fast.cpu import Cpu
    from gsac.stages.train.fast.cuda import Cuda
    from gsac.stages.train.judge.heldout import judge

    monkeypatch.setattr(schedule, "MIDWAY", 0.1)  # the CPU still sees half the size then, as of a large person
    monkeypatch.setattr(schedule, "LATE", {"cpu": (), "cuda": ()})
    found = []
    for backend in (Cuda(), Cpu()):
        task = turning((5,), steps=300, gaussians=2000)
        trainer, _, coarse = backend.train(task, 2000)
        poses, moved = task.poses, task.poses.base_pose - task.poses.fit_pose
        assert np.abs(moved[5]).max() > 1e-4  # a frame that is not trained on is corrected with those around it
        rows = judge(trainer.finish(coarse)[0], poses, task.trained, task.views)
        found.append((moved, poses.base_transl - poses.fit_transl, 10 * np.log10(1 / np.mean([row["mse_fg"] for row in rows]))))
    (pose, transl, quality), (expected_pose, expected_transl, target) = found
    assert relative(pose, expected_pose) < 0.3 and relative(transl, expected_transl) < 0.3
    assert abs(quality - target) < 0.4


def test_the_poses_equations_are_the_cpus_as_gaussians_surface_and_poses_move_and_the_same_bytes_each_time():
    from gsac.benchmarks.gpu.check import relative
    from gsac.stages.train.fast.cpu import Cpu
    from gsac.stages.train.fast.cuda import Cuda
    from gsac.stages.train.fast.initial_gaussians import init_gaussians

    task, random = turning((5,), size=(101, 130)), np.random.default_rng(0)
    poses, views = task.poses, {int(t): task.views[int(t)] for t in task.trained}
    gaussians = init_gaussians(task, views, 2500)
    gaussians.light = LIGHT
    with Cuda().open_equations(task, gaussians, views) as on_gpu, Cpu().open_equations(task, gaussians, views) as on_cpu:
        for _ in range(2):
            found, again, expected = on_gpu(gaussians), on_gpu(gaussians), on_cpu(gaussians)
            for (t, own), (_, same), (other, plain) in zip(found, again, expected, strict=True):
                assert t == other and abs(own.pixels - plain.pixels) < 3
                assert relative(own.gradient, plain.gradient) < 1e-3 and relative(own.hessian, plain.hessian) < 1e-3
                assert own.error == pytest.approx(plain.error, rel=1e-3)  # two pixels more or less count
                for one, two in zip(own, same, strict=True):
                    np.testing.assert_array_equal(one, two)
            poses.pose += random.normal(0, 0.02, poses.pose.shape)
            poses.transl += random.normal(0, 0.01, poses.transl.shape)
            poses.offset += np.float32(random.normal(0, 0.002, poses.offset.shape))
            gaussians.mu += np.float32(random.normal(0, 0.2, gaussians.mu.shape))


def test_single_frames_are_corrected_as_on_the_cpu():
    from gsac.benchmarks.gpu.check import relative
    from gsac.stages.train.fast.cpu import Cpu
    from gsac.stages.train.fast.cuda import Cuda
    from gsac.stages.train.fast.initial_gaussians import init_gaussians
    from gsac.stages.train.poses.own_errors import correct_each

    moved = []
    for backend in (Cuda(), Cpu()):
        task = turning((5,), size=(101, 130))
        poses, views = task.poses, {int(t): task.views[int(t)] for t in task.trained}
        gaussians = init_gaussians(task, views, 2500)
        with backend.open_equations(task, gaussians, views) as equations:
            correct_each(poses, task.trained, lambda gaussians=gaussians: gaussians, equations)
        turns = rotation.exp(poses.pose) @ rotation.exp(poses.fit_pose).swapaxes(-1, -2)
        moved.append((rotation.log(turns), poses.transl - poses.fit_transl))
    (turns, shifts), (expected_turns, expected_shifts) = moved
    assert np.abs(expected_shifts[task.trained]).max() > 1e-4
    assert relative(turns, expected_turns) < 0.01 and relative(shifts, expected_shifts) < 0.01


def test_steps_on_sides_that_no_frame_shows_move_gaussians_as_on_the_cpu(one_at_a_time):
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu.check import relative
    from gsac.stages.train.fast.cuda import POSES_STAY, make_recipe
    from gsac.stages.train.fast.initial_gaussians import init_gaussians
    from gsac.stages.train.fast.schedule import shortest_axis
    from gsac.stages.train.fast.trainer import Step, Trainer
    from gsac.stages.train.gpu import open_trainer
    from gsac.stages.train.poses.unseen_sides import SHARP

    task, steps = turning(range(4, 12), size=(160, 240), steps=24, gaussians=2000), 24
    views = {int(t): task.views[int(t)] for t in task.trained}
    gaussians = init_gaussians(task, views, 2000)
    cpu, looks = Trainer(gaussians, task, frozen_body=True), np.arange(steps) % len(task.sides)
    recipe = make_recipe(task.config, 2000, steps=steps, offset_rate=0.0, least=shortest_axis(task), sides=looks, sharp=SHARP,
                         **POSES_STAY)
    losses = []
    for number, at in enumerate(looks):
        t, turn, view = task.sides[at]
        losses += cpu.learn([Step(t, view, number / steps, np.ones(3), number, turn)])
    with open_trainer(CudaTrainer, task.poses, task.trained, [views], gaussians, recipe, None, task.sides) as cuda:
        cuda.train(steps)
        got, ours, pose = cuda.losses()[:, 0], cuda.gaussians(), cuda.poses()[0]
    theirs = cpu.gaussians()
    np.testing.assert_allclose(got, losses, rtol=0.02)
    for name, apart in (("mu", 0.05), ("log_scale", 0.05), ("quat", 0.15)):  # they begin round: what turns them is small at first
        before, one, other = (getattr(each, name) for each in (gaussians, ours, theirs))
        assert np.abs(other - before).max() > 1e-3 and relative(one - before, other - before) < apart
    np.testing.assert_allclose(ours.rgb, gaussians.rgb, atol=1e-6)
    np.testing.assert_array_equal(pose, task.poses.pose[task.trained])


def test_outlines_from_sides_that_no_frame_shows_become_as_sharp_as_on_the_cpu():
    from gsac.avatar.raster import render_bound
    from gsac.avatar.threads import Workspace
    from gsac.stages.train.fast.cpu import Cpu
    from gsac.stages.train.fast.cuda import Cuda
    from gsac.stages.train.poses.unseen_sides import turned_vertices

    def blur(backend, looks):
        task = turning(range(4, 12), size=(160, 240), steps=300, gaussians=2000)
        sides = task.sides
        assert len(sides) > 8
        if not looks:
            task.sides = []
        trainer, _, coarse = backend.train(task, 2000)
        gaussians = trainer.finish(coarse)[0]
        faces = task.poses.body.faces
        alphas = [render_bound(turned_vertices(task.poses, t, turn), faces, gaussians, view.camera, Workspace()).alpha
                  for t, turn, view in sides]
        return sum(float((alpha * (1 - alpha)).sum()) for alpha in alphas)

    without, on_gpu, on_cpu = blur(Cuda(), False), blur(Cuda(), True), blur(Cpu(), True)
    assert on_gpu < 0.95 * without and on_gpu == pytest.approx(on_cpu, rel=0.1)
