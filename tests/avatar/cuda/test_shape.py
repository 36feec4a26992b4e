"""Expression and joints at rest learned on the GPU, and frames in other expressions, against the CPU path."""

from types import SimpleNamespace

import numpy as np
import pytest

from gsac.avatar.cuda import why_not

pytestmark = pytest.mark.skipif(why_not() is not None, reason=f"CUDA path: {why_not()}")


@pytest.fixture
def both():
    """both(batch): a CudaTrainer and the task of a CPU trainer, over the same frames with expressions of their own."""
    from gsac.avatar.body import Body, BodyParams
    from gsac.avatar.cuda.trainer import CudaTrainer
    from gsac.benchmarks.gpu.synthetic_clip import figure, start
    from gsac.stages.train.config import TrainConfig
    from gsac.stages.train.fast.cuda import limits_at_joints, make_recipe
    from gsac.stages.train.fast.schedule import shortest_axis
    from gsac.stages.train.gaussians.joint_limits import find_growth
    from gsac.stages.train.gpu import body_arrays
    from gsac.stages.train.poses.poses import Poses

    opened = []

    def make(batch=1, steps=20, expression_rate=1e-2, joint_rate=1e-3):
        made, body = figure(4, 101, 67, 3000), Body.load()
        camera, pose = made.shots[0].camera, made.pose.copy()
        pose[:, 22] = 0
        expression = np.random.default_rng(1).random((4, body.exprdirs.shape[2])) * 0.2
        params = BodyParams.from_pose(pose, made.transl, np.zeros(body.num_betas), expression, camera.focal, camera.center)
        config = TrainConfig(steps=steps, joint_rate=joint_rate)
        poses, trained = Poses(body, params), np.arange(4)
        task = SimpleNamespace(config=config, poses=poses, trained=trained, views=made.shots, growth=find_growth(poses, trained))
        gaussians = start(made.body, 3000)
        recipe = make_recipe(config, 3000, batch=batch, offset_rate=0.0, least=shortest_axis(task),
                             expression_rate=expression_rate, **limits_at_joints(task, 3000))
        arrays = body_arrays(task.poses, task.trained, recipe)
        trainer = CudaTrainer(arrays, [made.shots], task.poses.pose, task.poses.transl, gaussians, recipe)
        opened.append(trainer)
        return trainer, task, made, gaussians

    yield make
    for trainer in opened:
        trainer.close()


@pytest.mark.parametrize("batch", [1, 3])
def test_expression_and_joints_take_the_vertices_gradient_as_on_the_cpu(both, batch):
    from gsac.benchmarks.gpu.check import relative
    from gsac.stages.train.poses.poses import adam_move

    trainer, task, _, _ = both(batch)
    trainer.poison()
    trainer.train(1)
    poses, config, joints, moments = task.poses, task.config, np.zeros((55, 3)), np.zeros((2, *task.poses.expression.shape))
    for t, grad in zip(trainer.order[0].tolist(), trainer.buffers["grad_vertices"].read(), strict=True):
        grad_rest, grad_joints = poses.step(t, grad / batch, config.pose_rate, config.pose_pull)
        poses.expression[t] -= adam_move(moments[:, t], 1, poses.expression_gradient(grad_rest), trainer.recipe.expression_rate)
        joints += grad_joints
    poses.step_joints(joints, config.joint_rate, config.pose_pull)
    found = {"expression": relative(trainer.buffers["expression_first"].read(), moments[0]),
             "joints": relative(trainer.buffers["joint_first"].read(), poses.joint_moments[0])}
    assert max(found.values()) < 1e-3 and np.linalg.norm(poses.joint_moments[0]) > 0, found
    assert relative(trainer.expressions(), poses.expression) < 0.02 and relative(trainer.joint_offset(), poses.joint_offset) < 0.02
    np.testing.assert_allclose(trainer.buffers["joints"].read(), poses.rest(0)[1], atol=2e-5)
    trainer.train(1)
    b = 0
    t = int(trainer.order[1, b])
    worn = trainer.buffers["worn"].read()[b]
    before = trainer.body.rest[trainer.body.rest_of[t]]
    moved = poses.body.exprdirs @ poses.expression[t] if t in trainer.order[0] else np.zeros_like(before)
    np.testing.assert_allclose(worn - before, moved, atol=2e-5)


def test_joints_that_are_learned_through_a_training_follow_the_cpus(both):
    from gsac.benchmarks.gpu.check import relative
    from gsac.stages.train.fast.trainer import Step, Trainer
    from gsac.stages.train.views import View

    trainer, task, made, gaussians = both(steps=24, expression_rate=0.0)
    cpu, backgrounds, losses = Trainer(gaussians, task), trainer.buffers["background"].read()[:, 0], []
    cpu.offsets = None
    for step in range(24):
        t = int(trainer.order[step, 0])
        losses += cpu.learn([Step(t, View(made.shots[t].camera, made.shots[t].pixels, (0, 0)), step / 24, backgrounds[step], step)])
    trainer.train(24)
    np.testing.assert_allclose(trainer.losses()[:, 0], losses, rtol=0.02)
    assert relative(trainer.joint_offset(), task.poses.joint_offset) < 0.2 and np.abs(trainer.joint_offset()).max() > 5e-4


def test_a_frame_wears_the_expression_that_it_is_given_midway(both):
    from gsac.stages.train.gpu import rest_shapes

    trainer, task, _, _ = both(expression_rate=0.0, joint_rate=0.0)
    trainer.train(1)
    poses, t = task.poses, int(trainer.order[1, 0])
    before = poses.vertices(t)
    poses.wear_expression(t, np.full(poses.body.exprdirs.shape[2], 0.3))
    trainer.wear(rest_shapes(poses, task.trained, poses.offset))
    trainer.place(poses.pose, poses.transl)
    trainer.train(1)
    np.testing.assert_allclose(trainer.buffers["vertices"].read()[0], poses.vertices(t), atol=2e-5)
    assert np.abs(poses.vertices(t) - before).max() > 5e-3
