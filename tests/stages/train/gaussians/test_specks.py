"""A speck beside the person goes; a limb that the mask has lost, and what never leaves the mask, stay."""

import numpy as np
import pytest

from gsac.avatar.binding import face_frames
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.camera import Camera
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import turn_joints
from gsac.avatar.raster import render_bound
from gsac.avatar.threads import Workspace
from gsac.stages.train.gaussians.specks import find_specks, mark_specks
from gsac.stages.train.poses.poses import Poses
from gsac.stages.train.views import View

WIDTH, HEIGHT, FOCAL = 360, 640, 700.0
FRAMES = 3


@pytest.fixture(scope="module")
def poses():
    """A body with hanging arms that turns by half a radian from frame to frame, upright before the camera."""
    body = Body.load()
    pose = np.repeat(turn_joints(np.zeros((55, 3)), {"shoulder": (0, 0, -60)})[None], FRAMES, 0)
    for t in range(FRAMES):
        pose[t, 0] = np.pi * np.array([np.cos(t / 4), 0, np.sin(t / 4)])
    return Poses(body, BodyParams.from_pose(pose, np.tile([0.0, -0.1, 2.9], (FRAMES, 1)), np.zeros(4),
                                            np.zeros((FRAMES, body.exprdirs.shape[2])), FOCAL, (WIDTH / 2, HEIGHT / 2)))


@pytest.fixture(scope="module")
def plain(poses):
    return Gaussians.area(poses.rest(0)[0], poses.body.faces, 6000)


@pytest.fixture(scope="module")
def views(poses, plain):
    """Frame -> its view; the mask is what these gaussians cover."""
    camera = Camera((FOCAL, FOCAL), (WIDTH / 2, HEIGHT / 2), WIDTH, HEIGHT)
    masks = [render_bound(poses.vertices(t), poses.body.faces, plain, camera, Workspace()).alpha.copy() for t in range(FRAMES)]
    return {t: View(camera, np.repeat((255 * mask + 0.5).astype(np.uint8)[..., None], 4, 2), (0, 0))
            for t, mask in enumerate(masks)}


def lift(gaussians, one, poses):
    """The gaussians, one of them small and 6 cm over its face."""
    lifted = gaussians[np.arange(len(gaussians))]
    size = face_frames(poses.rest(0)[0], poses.body.faces).k[lifted.face[one]]
    lifted.mu[one] = 0, 0.06 / size, 0
    lifted.log_scale[one] = np.log(0.004 / size)
    return lifted


def test_a_gaussian_that_stands_alone_beside_the_person_is_a_speck_and_no_other_is(poses, plain, views):
    crown = int(np.argmax(poses.rest(0)[0][poses.body.faces[plain.face]].mean(1)[:, 1]))
    assert np.flatnonzero(find_specks(lift(plain, crown, poses), poses, views)).tolist() == [crown]
    assert not find_specks(plain, poses, views).any()


def test_a_hand_keeps_what_stands_beside_it(poses, plain, views):
    finger = int(np.argmax(poses.rest(0)[0][poses.body.faces[plain.face]].mean(1)[:, 0]))
    assert not find_specks(lift(plain, finger, poses), poses, views).any()


def test_a_limb_that_the_masks_have_lost_stays(poses, plain, views):
    def without_feet(view):
        pixels = view.pixels.copy()
        pixels[round(0.86 * HEIGHT):] = 0
        return View(view.camera, pixels, (0, 0))

    lost = {t: without_feet(view) for t, view in views.items()}
    assert (lost[0].pixels[..., 3] > 127).sum() < 0.97 * (views[0].pixels[..., 3] > 127).sum(), "the masks did show feet"
    assert not find_specks(plain, poses, lost).any()


def test_a_speck_is_small_and_stands_off_the_mask():
    alpha, mask = np.zeros((200, 200), np.float32), np.zeros((200, 200), np.uint8)
    mask[50:150, 50:150] = 255
    alpha[50:150, 50:153] = 1
    alpha[60:62, 170:173] = alpha[100:150, 170:173] = 0.5
    specks = mark_specks(alpha, mask, 2.0)
    assert (specks[60:62, 170:173] == 1).all() and np.count_nonzero(specks) == 6
