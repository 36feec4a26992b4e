"""The paper's own pipeline from frames to avatar, network by network, each a made-up one of the official shapes."""

import json

import av
import cv2
import numpy as np
import pytest

from gsac.avatar.artifacts import read_arrays
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.frame_files import write_frame
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.network_files import ModelMissingError, model_path
from gsac.avatar.wholebody import HANDS, INDEX, LEFT_HAND
from gsac.cache.root import default_root
from gsac.cache.store import Store
from gsac.pipeline.keys import Keys
from gsac.pipeline.model_check import check_model
from gsac.pipeline.model_store import ModelStore
from gsac.pipeline.params import resolve
from gsac.pipeline.project import Project
from gsac.stages.contract import Job
from gsac.stages.face.deca import CODES, EXPRESSION, JAW
from gsac.stages.smplx.paper import fit as paper
from gsac.turntable.clip import make_clip
from support.onnx_files import write_encoder, write_figure

FRAMES, LOST = 8, slice(3, 5)
"""Of which the crop has no blue where the left hand is lost: that tells the made-up network of key points."""
PAPER = ("keypoints.detector=onnx-wholebody", "handgap.method=paper", "handgap.rule=paper", "segment.method=brought",
         "face.flame=flame", "face.method=deca", "smplx.start=my-poses", "smplx.method=paper", "train.recipe=paper",
         "train.steps=2", "train.pose_test_steps=2", "train.lpips=none", "split.photo_fps=10", "split.count=null")
USED = {"onnx-wholebody": {"keypoints"}, "flame": {"face"}, "flame-points": {"face"}, "deca-encoder": {"face"},
        "my-poses": {"smplx"}}
"""Brought file -> the stages whose keys its digest is part of."""
PASSES = (paper.Pass(60, 0.1, (45,), 20, True), paper.Pass(20, 0.01, (), 0, True), paper.Pass(20, 0.01, (), 0, False))


@pytest.fixture(scope="module")
def footage(tmp_path_factory):
    """Frames of a made-up person with the truth's masks beside them."""
    root = tmp_path_factory.mktemp("truth")
    make_clip(root, seed=3, frames=FRAMES, height=288)
    folder = root / "footage"
    (folder / "masks").mkdir(parents=True)
    with av.open(str(root / "clip.mp4")) as film:
        for t, frame in enumerate(film.decode(video=0)):
            image = frame.to_ndarray(format="rgb24")
            image[..., 2] *= not LOST.start <= t < LOST.stop
            write_frame(folder / f"{t:06d}.png", image)
            (root / f"mask/{t:06d}.png").rename(folder / f"masks/{t:06d}.png")
    return folder


def write_points(path, shift=0.0):
    """Key points of a person who faces the camera, in the middle of the crop."""
    body = Body.load()
    points = body.keypoints(body.v_template)
    known = np.isfinite(points).all(1)
    points = np.where(known[:, None], points, points[INDEX["nose"]])
    low, high = points.min(0), points.max(0)
    scale = min(384 / (high - low)[1], 288 / (high - low)[0]) / 1.25
    at = np.array([144 + shift, 192]) + (points - (low + high) / 2)[:, :2] * scale * [1, -1]
    lost = np.where(known, 0.9, 0.05)
    seen = lost.copy()
    lost[[*range(LEFT_HAND.start, LEFT_HAND.stop), INDEX["left_wrist"]]] = 0.1
    return write_figure(path, at, seen, lost)


def write_codes(path, jaw=0.1):
    constant = np.zeros(CODES)
    constant[EXPRESSION], constant[JAW] = np.linspace(-0.5, 0.5, 50), [jaw, 0, 0]
    return write_encoder(path, np.zeros((12, CODES)), constant)


def write_poses(path, bend=0.0):
    """Hand4Whole's raw numbers of a person who faces the camera."""
    straight = np.tile(np.eye(3)[:, :2].ravel(), 30)
    shoulder = np.array([[np.cos(bend), -np.sin(bend)], [np.sin(bend), np.cos(bend)], [0, 0]]).ravel()
    body = straight[:126].copy()
    body[15 * 6:16 * 6] = shoulder
    np.savez(path, root_pose=np.tile(np.diag([1.0, -1, -1])[:, :2].ravel(), (FRAMES, 1)), body_pose=np.tile(body, (FRAMES, 1)),
             lhand_pose=np.tile(straight[:90], (FRAMES, 1)), rhand_pose=np.tile(straight[:90], (FRAMES, 1)),
             jaw_pose=np.tile(straight[:6], (FRAMES, 1)))
    return path


def bring(store, name, *files):
    check_model(name, *files)
    ModelStore(store).add(name, *files, force=True)


@pytest.fixture(scope="module")
def store(tmp_path_factory, flame_file, flame_points_file):
    """A store of its own with our networks and the brought ones."""
    root = tmp_path_factory.mktemp("store")
    files, store = root / "files", Store(root / "cache")
    files.mkdir()
    project = Project.at_hand()
    configs = resolve(project, sets=PAPER)
    for name in project.graph.steps:
        for model in project.stage(name).models(configs[name]):
            if model not in USED:
                try:
                    ModelStore(store).add(model, model_path(model, default_root()))
                except ModelMissingError as missing:
                    pytest.skip(str(missing))
    bring(store, "onnx-wholebody", write_points(files / "points.onnx"))
    bring(store, "deca-encoder", write_codes(files / "codes.onnx"))
    bring(store, "my-poses", write_poses(files / "poses.npz"))
    bring(store, "flame", flame_file)
    bring(store, "flame-points", flame_points_file)
    return store


