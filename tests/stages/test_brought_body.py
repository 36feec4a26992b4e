"""A body file of the official keys that the user brings goes through smplx, train and export like the open one."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gsac import unity
from gsac.avatar.artifacts import Clip, write_arrays
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.frame_files import write_alpha, write_frame
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.zbuffer import rasterise
from gsac.stages import export, smplx, train
from gsac.stages.contract import BadInput, Job, make_config
from gsac.stages.export.stage import run as run_export
from gsac.stages.smplx.stage import run as run_smplx
from gsac.stages.train.stage import run as run_train
from support import mono
from support.bending import pose_in_unity, pose_in_viewer
from support.official_body import official_file

WIDTH, HEIGHT, FOCAL, FRAMES = 180, 320, 350.0, 6
JAW_OPEN = 24
TRAIN = {"body_model": "mine", "gaussians": 600, "steps": 30, "height": 128, "holdout": 3, "pose_test_steps": 2, "device": "cpu"}


@pytest.fixture(scope="module")
def mine(tmp_path_factory) -> Path:
    """The open body's mesh under the official keys: 10 + 10 directions, no keypoint matrix, no names."""
    body = Body.load()
    path = tmp_path_factory.mktemp("body") / "SMPLX_MINE.npz"
    np.savez(path, v_template=body.v_template, f=body.faces.astype(np.uint32), J_regressor=body.J_regressor, weights=body.weights,
             shapedirs=np.concatenate([body.shapedirs[:, :, :10], body.exprdirs[:, :, :10]], 2),
             kintree_table=np.array([[2**32 - 1, *body.parents[1:]], range(55)], np.uint32))
    return path


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    """The open body's mesh in a whole official file: 300 + 100 directions, pose correctives, mean hands."""
    return official_file(tmp_path_factory.mktemp("whole") / "SMPLX_WHOLE.npz", mesh="open")


@pytest.fixture(scope="module")
def inputs(mine, tmp_path_factory) -> dict[str, Path]:
    """A turn of that body, detected exactly, its mouth open."""
    return film(Body.load(mine), tmp_path_factory.mktemp("inputs"))


def film(body: Body, root: Path, elbow: float = 0.0) -> dict[str, Path]:
    """The stages' inputs: a turn of a body, detected exactly, its mouth open and its elbows bent by so many rad."""
    pose = np.zeros((FRAMES, 55, 3))
    pose[:, 16, 2], pose[:, 17, 2] = -0.9, 0.9
    pose[:, 18, 1], pose[:, 19, 1] = -elbow, elbow
    for t, yaw in enumerate(np.linspace(-2.5, 2.5, FRAMES)):
        pose[t, 0] = np.pi * np.array([np.cos(yaw / 2), 0, np.sin(yaw / 2)])
    truth = BodyParams.from_pose(pose, np.tile([0, 0, 2.6], (FRAMES, 1)), np.zeros(10), np.zeros((FRAMES, body.exprdirs.shape[2])),
                                 FOCAL, (WIDTH / 2, HEIGHT / 2))
    vertices = body.posed(truth)[0]
    points, camera = body.keypoints(vertices), truth.camera(WIDTH, HEIGHT)
    known = np.isfinite(points).all(-1)
    for name in ("frames", "alpha"):
        (root / name).mkdir()
    for t in range(FRAMES):
        covered = rasterise(vertices[t], body.faces, camera)[0] >= 0
        write_alpha(root / f"alpha/{t:06d}.exr", covered.astype(np.float32))
        write_frame(root / f"frames/{t:06d}.png", np.where(covered[..., None], [200, 120, 60], [40, 40, 40]).astype(np.uint8))
    Clip(10.0, [t / 10 for t in range(FRAMES)], WIDTH, HEIGHT, FOCAL, "0" * 64).write(root / "clip.json")
    xy, world = np.nan_to_num(camera.project(points)), points - points[:, 11:13].mean(1, keepdims=True)
    write_arrays(root / "keypoints.npz", xy=xy.astype(np.float32), score=known.astype(np.float32),
                 missing=np.zeros((FRAMES, 2), bool), filled=np.zeros(known.shape, bool),
                 sigma=np.ones(known.shape, np.float32), world=world.astype(np.float32), detector=np.array("exact"))
    expression = np.zeros((FRAMES, 52), np.float32)
    expression[:, JAW_OPEN] = 1
    write_arrays(root / "face.npz", valid=np.ones(FRAMES, bool), expression=expression, jaw=np.zeros((FRAMES, 3), np.float32),
                 shape=np.zeros(3, np.float32), landmarks=np.full((FRAMES, 468, 3), np.nan, np.float32))
    return {"split/clip.json": root / "clip.json", "split/frames": root / "frames", "segment/alpha": root / "alpha",
            "handgap/keypoints.npz": root / "keypoints.npz", "face/face.npz": root / "face.npz"}


