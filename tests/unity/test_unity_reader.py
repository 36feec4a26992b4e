"""The C# reader of the Unity package, compiled by mcs and run under Mono: the numbers that the Python reader gives."""

from dataclasses import replace

import numpy as np
import pytest

from gsac.avatar.draw_rule import PIXEL
from gsac.avatar.gaussians import FIELDS
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.gsac_file.write import avatar_bytes

LIGHT = np.linspace(-1, 1, 12, dtype=np.float32).reshape(4, 3)


@pytest.fixture(scope="module")
def got(mono, package, programs_folder, exported, tmp_path_factory):
    """(arrays, printed lines) of the C# reader for an exported person, in a light."""
    folder = tmp_path_factory.mktemp("reader")
    exe = mono.compile_csharp([*(package / "Runtime" / "Core").glob("*.cs"), programs_folder / "Dump.cs",
                               programs_folder / "Read.cs"], folder / "read.exe")
    avatar = RiggedAvatar.read(exported / "avatar.gsac")
    coarser = [replace(level, max_height_px=height) for level, height in zip(avatar.coarser, (270, 135), strict=True)]
    lit = replace(avatar, gaussians=replace(avatar.gaussians, light=LIGHT), coarser=coarser)
    (folder / "lit.gsac").write_bytes(avatar_bytes(lit))
    lines = mono.run(exe, "dump", folder / "lit.gsac", folder / "arrays").splitlines()
    return mono.arrays(folder / "arrays"), lines


@pytest.fixture(scope="module")
def avatar(exported):
    return RiggedAvatar.read(exported / "avatar.gsac")


def test_mesh_skeleton_skin_expressions_and_gaussians_are_those_of_the_python_reader(got, avatar):
    for name in ("vertices", "faces", "joints", "parents", "skin_index", "skin_weight", "expression_start", "expression_vertex",
                 "expression_delta", "jaw_actions"):
        np.testing.assert_array_equal(got[0][name], np.ravel(getattr(avatar, name)), name)
    for name in FIELDS:
        np.testing.assert_array_equal(got[0][name], np.ravel(getattr(avatar.gaussians, name)), name)
    np.testing.assert_array_equal(got[0]["light"], LIGHT.ravel())
    np.testing.assert_allclose(got[0]["blend"], [PIXEL.px2, .999, 1 / 255, avatar.ground, 1], rtol=1e-6)
    np.testing.assert_array_equal(got[0]["heights"], [0, 270, 135])


def test_names_poses_and_clips_are_those_of_the_python_reader(got, avatar):
    arrays, lines = got
    assert lines == [" ".join(avatar.joint_names), " ".join(avatar.expression_names), avatar.licence["avatar"]]
    for name, clip in avatar.clips.items():
        np.testing.assert_array_equal(arrays[f"clip.{name}.rotation"], clip.rotation.ravel())
        np.testing.assert_array_equal(arrays[f"clip.{name}.transl"], clip.transl.ravel())
        assert [avatar.joint_names[j] for j in arrays[f"clip.{name}.joints"]] == clip.joints
        assert list(arrays[f"clip.{name}.fps"]) == [clip.fps, clip.loop]
    for name, pose in avatar.poses.items():
        assert [avatar.joint_names[j] for j in arrays[f"pose.{name}.joints"]] == list(pose)
        np.testing.assert_allclose(arrays[f"pose.{name}.rotation"], np.ravel([*pose.values(), []][:-1]), rtol=1e-6)
