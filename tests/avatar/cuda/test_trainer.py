"""The CUDA trainer's steps: they do what the CPU path does, and the same bytes each time."""

import numpy as np
import pytest

from gsac.avatar.cuda import why_not
from gsac.avatar.draw_rule import ADDED

pytestmark = pytest.mark.skipif(why_not() is not None, reason=f"CUDA path: {why_not()}")
LIGHT = np.float32([[0.7, 0.8, 0.7], [0.5, 0.3, 0.3], [-0.2, 0, 0.1], [0.3, 0.2, 0.2]])


def fast(count=12000, **more):
    """Recipe `fast` without the displaced surface."""
    from gsac.stages.train.config import TrainConfig
    from gsac.stages.train.fast.cuda import make_recipe

    return make_recipe(TrainConfig(), count, **({"offset_rate": 0.0} | more))


@pytest.fixture(scope="module")
def figure():
    from gsac.benchmarks.gpu.synthetic_clip import figure

    return figure(4, 101, 67, 3000)


@pytest.mark.parametrize("count", [1, 17, 1000, 100000])
@pytest.mark.parametrize("weights", [{"ssim": 0.1, "sobel": 0.1}, {"ssim": 0.0, "sobel": 0.0, "mask": 0.0}])
@pytest.mark.parametrize("light", [None, LIGHT])
def test_image_loss_and_gradients_are_those_of_the_cpu_path(figure, count, weights, light):
    from gsac.benchmarks.gpu.check import LIMIT, errors
    from gsac.benchmarks.gpu.synthetic_clip import start

    gaussians = start(figure.body, count)
    gaussians.light = light
    found, _ = errors(figure, gaussians, fast(count, steps=1, **weights))
    assert max(found.values()) < LIMIT, found


def test_gaussians_behind_the_camera_and_without_opacity_are_skipped_as_on_the_cpu(figure):
    from dataclasses import replace

    from gsac.benchmarks.gpu.check import LIMIT, errors
    from gsac.benchmarks.gpu.synthetic_clip import start

    near = replace(figure, transl=figure.transl.copy())
    near.transl[:, 2] = 0.1
    gaussians = start(figure.body, 3000)
    gaussians.opacity[::3] = 0
    found, _ = errors(near, gaussians, fast(3000, steps=1))
    assert max(found.values()) < LIMIT, found


@pytest.mark.parametrize("batch", [1, 3])
def test_lists_too_short_grow_and_change_no_result_and_a_seed_gives_one_result(figure, batch):
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu.synthetic_clip import start

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


@pytest.mark.parametrize("late", ["blockIdx.x % 2 == 1", "blockIdx.x % 2 == 0"])
def test_blocks_that_come_late_out_of_a_wait_for_each_other_change_no_byte(figure, late, monkeypatch, tmp_path):
    """A GPU that others use too stops, and goes on with some blocks a little later than with others."""
    from gsac.avatar.cuda import kernels
    from gsac.avatar.cuda.device import Device
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu.synthetic_clip import start

    met, results = "while (seen < target);\n        }\n", []
    text = kernels.source()
    assert met in text
    for source in (text, text.replace(met, f"{met}        if ({late}) __nanosleep(4000);\n")):
        monkeypatch.setattr(kernels, "source", lambda source=source: source)
        monkeypatch.setenv("GSAC_CACHE", str(tmp_path))
        trainer = CudaTrainer(figure.body, [figure.shots], figure.pose, figure.transl, start(figure.body, 1000),
                              fast(1000, steps=40, offset_rate=1e-3), Device())
        trainer.train(40)
        results.append([trainer.buffers[name].read() for name in ("offset_second", "offset", "mu", "rgb", "pose", "losses")])
        trainer.close()
    assert np.abs(results[0][1]).max() > 1e-4
    for on_time, delayed in zip(*results, strict=True):
        np.testing.assert_array_equal(on_time, delayed)


def test_training_lowers_the_loss_and_moves_the_poses_towards_the_truth(figure):
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu.synthetic_clip import start

    trainer = CudaTrainer(figure.body, [figure.shots], figure.pose, figure.transl, start(figure.body, 4000),
                          fast(4000, steps=400, pose_pull=0))
    trainer.train(400)
    losses, (_, transl) = trainer.losses()[:, 0], trainer.poses()
    trainer.close()
    assert losses[-40:].mean() < 0.4 * losses[:40].mean()
    assert np.abs(transl - figure.true_transl)[:, :2].mean() < np.abs(figure.transl - figure.true_transl)[:, :2].mean()


def test_offsets_are_those_of_the_cpu_recipe(figure):
    from types import SimpleNamespace

    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu.check import relative
    from gsac.benchmarks.gpu.synthetic_clip import start
    from gsac.stages.train.gaussians.cloth_offsets import Offsets

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


def test_gradient_at_rest_is_that_of_the_cpu_path(figure):
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.avatar.skinning import skin_backward
    from gsac.benchmarks.gpu.check import relative
    from gsac.benchmarks.gpu.synthetic_clip import start

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


def test_many_gaussians_on_one_tile_are_sorted_beyond_the_fast_path(figure):
    from dataclasses import replace

    from gsac.benchmarks.gpu.check import LIMIT, errors
    from gsac.benchmarks.gpu.synthetic_clip import start

    far = replace(figure, transl=figure.transl.copy())
    far.transl[:, 2] = 60
    specks = replace(start(figure.body, 20000), low_pass=ADDED)  # the other low-pass makes them too faint to be drawn
    found, _ = errors(far, specks, fast(20000, steps=1))
    assert max(found.values()) < LIMIT, found


def test_resting_gaussians_keep_their_values_while_the_others_learn(figure):
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu.synthetic_clip import start

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


def test_a_tighter_reach_holds_from_the_step_on_that_it_is_told(figure):
    from gsac.avatar.binding import face_frames
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu.synthetic_clip import start

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


def test_poses_that_are_placed_are_where_the_frames_are_pulled_and_their_moments_begin_anew(figure):
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu.synthetic_clip import start

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
