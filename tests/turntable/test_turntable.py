"""Truth clips: what the files promise, from the options to the last frame."""

import dataclasses
from typing import get_args

import cv2
import numpy as np
import pytest

from gsac.avatar.artifacts import BODY_SHAPES, frame_paths, read_arrays
from gsac.avatar.body import Body
from gsac.avatar.camera import Camera
from gsac.avatar.joints import INDEX
from gsac.avatar.zbuffer import silhouette
from gsac.turntable import clip
from gsac.turntable.__main__ import main
from gsac.turntable.motion import make_motion
from gsac.turntable.options import HiddenHand, TurntableOptions
from gsac.turntable.person import make_person
from gsac.turntable.shell import cut_mesh, drape, pull_to_hull

SMALL = TurntableOptions(seed=3, frames=6, height=320, lossless=True)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    out = tmp_path_factory.mktemp("turn")
    assert clip.make_clip(out, SMALL) == out / "clip.mp4"
    return out, read_arrays(out / "truth.npz")


def masks(out):
    return np.stack([cv2.imread(str(p), cv2.IMREAD_GRAYSCALE) for p in frame_paths(out / "mask")])


def pixels(points, truth):
    return points[..., :2] / points[..., 2:] * truth["focal"] + truth["center"]


def test_truth_has_the_promised_arrays(made):
    _, truth = made
    shapes = {"focal": (2,), "center": (2,), "joints": (6, 55, 3), "vertices": (6, 13718, 3), "keypoints": (6, 133, 2),
              "keypoints_visible": (6, 133), "expression": (6, 52), "yaw": (6,), "hidden": (6, 2), "height_m": (),
              "body_pose": (6, 63), "transl": (6, 3)}
    assert {k: truth[k].shape for k in shapes} == shapes
    assert 1.3 < truth["height_m"] < 2.2


def test_masks_are_the_silhouettes_of_the_drawn_person(made):
    out, truth = made
    person = make_person(SMALL, np.random.default_rng([SMALL.seed, 1]))
    motion = make_motion(person.body, person.joints, SMALL, np.random.default_rng([SMALL.seed, 2]))
    studio = clip.make_studio(person, SMALL)
    params = clip.place_person(person, motion, studio.view)
    camera = studio.view.camera.scaled(360, 640)
    for t, mask in enumerate(masks(out)):
        assert mask.shape == (320, 180)
        drawn = clip.pose_person(person, params, t)[1]
        cover = silhouette(drawn, person.faces, camera).reshape(320, 2, 180, 2).mean((1, 3))
        np.testing.assert_allclose(mask, cover * 255, atol=0.51)


def test_the_bare_body_lies_inside_clothes_and_hair(made):
    out, truth = made
    faces = Body.load().faces
    for mask, vertices in zip(masks(out), truth["vertices"], strict=True):
        bare = silhouette(vertices, faces, Camera(tuple(truth["focal"]), tuple(truth["center"]), 180, 320))
        assert (mask[bare] > 0).mean() > 0.995
        assert 1.05 < (mask > 127).sum() / bare.sum() < 1.6


def test_joints_project_into_the_person(made):
    out, truth = made
    xy = pixels(truth["joints"], truth)
    assert (xy > 0).all() and (xy < [180, 320]).all()
    for mask, points in zip(masks(out), xy, strict=True):
        x, y = points.astype(int).T
        assert (mask[y, x] > 127).mean() > 0.95


def test_the_parameters_pose_the_body_that_is_seen(made):
    """The file's own shift added to the T-pose, the loader's LBS gives the truth's vertices and joints."""
    from gsac.avatar.body import BodyParams

    _, truth = made
    body = Body.load()
    moved = dataclasses.replace(body, v_template=body.v_template + truth["shift"])
    names = [name for name in BODY_SHAPES if name not in ("model", "sigma_joints", "joint_offset")]
    offset = truth["joint_offset"] - body.J_regressor @ truth["shift"]
    params = BodyParams(**{n: truth[n] for n in names}, joint_offset=offset, model="", sigma_joints=np.zeros((6, 55)))
    vertices, joints = moved.posed(params)
    np.testing.assert_allclose(vertices, truth["vertices"], atol=2e-4)
    np.testing.assert_allclose(joints, truth["joints"], atol=2e-4)


def test_the_body_leaves_the_shape_basis_and_can_be_kept_inside():
    def beyond(options):
        person = make_person(options, np.random.default_rng([options.seed, 1]))
        shift = person.rest[: len(person.body.v_template)] - person.body.rest(person.betas)[0]
        basis = person.body.shapedirs.reshape(-1, person.body.num_betas)
        best = np.linalg.lstsq(basis, shift.reshape(-1), rcond=None)[0]
        return np.linalg.norm((shift.reshape(-1) - basis @ best).reshape(-1, 3), axis=1).max()

    assert beyond(SMALL) > 0.004
    assert beyond(dataclasses.replace(SMALL, outside=0.0)) < 1e-4


