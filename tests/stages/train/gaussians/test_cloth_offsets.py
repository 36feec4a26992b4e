"""Offsets of the body's surface: smooth, and folded into the gaussians without a visible change."""

import numpy as np

from gsac.avatar.binding import bind, face_frames
from gsac.avatar.body import Body
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import FINGERS
from gsac.stages.train.gaussians.cloth_offsets import EVERY, Offsets, fold


def test_folding_leaves_every_gaussian_where_it_was():
    body, rng = Body.load(), np.random.default_rng(0)
    rest = body.v_template
    gaussians = Gaussians.area(rest, body.faces, 500, 0)
    gaussians.quat = rng.normal(size=(500, 4)).astype(np.float32)
    offset = (0.02 * np.sin(7 * rest + 1)).astype(np.float32)
    folded = fold(gaussians, rest, offset, body.faces)
    before, after = (bind(face_frames(vertices, body.faces), g.face, g.mu, g.quat, g.log_scale)
                     for vertices, g in ((rest + offset, gaussians), (rest, folded)))
    np.testing.assert_allclose(after.means, before.means, atol=1e-5)
    np.testing.assert_allclose(after.rotations, before.rotations, atol=1e-3)
    np.testing.assert_allclose(after.scales, before.scales, rtol=1e-3, atol=1e-7)


def test_a_pull_on_one_vertex_moves_its_surroundings_smoothly_and_no_finger():
    body = Body.load()
    offsets, grad = Offsets(body), np.zeros((len(body.v_template), 3))
    chest = int(np.argmin(np.linalg.norm(body.v_template - [0, 1.2, 0.15], axis=1)))
    grad[chest, 2] = -1
    for _ in range(EVERY):
        offsets.gather(grad, 1e-3)
    assert 0 < offsets.offset[chest, 2] < 1e-3
    edges = np.concatenate([body.faces[:, [0, 1]], body.faces[:, [1, 2]]])
    steps = np.abs(offsets.offset[edges[:, 0]] - offsets.offset[edges[:, 1]]).max()
    assert steps < 0.5 * np.abs(offsets.offset).max()
    finger = (body.skin_index[:, 0] >= FINGERS.start) & (body.skin_weight[:, 0] > 0.999)
    pulled = Offsets(body)
    grad[:] = 0
    grad[finger, 2] = -1
    for _ in range(EVERY):
        pulled.gather(grad, 1e-3)
    assert np.abs(pulled.offset[finger]).max() < 1e-4
