"""The CUDA trainer: what holds without a GPU, and, where there is one, that it does what the CPU path does."""

import ctypes
import shutil
import subprocess
import sys

import numpy as np
import pytest
from gsac.avatar.cuda import lists, scene, why_not
from gsac.avatar.cuda.recipe import Recipe, draw

gpu = pytest.mark.skipif(why_not() is not None, reason=f"CUDA path: {why_not()}")
LIGHT = np.float32([[0.7, 0.8, 0.7], [0.5, 0.3, 0.3], [-0.2, 0, 0.1], [0.3, 0.2, 0.2]])


def fast(count=12000, **more):
    """Recipe `fast` without the displaced surface."""
    from gsac.stages.train.config import TrainConfig
    from gsac.stages.train.cuda import recipe_of

    return recipe_of(TrainConfig(), count, **({"offset_rate": 0.0} | more))


def test_importing_the_cuda_path_loads_nothing_heavy():
    code = ("import sys, gsac.avatar.cuda, gsac.avatar.cuda.recipe, gsac.avatar.cuda.kernels; "
            "print([m for m in ('torch', 'numba', 'cuda', 'cuda.bindings') if m in sys.modules])")
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == "[]"


@pytest.mark.skipif(why_not() is None, reason="there is a GPU here")
def test_without_a_gpu_the_device_says_why_it_cannot_be_used():
    from gsac.avatar.cuda.device import Device, NoDeviceError

    with pytest.raises(NoDeviceError, match="GPU|driver|gsac\\[gpu\\]"):
        Device()


def test_structs_are_laid_out_alike_for_host_and_kernels(tmp_path):
    compiler = shutil.which("g++") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no gcc here: the structs' layout is not compiled")
    sizes = ", ".join(f"sizeof({name})" for name in ("Frame", "Plan", "State", "Scene"))
    text = scene.declarations() + f"\n#include <cstddef>\nextern \"C\" void sizes(int *out) {{ int all[] = {{{sizes}, " \
        "(int)offsetof(Scene, ssim), (int)offsetof(Frame, fx)}; for (int i = 0; i < 6; ++i) out[i] = all[i]; }"
    (tmp_path / "sizes.cpp").write_text(text)
    subprocess.run([compiler, "-shared", "-fPIC", "-o", tmp_path / "sizes.so", tmp_path / "sizes.cpp"], check=True)
    out = (ctypes.c_int * 6)()
    ctypes.CDLL(str(tmp_path / "sizes.so")).sizes(out)
    assert list(out) == [*(ctypes.sizeof(getattr(scene, name)) for name in ("Frame", "Plan", "State", "Scene")),
                         scene.Scene.ssim.offset, scene.Frame.fx.offset]


def test_the_plan_draws_what_the_cpu_recipe_draws():
    drawn = draw(Recipe(steps=30, seed=5, coarse_share=0.5, mu_rate=1.5e-3), 7, 2)
    random, left = np.random.default_rng(5), []
    for step in range(30):
        if not left:
            left = list(random.permutation(7))
        assert drawn.order[step, 0] == left.pop()
        np.testing.assert_array_equal(drawn.background[step, 0], random.random(3).astype(np.float32))
    assert (drawn.rates["level"] == np.repeat([0, 1], 15)).all()
    np.testing.assert_allclose(drawn.rates["mu"], 1.5e-3 * 0.01 ** (np.arange(30) / 30), rtol=1e-6)


def test_a_recipe_that_is_told_nothing_learns_nothing_counts_nothing_and_limits_nothing():
    plain = Recipe(steps=3)
    drawn = draw(plain, 2, 1)
    assert (drawn.rates["centre"] == -1).all()
    assert not any(drawn.rates[name].any() for name in drawn.rates.dtype.names if name != "centre")
    assert (plain.ssim, plain.sobel, plain.mask, plain.pose_pull) == (0, 0, 0, 0)
    assert np.isinf([plain.needle, plain.largest, plain.reach]).all()


