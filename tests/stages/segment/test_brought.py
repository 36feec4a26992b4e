"""segment.method=brought: the masks beside the footage become the alpha, from the clip to the stage's output."""

import shutil

import cv2
import numpy as np
import pytest

from gsac.avatar.artifacts import KEYPOINT_SHAPES, frame_paths, write_arrays
from gsac.avatar.frame_files import read_alpha, write_alpha
from gsac.stages.contract import BadInput, Job, StageError
from gsac.stages.segment import stage as segment
from gsac.stages.segment.config import SegmentConfig
from gsac.stages.split import stage as split
from gsac.stages.split.config import SplitConfig
from gsac.turntable import clip
from gsac.turntable.options import TurntableOptions
from support.artifacts import blank


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A turntable clip of four frames with its truth masks, split whole and to half size."""
    root = tmp_path_factory.mktemp("brought")
    clip.make_clip(root / "turn", TurntableOptions(seed=3, frames=4, height=240))
    (root / "turn/mask").rename(root / "turn/masks")
    for out in ("whole", "half"):
        (root / out).mkdir()
        split.run(Job({"clip": root / "turn"}, root / out, SplitConfig(max_height=120 if out == "half" else None)))
    write_arrays(root / "keypoints.npz", **blank(KEYPOINT_SHAPES, T=4))
    return root


def cut(root, made, out, method="brought", notes=None):
    """Alphas and warnings."""
    warnings = []
    out.mkdir()
    segment.run(Job({"split/frames": root / "frames", "split/clip.json": root / "clip.json",
                     "keypoints/keypoints.npz": made / "keypoints.npz"}, out, SegmentConfig(method=method),
                    warn=lambda finding: warnings.append(finding.message), note=(notes if notes is not None else []).append))
    return [read_alpha(path) for path in frame_paths(out / "alpha")], warnings


@pytest.fixture
def spoilt(made, tmp_path):
    shutil.copytree(made / "half", tmp_path / "spoilt")
    return tmp_path / "spoilt"


@pytest.mark.parametrize(("size", "step"), [("whole", 1), ("half", 2)])
def test_truth_masks_of_a_turning_person_come_out_as_the_alpha(made, tmp_path, size, step):
    alphas, warnings = cut(made / size, made, tmp_path / "out")
    assert len(alphas) == 4 and not warnings
    for alpha, path in zip(alphas, frame_paths(made / "turn/masks"), strict=True):
        truth = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE).astype(np.float32) / 255
        height, width = truth.shape
        wanted = truth.reshape(height // step, step, width // step, step).mean((1, 3))
        assert np.abs(alpha - wanted).max() < 1 / 255
        assert ((wanted > 0.1) & (wanted < 0.9)).sum() / (wanted > 0.5).sum() > 0.02  # edges were soft, and stay so


def test_a_frame_with_a_person_whose_mask_shows_nobody_is_named(spoilt, made, tmp_path):
    write_arrays(tmp_path / "keypoints.npz", **blank(KEYPOINT_SHAPES, T=4) | {"score": np.ones((4, 133), np.float32)})
    empty = np.zeros_like(read_alpha(spoilt / "frames/masks/000002.exr"))
    write_alpha(spoilt / "frames/masks/000002.exr", empty)
    alphas, warnings = cut(spoilt, tmp_path, tmp_path / "out")
    assert not alphas[2].any() and warnings == ["The mask of frame 2 is empty although a person was found there."]
    assert cut(spoilt, made, tmp_path / "without points")[1] == [], "keypoints has said so"
    few = np.zeros((4, 133), np.float32)
    few[:, :3] = 1
    write_arrays(tmp_path / "keypoints.npz", **blank(KEYPOINT_SHAPES, T=4) | {"score": few})
    assert cut(spoilt, tmp_path, tmp_path / "few points")[1] == [], "smplx says that no person is seen"
    for t in range(4):
        write_alpha(spoilt / f"frames/masks/{t:06d}.exr", empty)
    with pytest.raises(StageError, match=r"frame 0 \(000000.png\) and all others: .* shows nobody"):
        cut(spoilt, made, tmp_path / "again")


def lay_points_on_masks(root, out):
    """keypoints.npz in `out` with sure body points on the masks of the frames in `root`."""
    score, xy = np.zeros((4, 133), np.float32), np.zeros((4, 133, 2), np.float32)
    score[:, :17] = 0.9
    for t in range(4):
        row, column = np.nonzero(read_alpha(root / f"frames/masks/{t:06d}.exr") > 0.5)
        at = np.linspace(0, len(row) - 1, 17).astype(int)
        xy[t, :17] = np.stack([column[at], row[at]], 1) + 0.5
    write_arrays(out / "keypoints.npz", **blank(KEYPOINT_SHAPES, T=4) | {"xy": xy, "score": score})


def invert(root, *frames):
    for t in frames:
        path = root / f"frames/masks/{t:06d}.exr"
        write_alpha(path, 1 - read_alpha(path))


def test_masks_that_are_mostly_inverted_are_refused_by_name(spoilt, tmp_path):
    lay_points_on_masks(spoilt, tmp_path)
    assert cut(spoilt, tmp_path, tmp_path / "right")[1] == []
    invert(spoilt, 1, 2)
    cut(spoilt, tmp_path, tmp_path / "half of them")
    invert(spoilt, 3)
    with pytest.raises(BadInput, match=r"masks of 3 of 4 frames \(1-3\), the first of them masks/000001.exr, look inverted"):
        cut(spoilt, tmp_path, tmp_path / "most of them")


def test_footage_without_masks_and_frames_without_one_are_refused(spoilt, made, tmp_path):
    write_alpha(spoilt / "frames/masks/000001.exr", np.ones((10, 10)))
    with pytest.raises(StageError, match=r"masks/000001.exr is 10x10 px and its frame"):
        cut(spoilt, made, tmp_path / "0")
    (spoilt / "frames/masks/000003.exr").unlink()
    with pytest.raises(StageError, match=r"frame 3 \(000003.png\) has no mask"):
        cut(spoilt, made, tmp_path / "1")
    shutil.rmtree(spoilt / "frames/masks")
    with pytest.raises(BadInput, match="segment.method is brought, but no masks lie beside the footage"):
        cut(spoilt, made, tmp_path / "2")


def test_masks_that_lie_there_unused_are_told_of(made, tmp_path, monkeypatch):
    monkeypatch.setitem(segment.METHODS, "selfie", lambda models: None)
    notes = []
    with pytest.raises(StageError, match="no person was found"):
        cut(made / "half", made, tmp_path / "out", "selfie", notes)
    assert notes == ["Masks lie beside the footage and are not used; segment.method=brought takes them."]
