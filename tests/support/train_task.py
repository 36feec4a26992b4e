"""The task of a training over a job's inputs, for tests of what moves poses."""

import numpy as np

from gsac.avatar.artifacts import Clip
from gsac.avatar.body import Body, BodyParams
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.task import Task
from gsac.stages.train.views import read_views

TRUE_SHIFT = 0.03
"""m by which the fit that the job's inputs hold stands too far right."""


def task_of(made, held=()):
    """The task of a made job; held: frames that are not trained on."""
    params = BodyParams.read(made.inputs["smplx/body.npz"])
    clip = Clip.read(made.inputs["split/clip.json"])
    views, _ = read_views(made.inputs["split/frames"], made.inputs["segment/alpha"], params.camera(clip.width, clip.height), 128)
    trained = np.setdiff1d(np.arange(params.frames), held)
    return Task(views, trained, np.array(held, int), Poses(Body.load(), params), made.config, lambda *a: None)