def test_one_turn_covers_all_sides_unevenly():
    options = dataclasses.replace(SMALL, frames=60)
    person = make_person(options, np.random.default_rng(1))
    motion = make_motion(person.body, person.joints, options, np.random.default_rng(2))
    steps = np.diff(np.append(motion.yaw, motion.yaw[0] + 2 * np.pi))
    assert (steps > 0).all() and steps.max() < np.radians(15)
    assert steps.std() > 0.1 * steps.mean()
    still = make_motion(person.body, person.joints, dataclasses.replace(options, sway=0.0, arm_swing=0.0, expression=False),
                        np.random.default_rng(2))
    np.testing.assert_allclose(np.diff(still.yaw), 2 * np.pi / 60)
    assert np.ptp(still.pose[:, 1:], axis=0).max() == 0 and not still.expression.any()


def test_planted_feet_stay_where_they_are_until_they_step():
    options = dataclasses.replace(SMALL, frames=60, feet="planted")
    person = make_person(options, np.random.default_rng(1))
    motion = make_motion(person.body, person.joints, options, np.random.default_rng(2))
    view = clip.make_view(person, options, np.random.default_rng(3))
    params = clip.place_person(person, motion, view)
    feet = np.stack([view.to_world(clip.pose_person(person, params, t)[2][clip.FEET]) for t in range(60)])
    way = np.linalg.norm(np.diff(feet, axis=0), axis=-1)  # left and right ankles, left and right balls
    still = np.stack([way[:, [0, 2]].max(1), way[:, [1, 3]].max(1)], 1) < 1e-3
    assert (still.mean(0) > 0.4).all() and still.any(1).mean() > 0.9 and way.max() > 0.05
    assert np.abs(params.pose[:, [4, 5], 0]).max() < np.radians(60) and np.ptp(feet[:, :2, 1], axis=0).min() > 0.05


def test_the_person_stands_on_the_floor_and_faces_the_camera_first(made):
    out, truth = made
    first, half = truth["joints"][0], truth["joints"][3]
    assert first[16, 0] > first[17, 0] and half[16, 0] < half[17, 0]  # left shoulder at the image's right, then swapped
    world = truth["vertices"] @ truth["rotation"] + truth["eye"]
    lowest = world[..., 1].min(1)
    assert (lowest > 0).all() and (lowest < 0.035).all()  # soles under bare feet


def test_equal_options_give_equal_files_and_another_seed_another_person(made, tmp_path):
    out, truth = made
    clip.make_clip(tmp_path / "again", SMALL)
    for name in ["clip.mp4", "truth.npz", "mask/000002.png", "frames/000004.png"]:
        assert (tmp_path / "again" / name).read_bytes() == (out / name).read_bytes(), name
    clip.make_clip(tmp_path / "other", dataclasses.replace(SMALL, seed=4, frames=1))
    assert not np.allclose(read_arrays(tmp_path / "other" / "truth.npz")["betas"], truth["betas"])


def test_a_clip_that_was_stopped_leaves_no_half_video(tmp_path):
    def stop(done, total, what):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        clip.make_clip(tmp_path, dataclasses.replace(SMALL, frames=2, height=64), stop)
    assert not list(tmp_path.glob("*clip.mp4*"))


@pytest.mark.slow
@pytest.mark.parametrize("hand", [h for h in get_args(HiddenHand) if h != "none"])
def test_a_hidden_hand_is_flagged_while_it_is_away(hand, tmp_path):
    options = TurntableOptions(seed=5, frames=20, height=240, hidden_hand=hand, supersample=2, vertices=False)
    clip.make_clip(tmp_path, options)
    truth = read_arrays(tmp_path / "truth.npz")
    side = 0 if hand.startswith("left") else 1
    start, stop = options.hidden
    away = (np.arange(20) / 20 >= start) & (np.arange(20) / 20 <= stop)
    assert away.sum() >= 3
    assert truth["hidden"][away, side].mean() >= 0.75
    points = slice(91, 112) if side == 0 else slice(112, 133)
    seen = truth["keypoints_visible"][:, points].mean(1)
    assert seen[truth["hidden"][:, side]].mean() < 0.3 < seen[~truth["hidden"][:, side]].mean()
    assert "vertices" not in truth


def test_face_keypoints_are_visible_from_the_front_only(made):
    _, truth = made
    nose = truth["keypoints_visible"][:, 0]
    assert nose[0] and not nose[3]


