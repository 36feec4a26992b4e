"""A made-up body file of SMPL-X's official arrays: 300 + 100 directions, pose correctives, mean hands and their components.

The data are nobody's. The mesh is the small figure of tubes, or the open body's.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from gsac.avatar.body import Body, BodyParams
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.avatar.joints import INDEX
from gsac.avatar.mesh import vertex_normals
from gsac.stages.export.animations import add_motion
from gsac.stages.export.stage import rig_avatar
from support.figure import make_figure

SHAPES, EXPRESSIONS = 300, 100
BULGE = 0.012
"""m, the largest that one direction of a corrective moves a vertex at its joint."""
SPAN = 0.07
"""m, sigma of a corrective about its joint."""
FAINT = 1e-8
"""m, of what every joint does to every vertex."""


def official_arrays(mesh: str = "figure", seed: int = 0) -> dict[str, np.ndarray]:
    """The file's arrays (...) by name. mesh: figure or open."""
    rng = np.random.default_rng(seed)
    vertices, faces, joints, parents, weights, regressor = (_figure if mesh == "figure" else _open)()
    turns = np.zeros((len(vertices), 3, 54, 9), np.float32)
    normals = vertex_normals(vertices, faces)
    for j in range(1, 55):
        near = BULGE * _near(vertices, joints[j])
        outward = normals[:, :, None] * rng.uniform(-1, 1, 9) + 0.3 * rng.uniform(-1, 1, (3, 9))
        turns[:, :, j - 1] = near[:, None, None] * outward
    turns += FAINT * rng.uniform(-1, 1, turns.shape).astype(np.float32)
    size = 0.02 / np.sqrt(1 + np.arange(SHAPES + EXPRESSIONS))
    shapes = rng.normal(0, 1, (len(size), 4, 3)) * size[:, None, None]
    waves = np.stack([np.ones(len(vertices)), *np.sin(3 * vertices.T)], 1)  # smooth over the body
    directions = np.einsum("vk,dkc->vcd", waves, shapes)
    directions[:, :, SHAPES:] *= _near(vertices, joints[INDEX["head"]])[:, None, None]
    return {
        "v_template": vertices.astype(np.float64), "f": faces.astype(np.uint32), "J_regressor": regressor, "weights": weights,
        "kintree_table": np.array([[2**32 - 1, *parents[1:]], range(55)], np.uint32),
        "shapedirs": directions.astype(np.float32),
        "posedirs": turns.reshape(len(vertices), 3, 486),
        "hands_meanl": rng.normal(0, 0.3, 45), "hands_meanr": rng.normal(0, 0.3, 45),
        "hands_componentsl": rng.normal(0, 0.1, (45, 45)), "hands_componentsr": rng.normal(0, 0.1, (45, 45)),
    }


def _near(vertices: np.ndarray, place: np.ndarray) -> np.ndarray:
    """(V,) 1 at the place (3,) m, falling to 0 within four SPANs. vertices: (V, 3) m."""
    near = np.exp(-((vertices - place) ** 2).sum(1) / (2 * SPAN**2))
    return np.where(near < 2e-3, 0, near)


def official_file(path: Path, **options) -> Path:
    """Writes `official_arrays` to the path, and returns it."""
    np.savez(path, **official_arrays(**options))
    return path


def strong_poses(count: int, seed: int = 0) -> np.ndarray:
    """(count, 55, 3) axis-angle, every joint turned by up to half a turn and more."""
    return np.random.default_rng(seed).normal(0, 0.8, (count, 55, 3))


@pytest.fixture(scope="session")
def official_body(tmp_path_factory) -> Body:
    """The body of `official_arrays` on the tubes."""
    return Body.load(official_file(tmp_path_factory.mktemp("official") / "SMPLX_MADE_UP.npz"))


class BentArm(NamedTuple):
    """An exported avatar of `official_body` in a pose, and where the Python body has its vertices."""

    avatar: RiggedAvatar
    """As it was written."""
    file: Path
    pose: np.ndarray  # (55, 3) axis-angle
    vertices: np.ndarray  # (V, 3) m
    plain: np.ndarray  # (V, 3) m, without correctives