def job(stage, inputs, out, mine, **parameters) -> Job:
    out.mkdir()
    config = make_config(stage.STAGE, parameters)
    return Job(inputs, out, config, models=dict.fromkeys(stage.STAGE.models(config), mine), warn=lambda finding: None)


def test_the_open_body_needs_no_model_file_and_a_brought_one_is_part_of_the_key():
    for stage in (smplx, train, export):
        assert stage.STAGE.models(stage.STAGE.config()) == ()
        assert stage.STAGE.models(make_config(stage.STAGE, {"body_model": "mine"})) == ("mine",)


@pytest.mark.slow
def test_a_brought_body_is_fitted_trained_and_exported(mine, inputs, tmp_path):
    body = Body.load(mine)
    run_smplx(job(smplx, inputs, tmp_path / "smplx", mine, body_model="mine"))
    fitted = BodyParams.read(tmp_path / "smplx/body.npz")
    assert fitted.model == body.digest and fitted.betas.shape == (10,) and fitted.expression.shape == (FRAMES, 10)
    assert np.all(fitted.jaw_pose[:, 0] > 0.3), "an official body opens its mouth by the jaw"
    run_train(job(train, inputs | {"smplx/body.npz": tmp_path / "smplx/body.npz"}, tmp_path / "train", mine, **TRAIN))
    trained = {"train/body.npz": tmp_path / "train/body.npz", "train/avatar.npz": tmp_path / "train/avatar.npz"}
    run_export(job(export, inputs | trained, tmp_path / "export", mine, body_model="mine"))
    avatar = RiggedAvatar.read(tmp_path / "export/avatar.gsac")
    assert avatar.provenance["body_model"] == body.digest and len(avatar.vertices) == len(body.v_template)
    with pytest.raises(BadInput, match="export.body_model open"):
        run_export(job(export, inputs | trained, tmp_path / "other", mine))


@pytest.mark.slow
def test_a_whole_file_is_fitted_trained_and_exported_and_its_elbow_bends_alike_everywhere(whole, tmp_path):
    body = Body.load(whole)
    inputs = film(body, tmp_path, elbow=1.2)
    run_smplx(job(smplx, inputs, tmp_path / "smplx", whole, body_model="mine"))
    fitted = BodyParams.read(tmp_path / "smplx/body.npz")
    assert fitted.betas.shape == (20,) and fitted.expression.shape == (FRAMES, 100)
    inputs |= {"smplx/body.npz": tmp_path / "smplx/body.npz"}
    run_train(job(train, inputs, tmp_path / "train", whole, **TRAIN))
    inputs |= {"train/body.npz": tmp_path / "train/body.npz", "train/avatar.npz": tmp_path / "train/avatar.npz"}
    run_export(job(export, inputs, tmp_path / "export", whole, body_model="mine"))
    params, pose = BodyParams.read(tmp_path / "train/body.npz"), np.zeros((1, 55, 3), np.float32)
    pose[0, 18, 1], pose[0, 16, 2] = -2.0, -0.6
    still = BodyParams.from_pose(pose, np.zeros((1, 3)), params.betas, np.zeros((1, 100)), 500.0, (0, 0), params.joint_offset)
    bent, plain = (each.posed(still)[0][0] for each in (body, replace(body, posedirs=None)))
    file = tmp_path / "export/avatar.gsac"
    assert np.linalg.norm(bent - plain, axis=1).max() > 5e-3
    assert np.linalg.norm(RiggedAvatar.read(file).posed(pose[0]) - bent, axis=1).max() < 1e-4
    (tmp_path / "modules").mkdir()
    assert np.linalg.norm(pose_in_viewer(file, pose[0], tmp_path / "modules")["vertices"] - bent, axis=1).max() < 1e-4
    if not mono.missing_packages():
        (tmp_path / "scripts").mkdir()
        exe = mono.compile_package(Path(unity.__file__).parent, tmp_path / "scripts")
        posed = pose_in_unity(lambda *words: mono.run(exe, *words), file, pose[0], tmp_path)
        assert np.linalg.norm(posed - bent, axis=1).max() < 1e-4


def test_a_file_that_is_no_body_is_refused_by_parameter_and_array(inputs, tmp_path):
    np.savez(tmp_path / "wrong.npz", v_template=np.zeros((3, 3)))
    with pytest.raises(BadInput, match="smplx.body_model is mine.*array f is missing"):
        run_smplx(job(smplx, inputs, tmp_path / "smplx", tmp_path / "wrong.npz", body_model="mine"))
