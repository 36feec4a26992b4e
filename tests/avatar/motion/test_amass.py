import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsac.avatar.motion.amass import read_amass
from gsac.avatar.motion.files import read_motion
from gsac.avatar.motion.source import Motion, MotionError
from support import mutate


def z_up(motion, skeleton):
    """Pose (T, 55, 3) and trans (T, 3) as AMASS has them: z up, `trans` beside the pelvis' own rest place."""
    turn = Rotation.from_rotvec([np.pi / 2, 0, 0]) * Rotation.from_rotvec([0, .8, 0])
    pose = motion.rotation.astype(float).copy()
    pose[:, 0] = (turn * Rotation.from_rotvec(pose[:, 0])).as_rotvec()
    return pose, turn.apply(skeleton.joints[0] + motion.transl) - skeleton.joints[0]


def same(got, want, joints=slice(None)):
    turn = (Rotation.from_rotvec(got.rotation[:, joints].reshape(-1, 3)).inv()
            * Rotation.from_rotvec(want.rotation[:, joints].reshape(-1, 3)))
    assert np.degrees(turn.magnitude()).max() < 0.01
    np.testing.assert_allclose(got.transl, want.transl, atol=1e-5)
    assert got.fps == pytest.approx(want.fps)


def read(path, skeleton):
    return read_motion(path, skeleton.names, skeleton.parents, skeleton.joints)


def test_smplx_poses_z_up_come_out_as_they_were(tmp_path, skeleton, dance):
    pose, trans = z_up(dance, skeleton)
    np.savez(tmp_path / "a.npz", poses=pose.reshape(-1, 165), trans=trans, mocap_frame_rate=np.array(24.0), gender="neutral")
    same(read(tmp_path / "a.npz", skeleton), dance)


def test_smplh_poses_and_named_parts_are_the_same_motion(tmp_path, skeleton, dance):
    still = dance.rotation.copy()
    still[:, 22:25] = 0
    pose, trans = z_up(Motion(dance.fps, still, dance.transl), skeleton)
    flat = pose.reshape(-1, 165)
    np.savez(tmp_path / "h.npz", poses=np.concatenate([flat[:, :66], flat[:, 75:]], 1), trans=trans, mocap_framerate=24)
    np.savez(tmp_path / "p.npz", root_orient=flat[:, :3], pose_body=flat[:, 3:66], pose_hand=flat[:, 75:], trans=trans, fps=24)
    for name in ("h.npz", "p.npz"):
        same(read(tmp_path / name, skeleton), Motion(24, still, dance.transl))


def test_smpl_poses_leave_the_fingers_still(tmp_path, skeleton, dance):
    pose, trans = z_up(dance, skeleton)
    np.savez(tmp_path / "s.npz", poses=np.concatenate([pose[:, :22], pose[:, :2]], 1).reshape(-1, 72), trans=trans, fps=24)
    got = read(tmp_path / "s.npz", skeleton)
    same(got, dance, slice(0, 22))
    assert np.abs(got.rotation[:, 25:]).max() < 1e-9


@pytest.mark.parametrize(("arrays", "name", "why"), [
    ({}, "", "pose_body"), ({"poses": np.zeros((3, 70))}, "poses", "72"), ({"poses": np.zeros((0, 165))}, "poses", "(0, 165)"),
    ({"poses": np.full((3, 165), np.nan)}, "poses", "finite"), ({"poses": np.full((3, 165), "x")}, "poses", "numbers"),
    ({"poses": np.full((3, 165), 1e300)}, "poses", "beyond"),
    ({"poses": np.zeros((3, 165)), "trans": np.zeros((4, 3))}, "trans", "(3, 3)"),
    ({"poses": np.zeros((3, 165)), "fps": np.array(0)}, "fps", "frames a second"),
    ({"pose_body": np.zeros((3, 63)), "pose_hand": np.zeros((3, 60))}, "pose_hand", "(3, 90)")])
def test_a_fault_names_the_file_and_the_array(tmp_path, skeleton, arrays, name, why):
    np.savez(tmp_path / "odd.npz", **arrays)
    with pytest.raises(MotionError) as e:
        read_amass(tmp_path / "odd.npz", skeleton.names, skeleton.parents, skeleton.joints)
    assert "odd.npz" in str(e.value) and name in str(e.value) and why in str(e.value)


def test_a_torn_file_pickles_and_other_suffixes_are_named_errors(tmp_path, skeleton):
    np.savez(tmp_path / "a.npz", poses=np.zeros((3, 165)))
    (tmp_path / "torn.npz").write_bytes((tmp_path / "a.npz").read_bytes()[:300])
    np.savez(tmp_path / "pickle.npz", poses=np.array([{}], object))
    (tmp_path / "dance.fbx").write_bytes(b"x")
    for name in ("torn.npz", "pickle.npz", "dance.fbx"):
        with pytest.raises(MotionError, match=name):
            read(tmp_path / name, skeleton)


def test_a_motion_of_too_many_frames_is_refused_with_the_bound(tmp_path, skeleton):
    for name, width in (("poses", 165), ("pose_body", 63)):
        (tmp_path / "long.npz").write_bytes(mutate.bomb((72_728, width), "<f2", name))
        with pytest.raises(MotionError, match=r"long\.npz: 72728 frames of 55 joints; at most 72727 are read: cut it"):
            read(tmp_path / "long.npz", skeleton)


@pytest.mark.parametrize("shape", [(63,), (), (2, 62), (0, 63), (2, 21, 4)])
def test_a_pose_of_an_odd_size_is_named(tmp_path, skeleton, shape):
    np.savez(tmp_path / "odd.npz", body_pose=np.zeros(shape))
    with pytest.raises(MotionError, match=r"odd\.npz: array body_pose has shape"):
        read(tmp_path / "odd.npz", skeleton)