def test_plans_of_the_other_trainers_hold_their_frames_and_rates():
    from types import SimpleNamespace

    from gsac.avatar.cuda.align import Aligner, AlignRecipe
    from gsac.avatar.cuda.paper import PaperRecipe, PaperTrainer
    from gsac.avatar.cuda.rounds import Round, RoundsRecipe, RoundsTrainer

    def plan(kind, recipe, frames):
        return kind.plan(SimpleNamespace(recipe=recipe, frames=frames), [None])

    still = plan(Aligner, AlignRecipe(steps=12, pose_rate=1e-3, pose_end=0.05), 3)
    assert still.order[:, 0].tolist() == [0] * 4 + [1] * 4 + [2] * 4 and (still.background == 1).all()
    np.testing.assert_allclose(still.rates["pose"], np.tile(1e-3 * 0.05 ** (np.arange(4) / 4), 3), rtol=1e-6)
    assert not any(still.rates[name].any() for name in ("mu", "quat", "log_scale", "rgb", "opacity", "offset", "place_pull"))

    grounds = np.random.default_rng(0).random((2, 3, 3))
    rounds = [Round(np.array([2, 0, 1]), grounds[0], 0.0), Round(np.array([1, 2, 0]), grounds[1], 0.3)]
    found = plan(RoundsTrainer, RoundsRecipe(steps=6, mu_rate=1.5e-3, offset_rate=1e-3, offset_share=0.6, gain_rate=2e-3,
                                              rounds=rounds), 3)
    assert found.order[:, 0].tolist() == [2, 0, 1, 1, 2, 0] and not found.rates["pose"].any()
    np.testing.assert_allclose(found.background[:, 0], grounds.reshape(-1, 3), rtol=1e-6)
    np.testing.assert_allclose(found.rates["mu"], np.repeat([1.5e-3, 1.5e-3 * 0.01**0.3], 3), rtol=1e-6)
    np.testing.assert_allclose(found.rates["offset"], np.repeat([1e-3, 1e-3 * 0.1**0.5], 3), rtol=1e-6)
    np.testing.assert_allclose(found.rates["gain"], np.repeat([2e-3, 2e-3 * 0.1**0.3], 3), rtol=1e-6)

    found = plan(PaperTrainer, PaperRecipe(steps=10, batch=4, mu_rate=1e-4, mu_decay=0.01, rgb_rate=5e-3, beta_rate=2e-4), 6)
    assert found.order.shape == (10, 4) and (found.rates["rgb"] == np.float32(5e-3)).all() and (found.rates["betas"] > 0).all()
    np.testing.assert_allclose(found.rates["mu"], 1e-4 * 0.01 ** (np.arange(10) / 10), rtol=1e-6)


def test_a_step_never_holds_a_frame_twice():
    order = draw(Recipe(steps=50, batch=4), 6, 1).order
    assert all(len(set(row)) == 4 for row in order)
    assert draw(Recipe(steps=2, batch=4), 3, 1).order.shape == (2, 3)


def test_lists_hold_every_corner_weight_and_child_once():
    random = np.random.default_rng(0)
    faces, face = random.integers(0, 9, (20, 3)), random.integers(0, 20, 50)
    start, item = lists.vertices_of(faces, face, 9)
    assert sorted(item) == list(range(150))
    for v in range(9):
        mine = item[start[v]:start[v + 1]]
        assert (faces[face].reshape(-1)[mine] == v).all() and (np.diff(mine) > 0).all()
    index, weight = random.integers(0, 5, (30, 4)), random.random((30, 4)) * (random.random((30, 4)) > 0.3)
    start, vertex, kept = lists.joints_of(index, weight, 5)
    for j in range(5):
        np.testing.assert_allclose(kept[start[j]:start[j + 1]].sum(), weight[index == j].sum())
    assert start[-1] == (weight != 0).sum() and len(vertex) == start[-1]
    start, child = lists.children(np.array([-1, 0, 0, 1, 3]))
    assert [list(child[start[j]:start[j + 1]]) for j in range(5)] == [[1, 2], [3], [], [4], []]
    assert list(lists.joint_levels(np.array([-1, 0, 0, 1, 3]))) == [0, 1, 1, 2, 3]


@pytest.fixture(scope="module")
def figure():
    from gsac.benchmarks.gpu.figure import figure

    return figure(4, 101, 67, 3000)


@gpu
@pytest.mark.parametrize("count", [1, 17, 1000, 100000])
@pytest.mark.parametrize("weights", [{"ssim": 0.1, "sobel": 0.1}, {"ssim": 0.0, "sobel": 0.0, "mask": 0.0}])
@pytest.mark.parametrize("light", [None, LIGHT])
def test_image_loss_and_gradients_are_those_of_the_cpu_path(figure, count, weights, light):
    from gsac.benchmarks.gpu.check import LIMIT, errors
    from gsac.benchmarks.gpu.figure import start

    gaussians = start(figure.body, count)
    gaussians.light = light
    found, _ = errors(figure, gaussians, fast(count, steps=1, **weights))
    assert max(found.values()) < LIMIT, found