def test_novel_poses_are_png_frames_with_masks(tmp_path):
    options = TurntableOptions(seed=2, frames=7, height=240, poses="novel")
    assert clip.make_clip(tmp_path, options) == tmp_path / "frames"
    assert len(frame_paths(tmp_path / "frames")) == len(frame_paths(tmp_path / "mask")) == 7
    assert not (tmp_path / "clip.mp4").exists()
    truth = read_arrays(tmp_path / "truth.npz")
    xy = pixels(truth["joints"], truth)
    assert (xy > 0).all() and (xy < [136, 240]).all()
    hips_over_floor = ((truth["joints"] @ truth["rotation"]) + truth["eye"])[:, 0, 1]
    assert hips_over_floor.min() < 0.85 * hips_over_floor.max()  # the squat


def test_strong_poses_bend_elbows_and_knees_by_100_degrees_and_more_and_the_camera_comes_nearer(tmp_path):
    options = TurntableOptions(seed=2, frames=6, height=64, supersample=1, poses="strong")
    changes = {"far": {}, "near": {"distance": 0.5, "frames": 1}}
    far, near = (read_arrays(clip.make_clip(tmp_path / name, dataclasses.replace(options, **change)).parent / "truth.npz")
                 for name, change in changes.items())
    bend = np.degrees(np.linalg.norm(far["body_pose"].reshape(6, 21, 3), axis=2))
    elbows, knees = (bend[:, [INDEX[f"{side}_{joint}"] - 1 for side in ("left", "right")]].max(1) for joint in ("elbow", "knee"))
    assert (elbows >= 100).sum() == 4 and (knees >= 100).sum() == 2
    np.testing.assert_array_equal(near["body_pose"][0], far["body_pose"][0])
    assert near["joints"][0, :, 2].mean() == pytest.approx(0.5 * far["joints"][0, :, 2].mean(), rel=0.15)


def test_bad_options_are_named():
    for change, word in (({"height": 33}, "even"), ({"poses": "dance"}, "poses"), ({"hidden_hand": "x"}, "hidden_hand"),
                         ({"frames": 0}, "frames"), ({"noise": -1.0}, "noise"), ({"distance": 0.0}, "distance"),
                         ({"hidden_from": 0.9, "hidden_to": 0.2}, "hidden_from")):
        with pytest.raises(ValueError, match=word):
            TurntableOptions(**change).check()
    with pytest.raises(TypeError, match="speed"):
        clip.make_clip("unused", speed=3)


def test_command_line_makes_a_clip_and_refuses_a_bad_size(tmp_path, capsys):
    assert main([str(tmp_path / "bad"), "--height", "33"]) == 2
    assert "even" in capsys.readouterr().err and not (tmp_path / "bad").exists()
    assert main([str(tmp_path / "ok"), "--frames", "2", "--height", "64", "--no-expression", "--focal", "70"]) == 0
    truth = read_arrays(tmp_path / "ok" / "truth.npz")
    assert (tmp_path / "ok" / "clip.mp4").stat().st_size > 0
    assert truth["focal"].tolist() == [70, 70] and not truth["expression"].any()


def test_a_cut_follows_the_fields_zero_line():
    vertices = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    pair, share, faces = cut_mesh(np.array([[0, 1, 2], [0, 2, 3]]), 0.75 - vertices[:, 0])
    points = vertices[pair[:, 0]] + (vertices[pair[:, 1]] - vertices[pair[:, 0]]) * share[:, None]
    a, b, c = points[faces].transpose(1, 0, 2)
    area = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]).sum()
    assert area == pytest.approx(0.75) and points[:, 0].max() == pytest.approx(0.75)


def test_draped_cloth_falls_straight_below_a_bulge():
    angle, y = np.meshgrid(np.linspace(0, 2 * np.pi, 60, endpoint=False), np.linspace(0, 1, 60))
    radius = 0.1 + 0.1 * np.exp(-((y - 0.8) / 0.05) ** 2)
    points = np.stack([radius * np.sin(angle), y, radius * np.cos(angle)], -1).reshape(-1, 3)
    out = np.hypot(*drape(points, np.ones(len(points)), slope=0.1)[:, [0, 2]].T).reshape(60, 60)
    assert (out >= radius - 1e-9).all()
    assert out[30].min() > 0.15 and abs(out[-1] - 0.1).max() < 0.02


def test_capped_points_lie_on_the_hull():
    points = np.random.default_rng(0).normal(size=(200, 3))
    out = pull_to_hull(points, np.ones(200))
    from scipy.spatial import ConvexHull

    depth = (ConvexHull(points).equations @ np.c_[out, np.ones(200)].T).max(0)
    np.testing.assert_allclose(depth, 0, atol=1e-9)
