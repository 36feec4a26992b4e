"""Colours of what the frames show little of: a figure in a red shirt and dark trousers, filmed from the front alone."""

from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial import KDTree

from gsac.avatar.binding import face_frames
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.camera import Camera
from gsac.avatar.draw_rule import ADDED
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.light import shade
from gsac.avatar.rotation import about_y, log
from gsac.avatar.threads import Workspace
from gsac.stages.train.config import TrainConfig
from gsac.stages.train.fast.initial_gaussians import centres_at_rest
from gsac.stages.train.fast.trainer import Trainer
from gsac.stages.train.gaussians.barely_seen import hold_barely_seen
from gsac.stages.train.gaussians.shown import find_seen, front_pixels
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.task import Task
from gsac.stages.train.views import View

YAWS = np.radians([-8, 0, 8])
SHIRT, TROUSERS = ([0.6, 0.10, 0.2], [0.8, 0.14, 0.27]), ([0.1, 0.10, 0.15], [0.14, 0.14, 0.2])
LIGHT = np.tile([[0.85], [0.04], [0.0], [0.1]], 3).astype(np.float32)


class Filmed(NamedTuple):
    trainer: Trainer
    views: dict[int, View]
    at: np.ndarray
    """(N, 3) m at rest."""
    normals: np.ndarray
    """(N, 3) at rest."""
    facing: np.ndarray
    """(N,) cosine between the normal and the direction to the camera, the largest over the frames."""

    @property
    def shirt(self) -> np.ndarray:
        """(N,) bool; the other gaussians are the trousers'."""
        return self.at[:, 1] > np.median(self.trainer.rest[:, 1])

    @property
    def well(self) -> np.ndarray:
        """(N,) bool, whether frames show it well."""
        return self.trainer.seen & (self.facing > 0.5)

    @property
    def pixels(self) -> np.ndarray:
        """(N,) mean over the frames."""
        t, gaussians = self.trainer, self.trainer.gaussians()
        return np.mean([front_pixels(gaussians, t.poses.vertices(k), t.faces, view.camera, Workspace(1))
                        for k, view in self.views.items()], 0)

    def held(self, gaussians: Gaussians, pixels: np.ndarray, seen: np.ndarray) -> np.ndarray:
        """(N, 3) colours. pixels, seen: (N,)."""
        return hold_barely_seen(gaussians, pixels, seen, face_frames(self.trainer.rest, self.trainer.faces))


@pytest.fixture(scope="module")
def filmed() -> Filmed:
    """The figure; what faces away from the camera has any colour."""
    body, camera = Body.load(), Camera((300.0, 300.0), (110.0, 110.0), 220, 220)
    pose = np.zeros((len(YAWS), len(body.joint_names), 3))
    pose[:, 0] = [log(np.diag([1.0, -1.0, -1.0]) @ about_y(yaw)) for yaw in YAWS]
    params = BodyParams.from_pose(pose, np.tile([0, 0.2, 4.0], (len(YAWS), 1)), np.zeros(body.num_betas),
                                  np.zeros((len(YAWS), body.exprdirs.shape[2])), camera.focal, camera.center)
    poses = Poses(body, params)
    views = {t: View(camera, np.zeros((220, 220, 4), np.uint8), (0, 0)) for t in range(len(YAWS))}
    task = Task(list(views.values()), np.arange(len(YAWS)), np.zeros(0, int), poses, TrainConfig(), lambda *args: None)
    rest = poses.rest(0)[0]
    gaussians = Gaussians.area(rest, body.faces, 4000)
    gaussians.light, gaussians.low_pass = LIGHT, ADDED  # its fat splats show more of what lies behind
    at = centres_at_rest(gaussians, rest, body.faces)
    shirt = at[:, 1] > np.median(rest[:, 1])
    rng = np.random.default_rng(0)
    for part, (low, high) in ((shirt, SHIRT), (~shirt, TROUSERS)):
        gaussians.rgb[part] = rng.uniform(low, high, (int(part.sum()), 3))
    normals = face_frames(rest, body.faces).R[gaussians.face, :, 1]
    facing = np.full(len(gaussians), -1.0)
    for t in views:
        frames = face_frames(poses.vertices(t), body.faces)
        to_camera = -frames.T[gaussians.face] / np.linalg.norm(frames.T[gaussians.face], axis=1)[:, None]
        facing = np.maximum(facing, (frames.R[gaussians.face, :, 1] * to_camera).sum(1))
    gaussians.rgb[facing < 0] = rng.random((int((facing < 0).sum()), 3))
    trainer = Trainer(gaussians, task, frozen_body=True)
    trainer.lay_unseen(views)
    return Filmed(trainer, views, at, normals, facing)