@gpu
def test_gaussians_behind_the_camera_and_without_opacity_are_skipped_as_on_the_cpu(figure):
    from dataclasses import replace

    from gsac.benchmarks.gpu.check import LIMIT, errors
    from gsac.benchmarks.gpu.figure import start

    near = replace(figure, transl=figure.transl.copy())
    near.transl[:, 2] = 0.1
    gaussians = start(figure.body, 3000)
    gaussians.opacity[::3] = 0
    found, _ = errors(near, gaussians, fast(3000, steps=1))
    assert max(found.values()) < LIMIT, found


@gpu
@pytest.mark.parametrize("batch", [1, 3])
def test_lists_too_short_grow_and_change_no_result_and_a_seed_gives_one_result(figure, batch):
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu.figure import start

    results = []
    for room in (100, None, None):
        trainer = CudaTrainer(figure.body, [figure.scaled(2), figure.shots], figure.pose, figure.transl, start(figure.body, 2000),
                              fast(2000, steps=43, batch=batch, sobel=0.1), pair_room=room)
        trainer.poison()
        trainer.train(17)
        trainer.train(100)
        assert trainer.state().step == 43
        g, (pose, transl) = trainer.gaussians(), trainer.poses()
        results.append([g.mu, g.quat, g.log_scale, g.rgb, g.opacity, pose, transl, trainer.losses()])
        trainer.close()
    for a, b, c in zip(*results, strict=True):
        assert np.isfinite(a).all()
        np.testing.assert_array_equal(a, b)
        np.testing.assert_array_equal(b, c)


@gpu
def test_training_lowers_the_loss_and_moves_the_poses_towards_the_truth(figure):
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu.figure import start

    trainer = CudaTrainer(figure.body, [figure.shots], figure.pose, figure.transl, start(figure.body, 4000),
                          fast(4000, steps=400, pose_pull=0))
    trainer.train(400)
    losses, (_, transl) = trainer.losses()[:, 0], trainer.poses()
    trainer.close()
    assert losses[-40:].mean() < 0.4 * losses[:40].mean()
    assert np.abs(transl - figure.true_transl)[:, :2].mean() < np.abs(figure.transl - figure.true_transl)[:, :2].mean()


@gpu
def test_offsets_are_those_of_the_cpu_recipe(figure):
    from types import SimpleNamespace

    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu.check import relative
    from gsac.benchmarks.gpu.figure import start
    from gsac.stages.train.offsets import Offsets

    body = figure.body
    offsets = Offsets(SimpleNamespace(faces=body.faces, v_template=body.rest[0], skin_index=body.skin_index,
                                      skin_weight=body.skin_weight))
    trainer = CudaTrainer(body, [figure.shots], figure.pose, figure.transl, start(body, 3000),
                          fast(3000, steps=20, offset_rate=1e-3))
    for step in range(20):
        trainer.train(1)
        rate = float(trainer.rates["offset"][step])
        assert (rate > 0) == (step < 12)
        if rate:
            offsets.gather(trainer.buffers["grad_rest"].read()[0].astype(np.float64), rate)
        if step == 3:
            assert relative(trainer.offset(), offsets.offset) < 2e-2
    assert np.abs(offsets.offset).max() > 1e-4
    assert relative(trainer.offset(), offsets.offset) < 2e-2
    plain = trainer.gaussians()
    trainer.replace(plain)
    assert not trainer.offset().any()
    trainer.close()


@gpu
def test_gradient_at_rest_is_that_of_the_cpu_path(figure):
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.avatar.skinning import skin_backward
    from gsac.benchmarks.gpu.check import relative
    from gsac.benchmarks.gpu.figure import start

    body = figure.body
    trainer = CudaTrainer(body, [figure.shots], figure.pose, figure.transl, start(body, 3000),
                          fast(3000, steps=4, offset_rate=1e-3))
    trainer.train(1)
    t = int(trainer.order[0, 0])
    vertices, at_rest = (trainer.buffers[name].read()[0] for name in ("grad_vertices", "grad_rest"))
    trainer.close()
    expected = skin_backward(vertices, figure.pose[t], body.rest[0], body.joints, body.parents, body.skin_index,
                             body.skin_weight)[2]
    assert np.linalg.norm(expected) > 0 and relative(at_rest, expected) < 1e-5


@gpu
def test_many_gaussians_on_one_tile_are_sorted_beyond_the_fast_path(figure):
    from dataclasses import replace

    from gsac.benchmarks.gpu.check import LIMIT, errors
    from gsac.benchmarks.gpu.figure import start

    far = replace(figure, transl=figure.transl.copy())
    far.transl[:, 2] = 60
    found, _ = errors(far, start(figure.body, 20000), fast(20000, steps=1))
    assert max(found.values()) < LIMIT, found


