"""segment as a stage: figures on footage with truth, and what it does with frames that show nobody."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from gsac.avatar.artifacts import KEYPOINT_SHAPES, Clip, frame_paths, write_arrays
from gsac.avatar.frame_files import read_alpha, write_frame
from gsac.avatar.network_files import ModelMissingError, model_path
from gsac.stages.contract import Job, StageError
from gsac.stages.segment import stage
from gsac.stages.segment.config import SegmentConfig
from support.artifacts import blank

FOOTAGE = Path(__file__).resolve().parents[4] / "shared" / "footage"
SIZE = (120, 80)


def disc():
    """(H, W) float32: what the stand-in network says of every frame."""
    mask = np.zeros(SIZE, np.float32)
    cv2.circle(mask, (40, 60), 25, 1, -1)
    return mask


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Three frames with a blue disc and points on it; the network is stood in for."""
    (tmp_path / "frames").mkdir()
    rng = np.random.default_rng(0)
    image = np.where(disc()[..., None] > 0, (40, 60, 140), (170, 165, 150)) + rng.normal(0, 2, (*SIZE, 3))
    for i in range(3):
        write_frame(tmp_path / f"frames/{i:06d}.png", image.astype(np.uint8))
    monkeypatch.setitem(stage.METHODS, "pose", lambda models: lambda image, region: disc())
    xy, score = np.zeros((3, 133, 2), np.float32), np.zeros((3, 133), np.float32)
    xy[:, :4], score[:, :4] = [(40, 60), (50, 60), (40, 70), (30, 50)], 0.9
    return tmp_path, xy, score


def segment(folder, xy, score):
    write_arrays(folder / "keypoints.npz", **blank(KEYPOINT_SHAPES, T=len(xy)) | {"xy": xy, "score": score})
    Clip(None, None, SIZE[1], SIZE[0], None, "0").write(folder / "clip.json")
    warnings, seen = [], []
    (folder / "out").mkdir()
    stage.run(Job({"split/frames": folder / "frames", "split/clip.json": folder / "clip.json",
                   "keypoints/keypoints.npz": folder / "keypoints.npz"}, folder / "out", SegmentConfig(),
                  warn=lambda finding: warnings.append(finding.message), progress=lambda *step: seen.append(step)))
    assert seen == [(1, 3, "frames"), (2, 3, "frames"), (3, 3, "frames")]
    return [read_alpha(p) for p in frame_paths(folder / "out/alpha")], warnings


def test_each_frame_gets_its_alpha(folder):
    alphas, warnings = segment(*folder)
    assert len(alphas) == 3 and not warnings
    for alpha in alphas:
        assert ((alpha > 0.5) & (disc() > 0)).sum() / ((alpha > 0.5) | (disc() > 0)).sum() > 0.95
        assert alpha.min() >= 0 and alpha.max() <= 1


def test_a_frame_without_a_person_gets_an_empty_alpha_and_no_second_warning(folder):
    path, xy, score = folder
    score[1] = 0
    alphas, warnings = segment(path, xy, score)
    assert not alphas[1].any() and alphas[0].any() and alphas[2].any()
    assert not warnings, "keypoints has said so"


def test_no_person_anywhere_is_an_error_that_names_a_frame(folder):
    path, xy, score = folder
    with pytest.raises(StageError, match="frame 0 .*no person"):
        segment(path, xy, 0 * score)


def test_an_empty_mask_is_an_error_that_names_the_frame(folder, monkeypatch):
    path, xy, score = folder
    monkeypatch.setitem(stage.METHODS, "pose", lambda models: lambda image, region: 0 * disc())
    with pytest.raises(StageError, match=r"frame 0 \(000000.png\): the mask is empty"):
        segment(path, xy, score)


def test_one_empty_mask_costs_its_frame_and_not_the_run(folder, monkeypatch):
    path, xy, score = folder
    masks = iter([disc(), 0 * disc(), disc()])
    monkeypatch.setitem(stage.METHODS, "pose", lambda models: lambda image, region: next(masks))
    alphas, warnings = segment(path, xy, score)
    assert not alphas[1].any() and alphas[0].any() and alphas[2].any()
    assert warnings == ["The mask of frame 1 is empty although a person was found there."]


def test_keypoints_of_another_clip_are_refused(folder):
    path, xy, score = folder
    with pytest.raises(StageError, match="holds 4 frames, and the clip has 3"):
        segment(path, xy[[0, 1, 2, 2]], score[[0, 1, 2, 2]])


def test_a_frame_that_the_keypoints_lack_gets_an_empty_alpha(folder):
    path, xy, score = folder
    alphas, warnings = segment(path, xy[:2], score[:2])
    assert not alphas[2].any() and alphas[0].any() and alphas[1].any()
    assert not warnings, "handgap says so"


def test_a_plate_that_does_not_fit_is_named_and_left_out(folder):
    path, xy, score = folder
    write_frame(path / "frames/plate.png", np.random.default_rng(1).integers(0, 255, (*SIZE, 3), np.uint8))
    alphas, warnings = segment(path, xy, score)
    assert "all 3 frames" in warnings[0] and "plate" in warnings[0] and alphas[0].any()


@pytest.mark.parametrize(("step", "times", "words"), [
    (6, True, ["The camera moves by up to 15 px, in all 6 frames."]), (0, True, []), (6, False, [])])