@pytest.fixture(scope="module")
def made(footage, store, tmp_path_factory):
    """The folder of all eight stages' outputs, and the brought files that each was handed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(paper.fit_clip, "__defaults__", (PASSES,))
        project, out, handed = Project.at_hand(), tmp_path_factory.mktemp("run"), {}
        configs = resolve(project, sets=PAPER)
        for name in project.graph.steps:
            stage = project.stage(name)
            models = ModelStore(store).need(stage.models(configs[name]), lambda message: None)
            handed[name] = {model for model in models if model in USED}
            (out / name).mkdir()
            inputs = {port: footage if port == "clip" else out / port for port in stage.inputs}
            __import__(f"gsac.stages.{name}.stage", fromlist=["run"]).run(Job(inputs, out / name, configs[name], models))
            for output in stage.outputs:
                output.check(out / name / output.path)
        return out, handed


@pytest.mark.slow
def test_each_brought_file_is_used_where_the_paper_uses_it_and_every_result_is_finite(made, footage):
    out, handed = made
    assert handed == {name: {file for file, stages in USED.items() if name in stages} for name in handed}
    found, filled = (read_arrays(out / name / "keypoints.npz") for name in ("keypoints", "handgap"))
    assert str(found["detector"]) != "mediapipe" and (found["score"][:LOST.start, INDEX["left_wrist"]] > 0.8).all()
    lost = np.zeros(FRAMES, bool)
    lost[LOST] = True
    assert ((found["score"][:, HANDS["left"]].max(1) < 0.3) == lost).all()
    assert (filled["filled"][:, INDEX["left_wrist"]] == lost).all()
    assert (filled["missing"] == np.stack([lost, 0 * lost], 1)).all()
    face = read_arrays(out / "face/face.npz")
    seen = face["valid"].astype(bool)
    assert seen.any() and np.allclose(face["flame_jaw"][seen], [0.1, 0, 0], atol=1e-4)
    assert np.allclose(face["flame_expression"][seen], np.linspace(-0.5, 0.5, 50), atol=1e-4)
    alpha = cv2.imread(str(footage / "masks/000000.png"), cv2.IMREAD_UNCHANGED)
    assert len(list((out / "segment/alpha").glob("*.exr"))) == FRAMES and alpha.any()
    for name in ("smplx", "train"):
        arrays = read_arrays(out / name / "body.npz")
        assert all(np.isfinite(a).all() for n, a in arrays.items() if a.dtype.kind == "f" and n != "sigma_joints"), name
        assert arrays["body_pose"].shape == (FRAMES, 63) and arrays["transl"].shape == (FRAMES, 3)
    avatar = read_arrays(out / "train/avatar.npz")
    assert all(np.isfinite(a).all() for a in avatar.values() if a.dtype.kind == "f") and len(avatar["face"]) == 27420
    figures = json.loads((out / "train/metrics.json").read_text())
    assert figures["recipe"] == "paper" and figures["steps"] == 2 and figures["psnr_fg"] > 5
    assert RiggedAvatar.read(out / "export/avatar.gsac")


@pytest.mark.slow
def test_the_papers_fit_lies_on_the_points_that_it_was_given(made):
    out, _ = made
    body, params = Body.load(), BodyParams.read(out / "smplx/body.npz")
    points = read_arrays(out / "handgap/keypoints.npz")
    clip = json.loads((out / "split/clip.json").read_text())
    xy = params.camera(clip["width"], clip["height"]).project(body.keypoints(body.posed(params)[0]))
    off = np.linalg.norm(xy[:, :17] - points["xy"][:, :17], axis=-1)
    height = np.ptp(points["xy"][:, :23, 1])
    assert np.median(off[points["score"][:, :17] > 0.2]) < 0.05 * height


@pytest.mark.slow
def test_another_file_of_a_name_changes_the_keys_of_the_stages_that_use_it_and_of_no_other(store, tmp_path, flame_file,
                                                                                        flame_points_file):
    def altered(path):
        arrays = dict(np.load(path))
        floats = next(name for name, values in arrays.items() if values.dtype.kind == "f")
        np.savez(tmp_path / path.name, **arrays | {floats: arrays[floats] * np.float32(0.999)})
        return tmp_path / path.name

    project = Project.at_hand()
    configs = resolve(project, sets=PAPER)

    def keys():
        return {name: Keys(project, configs, store).parts(name, {}).models for name in project.graph.steps}

    others = {"onnx-wholebody": write_points(tmp_path / "points.onnx", 1.0),
              "deca-encoder": write_codes(tmp_path / "codes.onnx", 0.2), "my-poses": write_poses(tmp_path / "poses.npz", 0.1),
              "flame": altered(flame_file), "flame-points": altered(flame_points_file)}
    after = keys()
    for name, file in others.items():
        bring(store, name, file)
        before, after = after, keys()
        assert {stage for stage in before if before[stage] != after[stage]} == USED[name], name