@gpu
@pytest.mark.parametrize("exposure", [False, True])
def test_a_whole_training_follows_the_recipe_of_the_cpu(figure, exposure):
    from dataclasses import replace
    from types import SimpleNamespace

    from gsac.avatar.body import Body, BodyParams
    from gsac.avatar.cuda.trainer import CudaTrainer, Shot
    from gsac.benchmarks.gpu.check import relative
    from gsac.benchmarks.gpu.figure import start
    from gsac.stages.train.config import TrainConfig
    from gsac.stages.train.cuda import recipe_of
    from gsac.stages.train.fast import GAIN_RATE, OFFSET_SHARE, Trainer
    from gsac.stages.train.offsets import fold
    from gsac.stages.train.poses import Poses
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
    task = SimpleNamespace(config=TrainConfig(steps=steps, exposure=exposure), poses=Poses(body, params), trained=np.arange(4))
    gaussians = start(still.body, 2000)
    gaussians.light = LIGHT
    cpu, recipe = Trainer(gaussians, task), recipe_of(task.config, 2000)
    cuda = CudaTrainer(still.body, [still.shots], task.poses.pose, task.poses.transl, gaussians, recipe)
    backgrounds, losses = cuda.buffers["background"].read()[:, 0], []
    for step in range(steps):
        if cpu.offsets and step / steps >= OFFSET_SHARE:
            cpu.fold_offsets()
        t = int(cuda.order[step, 0])
        shot = still.shots[t]
        losses.append(cpu.step(t, View(shot.camera, shot.pixels, (0, 0)), step / steps, backgrounds[step], step))
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


@gpu
def test_poses_alone_are_moved_to_their_images_as_on_the_cpu_and_the_gaussians_stay(figure):
    from gsac.avatar.body import Body, BodyParams
    from gsac.benchmarks.gpu.check import relative
    from gsac.benchmarks.gpu.figure import start
    from gsac.stages.train import cuda, evaluate
    from gsac.stages.train.poses import Poses
    from gsac.stages.train.views import View

    body, camera = Body.load(), figure.shots[0].camera
    pose = figure.pose.copy()
    pose[:, 22] = 0
    params = BodyParams.from_pose(pose, figure.transl, np.zeros(body.num_betas), np.zeros((4, len(body.expression_names))),
                                  camera.focal, camera.center)
    views, gaussians, moved = [View(camera, shot.pixels, (0, 0)) for shot in figure.shots], start(figure.body, 3000), []
    gaussians.log_scale[:, 0] += 3  # beyond recipe fast's limits, which must not touch a finished avatar
    for align in (cuda.align_poses, evaluate.align_poses):
        poses = Poses(body, params)
        align(gaussians, poses, np.array([0, 1, 3]), views, 15)
        assert (poses.pose[2] == poses.fit_pose[2]).all() and (poses.transl[2] == poses.fit_transl[2]).all()
        moved.append((poses.pose - poses.fit_pose, poses.transl - poses.fit_transl))
    for got, expected in zip(*moved, strict=True):
        assert np.linalg.norm(expected) > 1e-3 and relative(got, expected) < 0.05


def turning(holdout=(), size=(101, 67), **values):
    """A task of 12 frames, 30 degrees from one to the next."""
    from gsac.avatar.body import Body, BodyParams
    from gsac.benchmarks.gpu.figure import figure
    from gsac.stages.train.config import TrainConfig
    from gsac.stages.train.poses import Poses
    from gsac.stages.train.task import Task
    from gsac.stages.train.views import View

    made, body = figure(12, *size, 3000), Body.load()
    camera, pose = made.shots[0].camera, made.pose.copy()
    pose[:, 22] = 0
    params = BodyParams.from_pose(pose, made.transl + [0.02, 0, 0], np.zeros(body.num_betas),
                                  np.zeros((12, len(body.expression_names))), camera.focal, camera.center)
    return Task([View(camera, shot.pixels, (0, 0)) for shot in made.shots], np.setdiff1d(np.arange(12), holdout), np.array(holdout),
                Poses(body, params), TrainConfig(**values), lambda *args: None)


@gpu
def test_rounds_that_move_the_poses_end_as_with_the_cpus_learning():
    from gsac.benchmarks.gpu.check import relative
    from gsac.stages.train import bundle, cuda

    found = []
    for learning in (cuda.learning, bundle.learning_on_cpu):
        task = turning((2, 7), pose_rounds=4)
        bundle.adjust(task, learning)
        found.append((task.poses.pose - task.poses.fit_pose, task.poses.transl - task.poses.fit_transl, task.poses.offset))
    for got, expected in zip(*found, strict=True):
        assert np.linalg.norm(expected) > 1e-3 and relative(got, expected) < 0.1


