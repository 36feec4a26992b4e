"""glTF motions: our own export, read back onto the figure that it was made of."""

import json
import struct

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsac.avatar.motion import gltf
from gsac.avatar.motion.files import read_motion
from gsac.avatar.motion.source import MotionError
from gsac.stages.export.glb import glb_bytes
from gsac.stages.export.stage import pose_gaussians
from gsac.stages.export.texture import paint_surface


@pytest.fixture(scope="module")
def whole(figure):
    rest = pose_gaussians(figure, figure.pose("T"))
    return glb_bytes(figure, paint_surface(figure, *rest), *rest)


def read(figure, path):
    return read_motion(path, figure.joint_names, figure.parents, figure.joints)


@pytest.mark.parametrize("name", ["own.glb", "own.vrma"])
def test_the_first_motion_of_a_glb_is_what_the_avatar_carries(figure, whole, tmp_path, name):
    (tmp_path / name).write_bytes(whole)
    motion, clip = read(figure, tmp_path / name), next(iter(figure.clips.values()))
    index = [figure.joint_names.index(j) for j in clip.joints]
    at = np.rint(np.arange(0, len(clip.rotation), 2) / clip.fps * motion.fps).astype(int)
    turn = (Rotation.from_rotvec(motion.rotation[at][:, index].reshape(-1, 3)).inv()
            * Rotation.from_rotvec(clip.rotation[::2].reshape(-1, 3)))
    assert np.degrees(turn.magnitude()).max() < 1.0


def edited(whole, change):
    """The glb with its JSON changed."""
    length = struct.unpack_from("<I", whole, 12)[0]
    document = json.loads(whole[20:20 + length])
    change(document)
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    rest = whole[20 + length:]
    return struct.pack("<IIIII", 0x46546C67, 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A) + text + rest


@pytest.mark.parametrize(("change", "why"), [
    (lambda d: d.pop("animations"), "it holds no animation"), (lambda d: d.pop("asset"), "not the glTF"),
    (lambda d: d["nodes"][0].update(children=[0]), r"two parents|not a tree|not the glTF"),
    (lambda d: d["accessors"][d["animations"][0]["samplers"][0]["output"]].update(count=10**9), "ends after its buffer"),
    (lambda d: d["animations"][0].update(channels=[]), "turns no joint"), (lambda d: d.update(nodes=3), "not the glTF"),
    (lambda d: d.update(nodes={}), "not the glTF"), (lambda d: d["skins"][0].pop("joints"), "not the glTF"),
    (lambda d: d["buffers"][0].update(uri="%"), "lies in another file"),
    (lambda d: [view.update(byteStride=1e-7) for view in d["bufferViews"]], "a stride or a count that glTF does not allow"),
    (lambda d: [view.update(byteStride=1) for view in d["bufferViews"]], "a stride or a count that glTF does not allow"),
    (lambda d: [each.update(byteOffset=-1) for each in d["accessors"]], "an offset"),
    (lambda d: d["nodes"].extend([{}] * 10_000), r"\d+ nodes; at most 10000 are read"),
    (lambda d: d["skins"][0].update(joints=[0] * 10_001), "10001 joints in its skin; at most 10000 are read"),
    (lambda d: d.update(extras="x" * (32 << 20)), "its JSON has 335.* bytes, at most 33554432 are read; save it as .glb")])
def test_what_is_wrong_with_a_gltf_is_named(figure, whole, tmp_path, change, why):
    (tmp_path / "odd.glb").write_bytes(edited(whole, change))
    with pytest.raises(MotionError, match=rf"odd\.glb: .*({why})"):
        read(figure, tmp_path / "odd.glb")


@pytest.mark.parametrize("length", [0, 10, 30, 5000])
def test_a_gltf_that_was_cut_off_is_named(figure, whole, tmp_path, length):
    (tmp_path / "cut.glb").write_bytes(whole[:length])
    with pytest.raises(MotionError, match=r"cut\.glb: "):
        read(figure, tmp_path / "cut.glb")


def test_accessors_that_lie_over_each_other_have_a_bound(figure, whole, tmp_path, monkeypatch):
    def repeat(document):
        channels = document["animations"][0]["channels"]
        channels.extend(channels * 9)

    monkeypatch.setattr(gltf, "MOST_NUMBERS", 30_000)
    (tmp_path / "own.glb").write_bytes(whole)
    read(figure, tmp_path / "own.glb")
    (tmp_path / "odd.glb").write_bytes(edited(whole, repeat))
    with pytest.raises(MotionError, match=r"odd\.glb: its accessors hold more than 30000 numbers in all"):
        read(figure, tmp_path / "odd.glb")
