"""A small asymmetric figure with the 55 joints: a tube around each bone, gaussians on every face, the left hand red."""

import shutil
import subprocess

import numpy as np
import pytest

from gsac.avatar.gaussians import Gaussians
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.stages.export.animations import add_motion

BODY = [  # name, parent, rest place in m (y up, left = +x)
    ("pelvis", -1, (0, 0, 0)), ("left_hip", 0, (.09, -.08, 0)), ("right_hip", 0, (-.09, -.08, 0)),
    ("spine1", 0, (0, .12, 0)), ("left_knee", 1, (.1, -.46, 0)), ("right_knee", 2, (-.1, -.46, 0)),
    ("spine2", 3, (0, .25, 0)), ("left_ankle", 4, (.1, -.86, -.02)), ("right_ankle", 5, (-.1, -.86, -.02)),
    ("spine3", 6, (0, .34, 0)), ("left_foot", 7, (.11, -.92, .12)), ("right_foot", 8, (-.11, -.92, .12)),
    ("neck", 9, (0, .52, 0)), ("left_collar", 9, (.07, .45, 0)), ("right_collar", 9, (-.07, .45, 0)),
    ("head", 12, (0, .62, .02)), ("left_shoulder", 13, (.18, .46, 0)), ("right_shoulder", 14, (-.18, .46, 0)),
    ("left_elbow", 16, (.44, .46, 0)), ("right_elbow", 17, (-.44, .46, 0)), ("left_wrist", 18, (.69, .46, 0)),
    ("right_wrist", 19, (-.69, .46, 0)), ("jaw", 15, (0, .63, .06)), ("left_eye_smplhf", 15, (.03, .70, .1)),
    ("right_eye_smplhf", 15, (-.03, .70, .1)),
]
FINGERS = {"index": .03, "middle": .01, "pinky": -.03, "ring": -.01, "thumb": .05}


def skeleton():
    """joint names, parents, joints (55, 3)."""
    rows = list(BODY)
    for side, wrist, out in (("left", 20, 1), ("right", 21, -1)):
        for finger, z in FINGERS.items():
            for k in range(3):
                parent = wrist if k == 0 else len(rows) - 1
                reach = .69 + .05 + .03 * k if finger != "thumb" else .69 + .02 + .02 * k
                rows.append((f"{side}_{finger}{k + 1}", parent, (out * reach, .46, z)))
    names, parents, places = zip(*rows, strict=True)
    return list(names), np.array(parents, np.int32), np.array(places, np.float32)


def tube(start, end, radius, sides=6, rings=3):
    """Closed tube: vertices (n, 3), faces (m, 3) wound outwards, position along the bone (n,)."""
    axis = (end - start) / np.linalg.norm(end - start)
    side = np.cross(axis, (0, 0, 1.0) if abs(axis[2]) < .9 else (0, 1.0, 0))
    side /= np.linalg.norm(side)
    other = np.cross(axis, side)
    angle = np.arange(sides) * 2 * np.pi / sides
    ring = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * other
    along = np.linspace(0, 1, rings)
    vertices = np.concatenate([start + a * (end - start) + radius * ring for a in along] + [[start], [end]])
    faces = []
    for r in range(rings - 1):
        for i in range(sides):
            a, b = r * sides + i, r * sides + (i + 1) % sides
            c, d = a + sides, b + sides
            faces += [(a, b, d), (a, d, c)]
    last, first = len(vertices) - 1, len(vertices) - 2
    for i in range(sides):
        faces += [(first, (i + 1) % sides, i), (last, (rings - 1) * sides + i, (rings - 1) * sides + (i + 1) % sides)]
    return vertices, np.array(faces), np.concatenate([np.repeat(along, sides), [0, 1]])


def make_figure(per_face=1, seed=0):
    """A RiggedAvatar; rgb: left hand red, right hand blue, front green-ish, rest grey."""
    rng = np.random.default_rng(seed)
    names, parents, joints = skeleton()
    vertices, faces, index, weight = [], [], [], []
    for j in range(1, len(names)):
        p = parents[j]
        radius = .008 if "1" <= names[j][-1] <= "3" and "spine" not in names[j] else .06
        if names[j] == "head":
            radius = .09
        v, f, along = tube(joints[p].astype(float), joints[j].astype(float) + 1e-3, radius)
        faces.append(f + sum(map(len, vertices)))
        vertices.append(v)
        blend = np.clip(along - .75, 0, .25) * 2
        index.append(np.stack([np.full(len(v), p), np.full(len(v), j), *[np.zeros(len(v), int)] * 2], 1))
        weight.append(np.stack([1 - blend, blend, 0 * blend, 0 * blend], 1))
    vertices, faces = np.concatenate(vertices).astype(np.float32), np.concatenate(faces).astype(np.int32)
    face = np.repeat(np.arange(len(faces), dtype=np.int32), per_face)
    N, centre = len(face), vertices[faces].mean(1)[face]
    rgb = np.where(centre[:, 2:] > 0, (.45, .7, .45), (.45, .45, .45))
    rgb = np.where(centre[:, :1] > .71, (.9, .1, .1), np.where(centre[:, :1] < -.71, (.1, .1, .9), rgb))
    quat = rng.normal(size=(N, 4)) * .3 + (1, 0, 0, 0)
    nose = np.flatnonzero((vertices[:, 1] > .5) & (vertices[:, 2] > .05))
    avatar = RiggedAvatar(
        vertices=vertices, faces=faces, joints=joints, parents=parents, joint_names=names,
        skin_index=np.concatenate(index).astype(np.int32), skin_weight=np.concatenate(weight).astype(np.float32),
        expression_names=["jawOpen", "browInnerUp"], expression_start=np.array([0, len(nose), len(nose)], np.int32),
        expression_vertex=nose.astype(np.int32),
        expression_delta=np.tile(np.float32([0, -.02, 0]), (len(nose), 1)),
        jaw_actions=np.float32([[4, 0, 0], [0, 0, 0]]),
        gaussians=Gaussians(
            face=face, mu=rng.normal(size=(N, 3)).astype(np.float32) * .004,
            quat=(quat / np.linalg.norm(quat, axis=1, keepdims=True)).astype(np.float32),
            log_scale=np.log(rng.uniform(.008, .02, (N, 3)) * (1, .3, 1)).astype(np.float32),
            rgb=np.clip(rgb + rng.normal(size=(N, 3)) * .03, 0, 1).astype(np.float32),
            opacity=rng.uniform(.6, 1, N).astype(np.float32)),
        licence={"avatar": "test figure"}, provenance={"gsac": "0"})
    avatar.coarser = [avatar.gaussians[::step] for step in (3, 9)]
    add_motion(avatar, ("wave", "walk"))
    return avatar


