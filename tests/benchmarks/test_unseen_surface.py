"""How far a fit's surface lands from the truth's: nothing where the fit is true, and on the part that is wrong where it is not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.artifacts import read_arrays
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.joints import INDEX, J
from gsac.benchmarks.unseen_surface import Scene, measure, parts_of_vertices
from gsac.turntable.clip import make_clip

PIXEL = 1.0
"""px, of a correspondence through the middles of pixels."""


@pytest.fixture(scope="module")
def body() -> Body:
    return Body.load()


def make_scene(body: Body, poses: np.ndarray, betas: np.ndarray) -> Scene:
    """poses: (T, 55, 3) of bodies that face the camera."""
    poses = poses.copy()
    poses[:, 0] = [np.pi, 0, 0]
    still, place = np.zeros((len(poses), body.exprdirs.shape[2])), np.tile([0, 0.3, 3.0], (len(poses), 1))
    params = BodyParams.from_pose(poses, place, betas, still, 670.0, (180, 320), model=body.digest)
    params.joints = body.posed_joints(params)
    return Scene(params, body.posed(params)[0], body.faces, parts_of_vertices(body))


def put_arms(down: float) -> np.ndarray:
    """(2, 55, 3), arms turned down by degrees from the T-pose."""
    pose = np.zeros((2, J, 3))
    for side, sign in (("left", 1), ("right", -1)):
        pose[:, INDEX[f"{side}_shoulder"], 2] = -sign * np.radians(down)
    return pose


def test_the_truth_itself_misses_by_less_than_a_pixel(body):
    betas = np.zeros(body.num_betas)
    clip, unseen = make_scene(body, put_arms(55), betas), make_scene(body, put_arms(10), betas)

    misses = measure(body, clip.params, clip, unseen)

    assert all(len(miss) for miss in misses.values())
    assert max(float(np.median(miss)) for miss in misses.values()) < PIXEL


def test_a_shoulder_that_stands_elsewhere_shows_where_the_arms_move_and_not_on_the_legs(body):
    betas = np.zeros(body.num_betas)
    clip, unseen = make_scene(body, put_arms(55), betas), make_scene(body, put_arms(10), betas)
    turned = put_arms(45)  # what a fit takes for the same arm, with its bones 10 degrees off
    fit = replace(clip.params, body_pose=BodyParams.from_pose(
        turned, np.zeros((2, 3)), betas, clip.params.expression, 670.0, (180, 320)).body_pose)

    misses = measure(body, fit, clip, unseen)

    arm = 670.0 / 3 * np.radians(10) * 0.1  # px, 10 cm below the shoulder
    assert np.median(misses["upper arms"]) > arm
    assert np.median(misses["forearms"]) > np.median(misses["upper arms"])
    assert np.median(misses["shanks"]) < PIXEL


def test_frames_in_which_the_back_is_seen_tell_nothing_of_poses_that_face_the_camera(body):
    clip = make_scene(body, put_arms(55), np.zeros(body.num_betas))
    clip.params.global_orient[:] = [0, 0, np.pi]  # upright, with the back to the camera

    misses = measure(body, clip.params, clip, clip)

    assert not sum(map(len, misses.values()))


@pytest.fixture(scope="module")
def folders(tmp_path_factory) -> dict[str, Path]:
    """One person: a turn and unseen poses with the surface as drawn, and a turn without."""
    root, size = tmp_path_factory.mktemp("people"), {"seed": 3, "frames": 2, "height": 320, "supersample": 1}
    make_clip(root / "turn", **size, drawn=True)
    make_clip(root / "unseen", **size, drawn=True, poses="novel")
    make_clip(root / "bare", **size)
    return {name: root / name for name in ("turn", "unseen", "bare")}


def test_a_surface_as_drawn_is_missed_by_a_body_without_its_clothes(body, folders):
    clip, unseen = (Scene.read(folders[name], body) for name in ("turn", "unseen"))
    bare, bare_unseen = (scene._replace(vertices=read_arrays(folders[name] / "truth.npz")["vertices"], faces=body.faces,
                                        part=parts_of_vertices(body)) for name, scene in (("turn", clip), ("unseen", unseen)))

    drawn_misses, bare_misses = measure(body, clip.params, clip, unseen), measure(body, clip.params, bare, bare_unseen)

    assert drawn_misses["trunk"].mean() > 1.1 * bare_misses["trunk"].mean()
    assert drawn_misses["hands"].mean() == pytest.approx(bare_misses["hands"].mean(), rel=0.1)  # they wear nothing


def test_a_bare_clip_beside_drawn_poses_is_refused_with_what_to_do(body, folders):
    clip, unseen = (Scene.read(folders[name], body) for name in ("bare", "unseen"))
    with pytest.raises(ValueError, match="both with or both without --drawn"):
        measure(body, clip.params, clip, unseen)