@gpu
def test_what_no_frame_shows_is_laid_and_rests_and_the_avatar_is_as_good_as_the_cpus():
    from gsac.stages.train import cuda, fast
    from gsac.stages.train.evaluate import judge

    found = []
    for train in (cuda.train, fast.train):
        task = turning(size=(160, 240), steps=300, gaussians=3000)
        trainer, _, coarse = train(task, 3000)
        gaussians, seen = trainer.recoloured(coarse)
        rows = judge(gaussians, task.poses, range(12), task.views)
        found.append((gaussians, seen, 10 * np.log10(1 / np.mean([row["mse_fg"] for row in rows]))))
    (ours, seen, quality), (theirs, expected, target) = found
    assert np.array_equal(ours.light, theirs.light) and (seen != expected).mean() < 0.02
    unseen = ~seen & ~expected
    assert unseen.sum() > 100
    np.testing.assert_array_equal(ours.quat[unseen], np.tile(np.float32([1, 0, 0, 0]), (unseen.sum(), 1)))
    assert abs(quality - target) < 0.3


@gpu
def test_resting_gaussians_keep_their_values_while_the_others_learn(figure):
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu.figure import start

    trainer = CudaTrainer(figure.body, [figure.shots], figure.pose, figure.transl, start(figure.body, 1000), fast(1000, steps=20))
    trainer.train(5)
    resting, before = np.arange(1000) % 3 == 0, trainer.gaussians()
    trainer.replace(before, resting)
    trainer.train(15)
    after = trainer.gaussians()
    trainer.close()
    for name in ("mu", "quat", "log_scale", "rgb", "opacity"):
        moved = np.abs(getattr(after, name) - getattr(before, name)).reshape(1000, -1).max(1)
        assert moved[resting].max() < 1e-5 and np.median(moved[~resting]) > 1e-4, name


@gpu
def test_a_tighter_reach_holds_from_the_step_on_that_it_is_told(figure):
    from gsac.avatar.binding import face_frames
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu.figure import start

    trainer = CudaTrainer(figure.body, [figure.shots], figure.pose, figure.transl, start(figure.body, 1000), fast(1000, steps=60))
    trainer.train(20)
    before, size = trainer.gaussians(), face_frames(figure.body.rest[0], figure.body.faces).k
    ways = []
    for reach in (None, 2e-4):
        trainer.replace(before, reach=reach)
        trainer.train(20)
        after = trainer.gaussians()
        ways.append((np.linalg.norm(after.mu - before.mu, axis=1) * size[after.face]).max())
    trainer.close()
    assert ways[0] > 4e-4 and 1.9e-4 < ways[1] < 2.1e-4


@gpu
def test_poses_of_all_frames_are_corrected_midway_as_on_the_cpu():
    from gsac.benchmarks.gpu.check import relative
    from gsac.stages.train import cuda, fast
    from gsac.stages.train.evaluate import judge

    found = []
    for train in (cuda.train, fast.train):
        task = turning((5,), steps=300, gaussians=2000)
        trainer, _, coarse = train(task, 2000)
        poses, moved = task.poses, task.poses.base_pose - task.poses.fit_pose
        assert np.abs(moved[5]).max() > 1e-4  # a frame that is not trained on is corrected with those around it
        rows = judge(trainer.recoloured(coarse)[0], poses, task.trained, task.views)
        found.append((moved, poses.base_transl - poses.fit_transl, 10 * np.log10(1 / np.mean([row["mse_fg"] for row in rows]))))
    (pose, transl, quality), (expected_pose, expected_transl, target) = found
    assert relative(pose, expected_pose) < 0.3 and relative(transl, expected_transl) < 0.3
    assert abs(quality - target) < 0.4


@gpu
def test_poses_that_are_placed_are_where_the_frames_are_pulled_and_their_moments_begin_anew(figure):
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu.figure import start

    trainer = CudaTrainer(figure.body, [figure.shots], figure.pose, figure.transl, start(figure.body, 1000),
                          fast(1000, steps=60, pose_pull=10.0))
    trainer.train(20)
    moved = figure.pose + 0.02, figure.transl + 0.01
    trainer.place(*moved)
    assert not trainer.buffers["pose_steps"].read().any() and not trainer.buffers["pose_second"].read().any()
    for placed, got in zip(moved, trainer.poses(), strict=True):
        np.testing.assert_array_equal(placed, got)
    trainer.train(40)
    ways = [np.abs(got - placed).max() for placed, got in zip(moved, trainer.poses(), strict=True)]
    trainer.close()
    assert 0 < max(ways) < 5e-3  # so strong a pull leaves little