@pytest.fixture(scope="session")
def figure():
    return make_figure()


@pytest.fixture(scope="session")
def person(tmp_path_factory):
    """Input files of the stage: the open body with 6,000 noisy gaussians, the left hand red."""
    from gsac.avatar.artifacts import Clip
    from gsac.avatar.body import Body, BodyParams

    folder = tmp_path_factory.mktemp("person")
    body, rng, N = Body.load(), np.random.default_rng(1), 6000
    betas = np.append(rng.normal(size=body.num_figure), np.zeros(len(body.clothes))).astype(np.float32) * .5
    expression = np.zeros((2, len(body.expression_names)))
    params = BodyParams.from_pose(np.zeros((2, 55, 3)), np.zeros((2, 3)), betas, expression, 1000, (300, 300),
                                  rng.normal(size=(55, 3)) * .002, model=body.digest)
    vertices, joints = body.rest(betas, None, params.joint_offset)
    gaussians = Gaussians.area(vertices, body.faces, N)
    height = np.ptp(vertices[:, 1])
    centre = vertices[body.faces[gaussians.face]].mean(1)
    rgb = np.where(centre[:, 1:2] > vertices[:, 1].min() + .5 * height, (.3, .5, .7), (.3, .3, .4))
    rgb = np.where(centre[:, :1] > joints[20, 0], (.9, .05, .05), rgb) + rng.normal(size=(N, 3)) * .03
    gaussians.rgb = np.clip(rgb, 0, 1).astype(np.float32)
    gaussians.opacity = rng.uniform(.5, 1, N).astype(np.float32)
    gaussians.mu = gaussians.mu + rng.normal(size=(N, 3)).astype(np.float32) * .005
    gaussians.quat = (gaussians.quat + rng.normal(size=(N, 4)) * .2).astype(np.float32)
    gaussians.log_scale = gaussians.log_scale + rng.normal(size=(N, 3)).astype(np.float32) * .3
    paths = {"split/clip.json": folder / "clip.json", "train/avatar.npz": folder / "avatar.npz",
             "train/body.npz": folder / "body.npz"}
    Clip(30, [0.0, 0.1], 540, 960, None, "ab" * 32).write(paths["split/clip.json"])
    gaussians.write(paths["train/avatar.npz"])
    params.write(paths["train/body.npz"])
    return paths


@pytest.fixture(scope="session")
def exported(person, tmp_path_factory):
    """Output folder of the stage for `person`."""
    from gsac.stages.contract import Job
    from gsac.stages.export.config import ExportConfig
    from gsac.stages.export.stage import run

    out = tmp_path_factory.mktemp("exported")
    run(Job(person, out, ExportConfig()))
    return out


@pytest.fixture(scope="session")
def node_package(tmp_path_factory):
    """name@version, several with spaces between -> a folder where node finds them; skips where npm or the index is absent."""
    folders = {}

    def folder(package):
        if not shutil.which("npm"):
            pytest.skip("needs npm (Debian package npm)")
        if package not in folders:
            where = tmp_path_factory.mktemp("node")
            install = ["npm", "install", "--silent", "--no-audit", "--no-fund", *package.split()]
            folders[package] = where if subprocess.run(install, cwd=where, capture_output=True).returncode == 0 else None
        if folders[package] is None:
            pytest.skip(f"npm could not install {package}")
        return folders[package]

    return folder


@pytest.fixture(scope="session")
def shadowed():
    """Script that draws the page's picture as it stands, with its shadow and without its controls."""
    return """(() => {
  gsac.still = true;
  document.body.classList.add('bare');
  gsac.resize();
  const eye = gsac.camera.eye(gsac.canvas.width, gsac.canvas.height);
  gsac.renderer.prepare(eye.view);
  gsac.renderer.clear([...gsac.rgb, 1]);
  gsac.renderer.paint(eye, gsac.shadow);
})()"""
