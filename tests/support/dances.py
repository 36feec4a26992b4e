"""A person's skeleton with a made-up dance, and the same dance written as other tools write it."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsac.avatar.body import Body
from gsac.avatar.motion.bvh import read_bvh
from gsac.avatar.motion.source import Motion
from gsac.avatar.skinning import joint_transforms

Z_UP = Rotation.from_rotvec([np.pi / 2, 0, 0])
"""Our world in the world of a tool whose z is up."""


class Skeleton:
    def __init__(self, names, parents, joints):
        self.names, self.parents, self.joints = list(names), np.asarray(parents), np.asarray(joints, float)

    def posed(self, rotation, transl):
        """Places (T, J, 3) of the joints."""
        A = joint_transforms(np.asarray(rotation, np.float64), self.joints, self.parents)
        return np.einsum("tjab,jb->tja", A[..., :3], self.joints) + A[..., 3] + np.asarray(transl)[:, None]


@pytest.fixture(scope="session")
def skeleton():
    body = Body.load()
    _, joints = body.rest(np.zeros(body.num_betas))
    return Skeleton(body.joint_names, body.parents, joints)


@pytest.fixture(scope="session")
def dance(skeleton):
    """A Motion that starts in the T-pose at the origin, moves every joint and stands on the floor."""
    rng, T = np.random.default_rng(3), 12
    phase = np.linspace(0, 1, T)[:, None, None]
    rotation = (rng.normal(size=(1, 55, 3)) * .35 * np.sin(np.pi * phase) + rng.normal(size=(1, 55, 3)) * .1 * phase * (1 - phase))
    transl = phase[:, 0] * (.4, 0, .2)
    feet = [j for j, name in enumerate(skeleton.names) if name.endswith(("_ankle", "_foot"))]
    lowest = (skeleton.posed(rotation, transl)[:, feet, 1] - skeleton.joints[feet, 1]).min(1)
    transl[:, 1] -= lowest.min()
    return Motion(24.0, rotation.astype(np.float32), transl.astype(np.float32))


def bvh_text(skeleton, motion, names=None, unit=1.0, order="ZXY", world=None):
    """A BVH of the motion: its own names, unit, order of angles and world; rest is the T-pose."""
    world, names = world or Rotation.identity(), names or skeleton.names
    children = {j: [k for k, p in enumerate(skeleton.parents) if p == j] for j in range(-1, len(names))}
    lines, columns = ["HIERARCHY"], []

    def numbers(v):
        return " ".join(f"{x:.9f}" for x in v)

    def joint(j, depth):
        parent = skeleton.parents[j]
        pad = "  " * depth
        lines.append(f"{pad}{'ROOT' if parent < 0 else 'JOINT'} {names[j]}")
        offset = skeleton.joints[j] - (skeleton.joints[parent] if parent >= 0 else 0)
        lines.extend([pad + "{", f"{pad}  OFFSET {numbers(world.apply(offset) * unit)}"])
        channels = [f"{axis}rotation" for axis in order]
        if parent < 0:
            channels = ["Xposition", "Yposition", "Zposition", *channels]
            columns.append(world.apply(skeleton.joints[j] + motion.transl) * unit)
        lines.append(f"{pad}  CHANNELS {len(channels)} {' '.join(channels)}")
        turn = world * Rotation.from_rotvec(motion.rotation[:, j]) * world.inv()
        columns.append(turn.as_euler(order, degrees=True))
        for child in children[j]:
            joint(child, depth + 1)
        if not children[j]:
            lines.extend([pad + "  End Site", pad + "  {", pad + "    OFFSET 0 0.01 0", pad + "  }"])
        lines.append(pad + "}")

    joint(0, 0)
    table = np.concatenate(columns, axis=1)
    lines += ["MOTION", f"Frames: {len(table)}", f"Frame Time: {1 / motion.fps:.9f}", *map(numbers, table)]
    return "\n".join(lines) + "\n"


def read_text(text, name="motion.bvh"):
    """The Source that a BVH of this text and name holds."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_text(text, encoding="utf-8", newline="")
        return read_bvh(path)


def mixamo(name):
    """Mixamo's name of a joint of SMPL-X."""
    parts = {"hip": "UpLeg", "knee": "Leg", "ankle": "Foot", "foot": "ToeBase", "collar": "Shoulder", "shoulder": "Arm",
             "elbow": "ForeArm", "wrist": "Hand"}
    middle = {"pelvis": "Hips", "spine1": "Spine", "spine2": "Spine1", "spine3": "Spine2"}
    side, _, part = name.partition("_")
    if side not in ("left", "right"):
        return "mixamorig:" + middle.get(name, name.capitalize())
    hand = part[:-1].capitalize() in ("Index", "Middle", "Pinky", "Ring", "Thumb")
    return f"mixamorig:{side.capitalize()}" + (f"Hand{part.capitalize()}" if hand else parts.get(part, "Eye"))


def assert_same(got, want, degrees=0.05, metres=2e-4):
    turn = Rotation.from_rotvec(got.rotation.reshape(-1, 3)).inv() * Rotation.from_rotvec(want.rotation.reshape(-1, 3))
    assert np.degrees(turn.magnitude()).max() < degrees
    np.testing.assert_allclose(got.transl, want.transl, atol=metres)
    assert got.fps == pytest.approx(want.fps, rel=1e-6)
