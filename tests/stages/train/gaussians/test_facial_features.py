from dataclasses import replace

import numpy as np
import pytest

from gsac.avatar.body import Body
from gsac.stages.train.fast.initial_gaussians import init_gaussians
from gsac.stages.train.gaussians.facial_features import DENSER, density_on_head
from gsac.stages.train.gaussians.inner_faces import find_inner
from gsac.stages.train.views import person_crop
from support.train_task import task_of


@pytest.fixture(scope="module")
def body():
    return Body.load()


def test_mouth_and_brows_are_denser_than_the_body_and_the_inside_of_the_head_is_empty(body):
    density, centres = density_on_head(body, np.zeros(4)), body.v_template[body.faces].mean(1)
    moves = np.linalg.norm(body.exprdirs, axis=1).max(1)[body.faces].mean(1)
    inner = find_inner(body.v_template, body.faces)
    assert (density[inner] == 0).all()
    assert (density[~inner & (moves > 0.01)] == DENSER).all() and (~inner & (moves > 0.01)).sum() > 500
    trunk = centres[:, 1] < body.v_template[:, 1].max() - 0.35
    assert density[trunk].max() == 1 and (density[trunk] == 1).mean() > 0.999


def test_a_body_without_expressions_has_no_features(body):
    for still in (body.exprdirs[..., :0], np.zeros_like(body.exprdirs)):
        assert set(density_on_head(replace(body, exprdirs=still), np.zeros(4)).tolist()) == {0, 1}


def test_a_training_begins_with_no_gaussian_inside_of_the_head_and_as_many_as_asked_for(job):
    task = task_of(job(), held=(3, 8))
    views = {int(t): person_crop(task.views[t]).halved() for t in task.trained}
    gaussians = init_gaussians(task, views, 3000)
    inner = find_inner(task.poses.body.rest(task.poses.betas)[0], task.poses.body.faces)
    assert len(gaussians) == 3000 and not inner[gaussians.face].any()
    assert np.isfinite(gaussians.log_scale).all()
