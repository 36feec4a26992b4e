"""The start of recipe `fast`: views cropped to the person, gaussians spread over the body and coloured from the frames."""

from __future__ import annotations

import numpy as np

from gsac.avatar.binding import bind, face_frames
from gsac.avatar.gaussians import Gaussians
from gsac.stages.train.gaussians.cloth_offsets import fold
from gsac.stages.train.gaussians.detail import find_detail
from gsac.stages.train.gaussians.first_colours import PosedFrame, fill_unseen, find_light, mean_colours, read_sights
from gsac.stages.train.task import Task
from gsac.stages.train.views import View, of_each, person_crop

COLOUR_FRAMES = 24
"""Most frames that the first colours are read from."""


def crop_views(task: Task) -> dict[int, View]:
    """The trained frames, cropped to the person."""
    return of_each(person_crop, {int(t): task.views[t] for t in task.trained})


def init_gaussians(task: Task, coarse: dict[int, View], count: int) -> Gaussians:
    """`count` gaussians spread over the first frame's body by area, detail, growth and facial features, coloured from the
    frames; folds in the surface's offset.

    coarse: frame -> view at half the size.
    """
    faces, offset = task.poses.body.faces, task.poses.offset
    plain = task.poses.rest(int(task.trained[0]))[0]
    rest = plain + offset
    every = -(-len(task.trained) // COLOUR_FRAMES)
    frames = [PosedFrame(task.poses.vertices(int(t)), coarse[int(t)].camera, coarse[int(t)].pixels)
              for t in task.trained[::every]]
    density = find_detail(frames, rest, faces, task.config.seed) * task.density
    gaussians = Gaussians.area(rest, faces, count, task.config.seed, density=density)
    sights = read_sights(frames, faces, gaussians)
    places = centres_at_rest(gaussians, rest, faces)
    gaussians.light = find_light(sights, places) if task.config.light else None
    rgb, seen = mean_colours(sights, count, gaussians.light)
    gaussians.rgb = fill_unseen(rgb, seen, places)
    if offset.any():
        gaussians, task.poses.offset = fold(gaussians, plain, offset, faces), np.zeros_like(offset)
    return gaussians


def centres_at_rest(gaussians: Gaussians, rest: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(N, 3) m, centres of the gaussians on the body at rest. rest: (V, 3) m; faces: (F, 3)."""
    return bind(face_frames(rest, faces), gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale).means