@pytest.fixture(scope="session")
def bent_arm(official_body, tmp_path_factory) -> BentArm:
    """The left elbow bent by 103 degrees, the shoulder and a finger turned, of a person with 20 betas."""
    betas, pose = np.random.default_rng(7).normal(0, 1, 20), np.zeros((1, 55, 3), np.float32)
    for joint, turn in (("left_elbow", (0, -1.8, 0)), ("left_shoulder", (0.3, 0.2, -0.7)), ("left_index1", (0, 0.1, -0.9))):
        pose[0, INDEX[joint]] = turn
    params = BodyParams.from_pose(pose, np.zeros((1, 3)), betas, np.zeros((1, EXPRESSIONS)), 500.0, (0, 0))
    avatar = rig_avatar(official_body, params, Gaussians.area(official_body.rest(betas)[0], official_body.faces, 300))
    avatar.licence = {"avatar": "none"}
    add_motion(avatar, ("wave",))
    file = tmp_path_factory.mktemp("bent") / "avatar.gsac"
    file.write_bytes(avatar_bytes(avatar))
    return BentArm(avatar, file, pose[0], official_body.posed(params)[0][0],
                   replace(official_body, posedirs=None).posed(params)[0][0])


def _figure() -> tuple[np.ndarray, ...]:
    """Vertices (V, 3), faces (F, 3), joints (55, 3), parents (55,), weights (V, 55) and regressor (55, V) of the tubes."""
    avatar = make_figure()
    V = len(avatar.vertices)
    weights = np.zeros((V, 55))
    np.add.at(weights, (np.arange(V)[:, None], avatar.skin_index), avatar.skin_weight)
    regressor = np.zeros((55, V))
    for j, place in enumerate(avatar.joints):
        regressor[j, np.argsort(((avatar.vertices - place) ** 2).sum(1), kind="stable")[:20]] = 1 / 20
    return avatar.vertices, avatar.faces, regressor @ avatar.vertices, avatar.parents, weights, regressor


def _open() -> tuple[np.ndarray, ...]:
    """The same of the open body."""
    body = Body.load()
    return (body.v_template, body.faces, body.J_regressor @ body.v_template, body.parents, body.weights.astype(float),
            body.J_regressor.astype(float))


def posed_as_written(a: dict[str, np.ndarray], betas: np.ndarray, expression: np.ndarray, pose: np.ndarray,
                     transl: np.ndarray) -> np.ndarray:
    """Vertices (V, 3) m by SMPL-X's own formulae (Pavlakos et al. 2019, eq. 1 to 6), written out in plain float64.

    a: `official_arrays`; betas: (300,); expression: (100,); pose: (55, 3) axis-angle with nothing to be added; transl: (3,) m.
    """
    template, dirs = a["v_template"], a["shapedirs"].astype(np.float64)
    shaped = template + sum(beta * dirs[:, :, n] for n, beta in enumerate(betas))  # eq. 3: B_S
    joints = a["J_regressor"] @ shaped  # eq. 6
    bent = shaped + sum(psi * dirs[:, :, SHAPES + n] for n, psi in enumerate(expression))  # eq. 5: B_E
    turns = []
    for x, y, z in pose:
        angle = np.sqrt(x * x + y * y + z * z)
        k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) / (angle or 1.0)
        turns.append(np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k)
    feature = np.concatenate([(turn - np.eye(3)).ravel() for turn in turns[1:]])
    bent = bent + sum(f * a["posedirs"][:, :, n].astype(np.float64) for n, f in enumerate(feature))  # eq. 4: B_P
    parents = a["kintree_table"][0].astype(np.int64)
    world = []
    for j, turn in enumerate(turns):
        own = np.eye(4)
        own[:3, :3], own[:3, 3] = turn, joints[j] - (joints[parents[j]] if j else 0)
        world.append(world[parents[j]] @ own if j else own)
    out = np.zeros_like(bent)
    for j, matrix in enumerate(world):  # eq. 1: W
        out += a["weights"][:, j:j + 1] * ((bent - joints[j]) @ matrix[:3, :3].T + matrix[:3, 3])
    return out + transl