def outside(filmed: Filmed, rgb: np.ndarray, who: np.ndarray) -> float:
    """Share of those gaussians (N,) whose colour, lit by the clip or not, leaves that of the well seen ones within 30 cm."""
    near = np.linalg.norm(filmed.at[who, None] - filmed.at[filmed.well], axis=2)[..., None] < 0.3
    leaves = np.zeros(int(who.sum()), bool)
    for shown in (rgb, rgb * shade(LIGHT, filmed.normals)):
        low, high = np.where(near, shown[filmed.well], np.inf).min(1), np.where(near, shown[filmed.well], -np.inf).max(1)
        leaves |= ((shown[who] < low - 0.002) | (shown[who] > high + 0.002)).any(1)
    return float(leaves.mean())


def test_colours_of_what_is_barely_seen_stay_within_what_was_seen_around(filmed):
    around = filmed.facing[KDTree(filmed.at).query(filmed.at, k=24)[1]]
    hands = np.abs(filmed.at[:, 0]) > 0.65
    barely = (np.quantile(around, 0.75, axis=1) < 0) & (filmed.facing < 0) & ~hands
    gaussians = filmed.trainer.gaussians()
    gaussians.rgb[barely] = np.random.default_rng(0).random((int(barely.sum()), 3))
    assert barely.sum() > 500 and outside(filmed, gaussians.rgb, barely) > 0.5
    assert outside(filmed, filmed.held(gaussians, filmed.pixels, filmed.trainer.seen), barely) < 0.01
    assert outside(filmed, filmed.trainer.finish(filmed.views)[0].rgb, barely) == 0


def test_a_place_seen_a_little_is_held_too_and_the_more_is_seen_the_more_its_own_colour_counts(filmed):
    gaussians, shirt = filmed.trainer.gaussians(), filmed.well & filmed.shirt
    chest = int(np.flatnonzero(shirt)[np.abs(filmed.at[shirt, 0]).argmin()])
    place = np.linalg.norm(filmed.at - filmed.at[chest], axis=1) < 0.12
    gaussians.rgb[:], gaussians.rgb[chest] = SHIRT[0], [0.0, 1.0, 0.0]
    full, counts, green = filmed.pixels, [], []
    for share in np.linspace(0, 0.4, 17):
        pixels = np.where(place, share * full, full)
        seen = find_seen(pixels, gaussians, face_frames(filmed.trainer.rest, filmed.trainer.faces))
        counts.append(seen[chest])
        green.append(filmed.held(gaussians, pixels, seen)[chest, 1])
    assert green[int(np.argmax(counts))] == pytest.approx(SHIRT[0][1], abs=1e-4), "it counts as seen, and barely so"
    assert green[-1] > 0.95 and (np.diff(green) > -0.01).all() and np.diff(green).max() < 0.25


def test_what_is_well_seen_keeps_its_colour(filmed):
    moved = np.abs(filmed.trainer.finish(filmed.views)[0].rgb - filmed.trainer.gaussians().rgb)[filmed.well]
    assert np.quantile(moved, 0.99) < 0.004 and moved.max() < 0.04


def test_where_nothing_is_seen_colours_stay(filmed):
    gaussians, none = filmed.trainer.gaussians(), np.zeros(len(filmed.at))
    np.testing.assert_array_equal(filmed.held(gaussians, none, none > 0), gaussians.rgb)
