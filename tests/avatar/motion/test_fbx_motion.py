"""FBX motions: our own export, read back onto the figure that it was made of."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsac.avatar.motion.files import read_motion
from gsac.avatar.motion.source import MotionError
from gsac.stages.export.fbx import avatar_fbx
from gsac.stages.export.stage import pose_gaussians
from gsac.stages.export.texture import paint_surface

pytest.importorskip("ufbx")


@pytest.fixture(scope="module")
def file(figure, tmp_path_factory):
    path = tmp_path_factory.mktemp("fbx") / "own.fbx"
    path.write_bytes(avatar_fbx(figure, paint_surface(figure, *pose_gaussians(figure, figure.pose("T")))))
    return path


def read(figure, path):
    return read_motion(path, figure.joint_names, figure.parents, figure.joints)


def test_the_longest_motion_of_an_fbx_is_what_the_avatar_carries(figure, file):
    motion, clip = read(figure, file), figure.clips["wave"]
    assert motion.seconds == pytest.approx(len(clip.rotation) / clip.fps, abs=0.06)
    index = [figure.joint_names.index(j) for j in clip.joints]
    at = np.rint(np.arange(0, len(clip.rotation), 2) / clip.fps * motion.fps).astype(int)
    got, want = motion.rotation[at][:, index], clip.rotation[::2]
    turn = Rotation.from_rotvec(got.reshape(-1, 3)).inv() * Rotation.from_rotvec(want.reshape(-1, 3))
    assert np.degrees(turn.magnitude()).max() < 1.0


@pytest.mark.parametrize("content", [b"", b"not an fbx", None])
def test_an_fbx_that_cannot_be_read_is_named_and_ends_nothing(figure, file, tmp_path, content):
    path = tmp_path / "odd.fbx"
    path.write_bytes(file.read_bytes()[:5000] if content is None else content)
    with pytest.raises(MotionError, match=r"odd\.fbx: "):
        read(figure, path)


def test_an_fbx_that_cannot_be_opened_says_why(figure, tmp_path):
    (tmp_path / "odd.fbx").mkdir()
    with pytest.raises(MotionError, match=r"odd\.fbx: Is a directory"):
        read(figure, tmp_path / "odd.fbx")
