"""A number that is not finite stops the training wherever it comes up, with step and quantity; never a silent bad avatar."""

import numpy as np
import pytest

from gsac.avatar.threads import Workspace
from gsac.stages.contract import StageError
from gsac.stages.train.fast import trainer as fast
from gsac.stages.train.fast.initial_gaussians import crop_views, init_gaussians
from gsac.stages.train.finite import require_finite
from gsac.stages.train.judge import heldout
from gsac.stages.train.paper import trainer as paper
from gsac.stages.train.paper.body_adam import BodyAdam
from gsac.stages.train.poses import bundle_adjust
from gsac.stages.train.poses.photometric import NormalEquations
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.stage import run
from gsac.stages.train.views import View, of_each


def spoiled(monkeypatch, owner, name, spoil, at=3):
    """`owner.name` as it is, but from call `at` on its result or its arguments go through `spoil`."""
    plain, calls = getattr(owner, name), []

    def wrapped(*arguments):
        calls.append(arguments)
        result = plain(*arguments)
        return spoil(result, *arguments) if len(calls) >= at else result

    monkeypatch.setattr(owner, name, wrapped)


def nan_in(array):
    array.flat[array.size // 2] = np.nan


def quiet(**more):
    return {"steps": 5, "holdout": 0, "pose_rounds": 0} | more


def bad_vertices(grads, *arguments):
    nan_in(grads.vertices)
    return grads


def bad_value(name):
    def spoil(result, trainer, *arguments):
        nan_in(trainer.values[name])
        return result
    return spoil


def bad_pose(result, poses, t, *arguments):
    nan_in(poses.pose[t])
    return result


def bad_body(name):
    def spoil(result, adam, *arguments):
        nan_in(getattr(adam.poses, name))
    return spoil


def bad_adam(result, value, *arguments):
    nan_in(value)


@pytest.mark.parametrize("owner, name, spoil, words", [
    (fast, "render_bound_backward", bad_vertices, "gradient of vertices is not finite at step [23]"),
    (fast.Trainer, "_move", bad_value("mu"), "mu is not finite after step 3"),
    (fast.Trainer, "_move", bad_value("opacity_logit"), "opacity_logit is not finite after step 3"),
    (Poses, "step", bad_pose, r"pose of frame \d is not finite after step 3")])
def test_recipe_fast_stops_with_step_and_quantity(job, monkeypatch, owner, name, spoil, words):
    spoiled(monkeypatch, owner, name, spoil)
    with pytest.raises(StageError, match=words):
        run(job(frames=2, **quiet()))


@pytest.mark.slow
@pytest.mark.parametrize("owner, name, spoil, words", [
    (paper, "bind_backward", bad_vertices, "gradient of vertices is not finite at step 1"),
    (paper, "adam", bad_adam, "mu is not finite after step 0"),
    (BodyAdam, "step", bad_body("pose"), r"pose of frame \d is not finite after step 2"),
    (BodyAdam, "step", bad_body("betas"), "betas is not finite after step 2")])
def test_recipe_paper_stops_with_step_and_quantity(job, monkeypatch, owner, name, spoil, words):
    spoiled(monkeypatch, owner, name, spoil)
    with pytest.raises(StageError, match=words):
        run(job(frames=2, **quiet(recipe="paper")))


def test_the_rounds_of_poses_stop(job, monkeypatch):
    def bad_equations(normal, *arguments):
        return NormalEquations(normal.gradient * np.nan, *normal[1:])

    spoiled(monkeypatch, bundle_adjust, "normal_equations", bad_equations)
    with pytest.raises(StageError, match="poses' equations are not finite"):
        run(job(frames=8, **quiet(pose_rounds=2)))


def test_a_frame_that_cannot_be_judged_or_aligned_stops_instead_of_being_left_out_of_the_mean(job, monkeypatch):
    made = []
    monkeypatch.setattr("gsac.stages.train.stage.RECIPES", {("fast", "cpu"): made.append})
    with pytest.raises(AttributeError):  # nothing is trained: all that is wanted is the task
        run(job(frames=2, **quiet()))
    task = made[0]
    gaussians = init_gaussians(task, of_each(View.halved, crop_views(task)), 300)
    poses = task.poses.copy()
    assert len(heldout.judge(gaussians, poses, [0], task.views)) == 1
    with monkeypatch.context() as patch:
        spoiled(patch, heldout, "render_bound_backward", bad_vertices)
        with pytest.raises(StageError, match="gradient of frame 1 is not finite at step 2 of its pose at test time"):
            heldout.align_pose(gaussians, poses, 1, task.views[1], 5, Workspace())
    nan_in(poses.transl[1])
    with pytest.raises(StageError, match="translation of frame 1 is not finite when it is judged"):
        heldout.judge(gaussians, poses, [0, 1], task.views)


def test_what_comes_out_is_looked_at_once_more(job, monkeypatch):
    spoiled(monkeypatch, fast.Trainer, "finish", lambda result, *arguments: (nan_in(result[0].rgb), result)[1], at=1)
    with pytest.raises(StageError, match="rgb is not finite after the last step"):
        run(job(frames=2, **quiet(steps=2)))


def test_none_and_what_is_finite_pass():
    require_finite("now", {"a": None, "b": 1.0, "c": np.zeros(3), "d": np.zeros((0, 3))})
    with pytest.raises(StageError, match="c is not finite now"):
        require_finite("now", {"b": 1.0, "c": np.array([0, np.inf])})
