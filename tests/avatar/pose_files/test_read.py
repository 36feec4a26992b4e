"""Poses that the user brings: every layout's rotations, and what is said of a file that does not fit."""

from __future__ import annotations

import io
import json
import zipfile

import numpy as np
import pytest

from gsac.avatar import rotation
from gsac.avatar.artifacts import ArtifactError
from gsac.avatar.joints import LEFT_HAND, POSE_PARTS, RIGHT_HAND
from gsac.avatar.pose_files.exavatar import PARTS
from gsac.avatar.pose_files.read import read_start
from gsac.pipeline.model_check import check_model
from gsac.stages.contract import BadInput

FRAMES = 3


@pytest.fixture(scope="module")
def vectors() -> np.ndarray:
    return np.random.default_rng(0).normal(0, 0.4, (FRAMES, 55, 3))


def zip_of(path, members: dict[str, bytes]):
    with zipfile.ZipFile(path, "w") as file:
        for name, content in members.items():
            file.writestr(name, content)
    return path


def npz(**arrays: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def exavatar(vectors, t) -> bytes:
    parts = {theirs: vectors[t, POSE_PARTS[name]].squeeze().tolist() for name, theirs in PARTS.items()}
    return json.dumps(parts | {"expr": [0.0] * 50, "trans": [0.1, 0.2, 3.0 + t]}).encode()


def smpler_x(vectors, t) -> bytes:
    parts = {name: vectors[t, joints].reshape(1, -1) for name, joints in POSE_PARTS.items()}
    return npz(**parts, betas=np.full((1, 10), 0.5), expression=np.zeros((1, 10)), transl=np.array([[0.1, 0.2, 3.0 + t]]))


def hand4whole(vectors) -> dict[str, np.ndarray]:
    """The network's raw numbers: two columns of each rotation, row by row; the left hand told as a right one in a mirror."""
    raw = vectors.copy()
    raw[:, LEFT_HAND] *= [1, -1, -1]
    six = rotation.exp(raw)[..., :2] * 1.7  # not normalised
    names = {name: theirs for name, theirs in PARTS.items() if "eye" not in theirs}
    return {theirs: six[:, POSE_PARTS[name]].reshape(len(vectors), -1) for name, theirs in names.items()} | {
        "shape": np.full((len(vectors), 10), 0.5), "expr": np.zeros((len(vectors), 10)), "cam": np.zeros((len(vectors), 3))}


def test_exavatars_files_give_their_rotations(vectors, tmp_path):
    members = {f"smplx_params/{t}.json": exavatar(vectors, t) for t in range(FRAMES)}
    shape = json.dumps([0.5] * 100).encode()
    start = read_start(zip_of(tmp_path / "start", members | {"shape_param.json": shape, "face_offset.json": b"[]"}), FRAMES)
    np.testing.assert_allclose(start.rotations, rotation.exp(vectors), atol=1e-4)
    np.testing.assert_allclose(start.transl[:, 2], [3, 4, 5])
    assert start.betas.shape == (100,) and start.given.all()


def test_smpler_xs_files_give_their_rotations(vectors, tmp_path):
    start = read_start(zip_of(tmp_path / "start", {f"smplx/{t:05d}_0.npz": smpler_x(vectors, t) for t in range(FRAMES)}), FRAMES)
    np.testing.assert_allclose(start.rotations, rotation.exp(vectors), atol=1e-4)
    np.testing.assert_allclose(start.transl[:, 2], [3, 4, 5])
    np.testing.assert_allclose(start.betas, 0.5)


def test_hand4wholes_raw_numbers_give_their_rotations_the_left_hand_mirrored_back(vectors, tmp_path):
    (tmp_path / "start.npz").write_bytes(npz(**hand4whole(vectors)))
    start = read_start(tmp_path / "start.npz", FRAMES)
    without_eyes = [j for j in range(55) if j not in (23, 24)]
    np.testing.assert_allclose(start.rotations[:, without_eyes], rotation.exp(vectors)[:, without_eyes], atol=1e-4)
    assert np.isnan(start.rotations[:, [23, 24]]).all() and np.isnan(start.transl).all()
    np.testing.assert_allclose(start.betas, 0.5)


def test_whams_arrays_give_their_body_and_no_shape_for_theirs_is_smpls(vectors, tmp_path):
    pose = np.concatenate([vectors[:, :22].reshape(FRAMES, -1), np.zeros((FRAMES, 6))], 1)
    (tmp_path / "start.npz").write_bytes(npz(pose=pose, trans=np.tile([0, 0, 3.0], (FRAMES, 1)), betas=np.ones((FRAMES, 10)),
                                             frame_ids=np.array([4, 0, 2])))
    start = read_start(tmp_path / "start.npz", 6)
    np.testing.assert_allclose(start.rotations[[4, 0, 2], :22], rotation.exp(vectors[:, :22]), atol=1e-4)
    assert np.isnan(start.rotations[:, 22:]).all() and start.betas is None
    assert start.given.tolist() == [True, False, True, False, True, False]


def test_fingers_bend_from_the_bodys_mean_hand(vectors, tmp_path):
    means = np.repeat([[0.1], [-0.1]], 15, 0) * np.ones(3)
    path = zip_of(tmp_path / "start", {f"{t}.json": exavatar(vectors, t) for t in range(FRAMES)})
    start = read_start(path, FRAMES, means)
    np.testing.assert_allclose(start.rotations[:, LEFT_HAND], rotation.exp(vectors[:, LEFT_HAND] + 0.1), atol=1e-4)
    np.testing.assert_allclose(start.rotations[:, 40:], rotation.exp(vectors[:, 40:] - 0.1), atol=1e-4)


def test_coefficients_of_the_hands_components_are_added_to_the_mean_as_the_smplx_package_does(tmp_path):
    rng = np.random.default_rng(3)
    components, means = rng.normal(0, 0.2, (2, 45, 45)), rng.normal(0, 0.3, (30, 3))
    left, right = rng.normal(0, 1, (FRAMES, 12)), rng.normal(0, 1, (FRAMES, 12))
    (tmp_path / "start.npz").write_bytes(npz(global_orient=np.zeros((FRAMES, 3)), body_pose=np.zeros((FRAMES, 63)),
                                             left_hand_pose=left, right_hand_pose=right))
    start = read_start(tmp_path / "start.npz", FRAMES, means, components)
    for hand, given, side in ((LEFT_HAND, left, 0), (RIGHT_HAND, right, 1)):
        fingers = sum(given[:, i, None] * components[side, i] for i in range(12)).reshape(FRAMES, 15, 3) + means[15 * side:][:15]
        np.testing.assert_allclose(start.rotations[:, hand], rotation.exp(fingers), atol=1e-4)
    with pytest.raises(ArtifactError, match="left_hand_pose has 12 numbers a frame; expected 45"):
        read_start(tmp_path / "start.npz", FRAMES, means)


def test_a_wrong_number_of_frames_is_named(vectors, tmp_path):
    path = zip_of(tmp_path / "start", {f"{t + 8}.json": exavatar(vectors, t) for t in range(FRAMES)})
    assert read_start(path, FRAMES).given.all(), "as many as the clip's: in order"
    with pytest.raises(ArtifactError, match="holds 3 frames, numbered 8 to 10, but the clip has 5"):
        read_start(path, 5)
    (tmp_path / "all.npz").write_bytes(npz(**hand4whole(vectors)))
    with pytest.raises(ArtifactError, match="holds 3 frames, but the clip has 5"):
        read_start(tmp_path / "all.npz", 5)


def test_a_file_that_holds_no_poses_is_refused_with_its_fault(vectors, tmp_path):
    def refuse(members, match):
        with pytest.raises(ArtifactError, match=match):
            read_start(zip_of(tmp_path / "start", members), FRAMES)

    refuse({"readme.txt": b""}, "no frame's file")
    refuse({"0.json": b"[1"}, "0.json is not readable")
    refuse({"0.json": b"[1]"}, "none of the layouts ExAvatar")
    refuse({"0.json": b'{"a": 1}'}, "none of the layouts ExAvatar")
    refuse({"0_0.npz": smpler_x(vectors, 0), "0_1.npz": smpler_x(vectors, 1)}, "one person's files")
    refuse({"0.json": exavatar(vectors, 0), "1.json": b"{}"}, "every frame needs the same arrays")
    wrong = json.loads(exavatar(vectors, 0)) | {"body_pose": [[0.0] * 3] * 23}
    refuse({"0.json": json.dumps(wrong).encode()}, "body_pose has 69 numbers a frame; expected 63")
    (tmp_path / "pickle.npz").write_bytes(npz(pose=np.array([{}], object)))
    with pytest.raises(ArtifactError, match="pickled"):
        read_start(tmp_path / "pickle.npz", 1)


def test_poses_are_looked_at_before_they_are_kept(vectors, tmp_path):
    check_model("poses", zip_of(tmp_path / "good", {"0.json": exavatar(vectors, 0)}))
    (tmp_path / "short.npz").write_bytes(npz(pose=np.zeros((4, 69)), trans=np.zeros((4, 3))))
    with pytest.raises(BadInput, match="pose has 69 numbers a frame"):
        check_model("poses", tmp_path / "short.npz")


@pytest.mark.parametrize("name", ["global_orient", "root_pose", "pose"])
@pytest.mark.parametrize("values", [np.float64(1), np.zeros((0, 3)), np.array(["a", "b", "c"])])
def test_an_array_without_a_number_for_each_frame_is_refused(tmp_path, name, values):
    (tmp_path / "start.npz").write_bytes(npz(**{name: values, "body_pose": np.zeros((FRAMES, 63))}))
    with pytest.raises(ArtifactError, match=r"start.npz: its arrays of numbers \(body_pose\) are of none of the layouts"):
        read_start(tmp_path / "start.npz", FRAMES)


@pytest.mark.parametrize("ids", [np.array(["0", "1", "2"]), np.full(FRAMES, np.nan), np.zeros(0, int)])
def test_frame_numbers_that_are_none_are_named(tmp_path, ids):
    (tmp_path / "start.npz").write_bytes(npz(pose=np.zeros((FRAMES, 72)), frame_ids=ids))
    with pytest.raises(ArtifactError, match="start.npz: frame_ids holds no whole numbers"):
        read_start(tmp_path / "start.npz", FRAMES)


def test_shape_and_place_may_have_an_axis_of_one_person_and_a_shape_that_is_not_finite_is_named(tmp_path):
    arrays = {"global_orient": np.zeros((FRAMES, 1, 3)), "body_pose": np.zeros((FRAMES, 21, 3)), "gender": np.array("neutral"),
              "transl": np.tile([0, 0, 3.0], (FRAMES, 1, 1)), "betas": np.full((FRAMES, 1, 10), 0.5)}
    (tmp_path / "start.npz").write_bytes(npz(**arrays))
    start = read_start(tmp_path / "start.npz", FRAMES)
    np.testing.assert_array_equal(start.betas, np.full(10, 0.5))
    np.testing.assert_array_equal(start.transl, np.tile([0, 0, 3.0], (FRAMES, 1)))
    (tmp_path / "start.npz").write_bytes(npz(**arrays | {"betas": np.full((FRAMES, 10), np.nan)}))
    with pytest.raises(ArtifactError, match=r"start.npz: the shape has a number that is not finite"):
        read_start(tmp_path / "start.npz", FRAMES)
