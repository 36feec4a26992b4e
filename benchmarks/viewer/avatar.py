"""A made-up avatar: the open body, gaussians spread by area, clothes of two colours, the left hand red."""

from __future__ import annotations

import numpy as np

from gsac.avatar.body import Body, BodyParams
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.joints import WRISTS
from gsac.stages.export.animations import add_motion
from gsac.stages.export.stage import rig_avatar

SEED = 1


def make_avatar(count: int) -> RiggedAvatar:
    """An avatar of `count` gaussians with the clips walk and wave."""
    body, rng = Body.load(), np.random.default_rng(SEED)
    betas = np.zeros(body.num_betas, np.float32)
    params = BodyParams.from_pose(np.zeros((1, 55, 3)), np.zeros((1, 3)), betas, np.zeros((1, len(body.expression_names))), 1000,
                                  (300, 300), model=body.digest)
    vertices, joints = body.rest(betas)
    gaussians = Gaussians.area(vertices, body.faces, count)
    centre = vertices[body.faces[gaussians.face]].mean(1)
    middle = (vertices[:, 1].min() + vertices[:, 1].max()) / 2
    rgb = np.where(centre[:, 1:2] > middle, (.3, .5, .7), (.3, .3, .4))
    rgb = np.where(centre[:, :1] > joints[WRISTS[0], 0], (.9, .05, .05), rgb)
    gaussians.rgb = np.clip(rgb + rng.normal(size=(count, 3)) * .03, 0, 1).astype(np.float32)
    gaussians.opacity = rng.uniform(.5, 1, count).astype(np.float32)
    avatar = rig_avatar(body, params, gaussians)
    add_motion(avatar, ("walk", "wave"))
    return avatar