def test_a_moving_camera_is_named_with_frames_and_px_but_photos_may_differ(tmp_path, monkeypatch, step, times, words):
    (tmp_path / "frames").mkdir()
    noise = cv2.GaussianBlur(np.random.default_rng(0).normal(size=(400, 300)).astype(np.float32), (0, 0), 3)
    room = np.repeat(np.clip(128 + 40 * noise / noise.std(), 0, 255)[..., None], 3, 2).astype(np.uint8)
    person = cv2.ellipse(np.zeros((400, 200), np.float32), (100, 220), (30, 120), 0, 0, 360, 1, -1)
    for t in range(6):
        frame = np.where(person[..., None] > 0, np.uint8((40, 60, 140)), room[:, t * step: t * step + 200])
        write_frame(tmp_path / f"frames/{t:06d}.png", frame)
    monkeypatch.setitem(stage.METHODS, "pose", lambda models: lambda image, region: person)
    xy, score = np.zeros((6, 133, 2), np.float32), np.zeros((6, 133), np.float32)
    xy[:, :4], score[:, :4] = [(100, 120), (110, 220), (90, 220), (100, 320)], 0.9
    write_arrays(tmp_path / "keypoints.npz", **blank(KEYPOINT_SHAPES, T=6) | {"xy": xy, "score": score})
    Clip(10.0 if times else None, [t / 10 for t in range(6)] if times else None, 200, 400, None, "0").write(tmp_path / "clip.json")
    warnings = []
    stage.run(Job({"split/frames": tmp_path / "frames", "split/clip.json": tmp_path / "clip.json",
                   "keypoints/keypoints.npz": tmp_path / "keypoints.npz"}, tmp_path, SegmentConfig(),
            warn=lambda finding: warnings.append(finding.message)))
    assert [warning.split(". ")[0] + "." for warning in warnings] == words


def test_a_gap_that_the_network_fills_is_open_in_a_video_whose_other_frames_show_the_scene_there(tmp_path, monkeypatch):
    (tmp_path / "frames").mkdir()
    rng = np.random.default_rng(0)
    wall = np.array((170, 165, 150)) + cv2.GaussianBlur(rng.normal(0, 30, (200, 160)).astype(np.float32), (0, 0), 3)[..., None]
    person = cv2.ellipse(np.zeros((200, 160), np.float32), (70, 100), (24, 70), 0, 0, 360, 1, -1)
    gap = np.zeros((200, 160), np.float32)
    gap[80:120, 66:72] = 1
    places = [8 * (t - 5) for t in range(12)]
    for t, place in enumerate(places):
        shown = np.roll(person - gap, place, axis=1)[..., None] > 0
        frame = np.where(shown, np.uint8((40, 60, 140)), wall) + rng.normal(0, 1.5, (200, 160, 3))
        write_frame(tmp_path / f"frames/{t:06d}.png", np.uint8(np.clip(frame, 0, 255)))
    xy, score = np.zeros((12, 133, 2), np.float32), np.zeros((12, 133), np.float32)
    xy[:, :4], score[:, :4] = [(70, 40), (74, 60), (66, 60), (70, 160)], 0.9
    xy[:, :4, 0] += np.array(places)[:, None]
    monkeypatch.setitem(stage.METHODS, "pose", lambda models: lambda image, region: np.roll(
        person, round(float(region.center[0])) - 70, axis=1))
    write_arrays(tmp_path / "keypoints.npz", **blank(KEYPOINT_SHAPES, T=12) | {"xy": xy, "score": score})
    Clip(10.0, [t / 10 for t in range(12)], 160, 200, None, "0").write(tmp_path / "clip.json")
    stage.run(Job({"split/frames": tmp_path / "frames", "split/clip.json": tmp_path / "clip.json",
                   "keypoints/keypoints.npz": tmp_path / "keypoints.npz"}, tmp_path, SegmentConfig()))
    for path, place in zip(frame_paths(tmp_path / "alpha"), places, strict=True):
        alpha = read_alpha(path)
        assert alpha[np.roll(gap, place, axis=1) > 0].mean() < 0.1
        assert alpha[np.roll(person - gap, place, axis=1) > 0].mean() > 0.97


@pytest.mark.footage
@pytest.mark.slow
def test_truth_a_is_cut_out_without_a_plate_closer_than_matting_alone_does(tmp_path):
    source = FOOTAGE / "truth-a"
    if not source.exists():
        pytest.skip("footage truth-a is not here")
    root = Path(os.environ.get("GSAC_CACHE", "~/.cache/gsac")).expanduser()
    try:
        network = stage.METHODS["pose"]({"pose_landmark_full": model_path("pose_landmark_full", root)})
    except ModelMissingError as missing:
        pytest.skip(str(missing))
    joints = np.load(source / "truth.npz", allow_pickle=True)["coco2d"]
    overlaps, errors = [], []
    reader = cv2.VideoCapture(str(source / "clip.mp4"))
    for i in range(60):
        image = cv2.cvtColor(reader.read()[1], cv2.COLOR_BGR2RGB)
        if i % 4:
            continue
        xy, score = np.zeros((133, 2)), np.zeros(133)
        xy[:23], score[:23] = joints[i], 0.9
        said = network(image, stage.person_region(xy, score))
        cutout, _ = stage.cut_frame(image, said, xy, score, None, SegmentConfig().iterations)
        alpha = stage.finish(image, cutout, None)
        truth = cv2.imread(str(source / f"mask/{i:04d}.png"), cv2.IMREAD_GRAYSCALE) / 255
        ours, true = alpha > 0.5, truth > 0.5
        overlaps.append((ours & true).sum() / (ours | true).sum())
        errors.append(((alpha - truth) ** 2).sum() / true.sum())
    assert np.mean(overlaps) >= 0.983 and np.min(overlaps) >= 0.955  # matting of the outline alone: .981 and .950
    assert np.mean(errors) < 0.011  # that: .0133
