"""Key points that mmpose wrote as JSON, in each of its layouts, become those of the followed person."""

import json
from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.artifacts import ArtifactError, check_keypoints
from gsac.avatar.mmpose_file import MOST_BYTES, read_mmpose
from gsac.avatar.wholebody import HANDS
from gsac.stages.contract import BadInput
from gsac.stages.keypoints.config import KeypointsConfig
from support.standing import HEIGHT, WIDTH, blaze, run_keypoints, stand  # noqa: F401, blaze is a fixture

pytestmark = pytest.mark.usefixtures("blaze")
FRAMES = 3


def person(at: np.ndarray, score: float = 5.0, hidden: float = 5.0) -> dict:
    """One of mmpose's persons: at (133, 2) px, the left hand scored as hidden. Its pixels count from the middle of the first."""
    scores = np.full(133, score)
    scores[HANDS["left"]] = hidden
    return {"keypoints": (at - 0.5).tolist(), "keypoint_scores": scores.tolist(), "bbox": [[0, 0, 9, 9]], "bbox_score": 0.9}


def frames_of(**scores: float) -> list[list[dict]]:
    """A stranger and the person, who moves on by 1 px a frame, in each frame."""
    return [[person(stand() + [100, 3], 9.0), person(stand() + [t, 0], **scores)] for t in range(FRAMES)]


def write_inferencer(folder: Path, frames: list) -> Path:
    return write(folder / "brought", [{"frame_id": t, "instances": persons} for t, persons in enumerate(frames)])


def write_demo(folder: Path, frames: list) -> Path:
    rows = [{"frame_id": t + 1, "instances": persons} for t, persons in enumerate(frames)]
    return write(folder / "brought", {"meta_info": {}, "instance_info": rows})


def write_predictions(folder: Path, frames: list) -> Path:
    return write(folder / "brought", {"predictions": frames})


def write_folder(folder: Path, frames: list) -> Path:
    (folder / "brought").mkdir()
    for t, persons in enumerate(frames):
        write(folder / "brought" / f"{t:06d}.json", [persons] if t else persons)
    return folder / "brought"


def write(path: Path, content: object) -> Path:
    path.write_text(json.dumps(content))
    return path


LAYOUTS = [write_inferencer, write_demo, write_predictions, write_folder]


def detect(path: Path, folder: Path) -> dict[str, np.ndarray]:
    frames = [np.full((HEIGHT, WIDTH, 3), 120, np.uint8)] * FRAMES
    config = KeypointsConfig("mmpose-json", points="mine")
    config.check()
    assert "mine" in config.models()
    return check_keypoints(run_keypoints(frames, folder, config, {"mine": path})["keypoints/keypoints.npz"])


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_gives_the_tracked_persons_points_and_scores_that_tell_a_hidden_hand(tmp_path, layout):
    found = detect(layout(tmp_path, frames_of(hidden=0.2)), tmp_path)
    for t in range(FRAMES):
        np.testing.assert_allclose(found["xy"][t], stand() + [t, 0], atol=1e-4)
    assert (found["score"][:, HANDS["right"]] > 0.9).all() and (found["score"][:, HANDS["left"]] < 0.3).all()
    assert str(found["detector"]) == "mmpose-json" and np.isfinite(found["world"][:, :17]).all()


def test_where_mmpose_found_only_somebody_else_nobody_is_seen(tmp_path):
    frames = frames_of()
    frames[1] = frames[1][:1]
    found = detect(write_inferencer(tmp_path, frames), tmp_path)
    assert found["score"].any(axis=1).tolist() == [True, False, True]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_frames_that_do_not_match_the_clips_are_counted(tmp_path, layout):
    for folder, frames in ((tmp_path / "few", frames_of()[:-1]), (tmp_path / "many", [*frames_of(), []])):
        folder.mkdir()
        with pytest.raises(BadInput, match=f"keypoints.points is mine: it has {len(frames)} frames, the clip 3"):
            detect(layout(folder, frames), folder)


def test_a_frame_between_that_is_missing_is_named(tmp_path):
    path = write_folder(tmp_path, frames_of())
    (path / "000001.json").rename(path / "000007.json")
    with pytest.raises(BadInput, match="none for frame 1; run mmpose on this run's split/frames"):
        detect(path, tmp_path)


@pytest.mark.parametrize(("content", "fault"), [
    ("{", "not readable as JSON"), ('{"people": []}', "not mmpose's key points"), ("[5]", "not a list of persons"),
    (json.dumps([person(stand()[:17]) | {"keypoint_scores": [1] * 17}]), "a person of 17 points and 2 coordinates"),
    ('[{"frame_id": 0}]', "frame_id 0: not a list of persons"), ("[[[{}]]]", "frame 0: not a list of persons")])
def test_what_is_no_result_of_mmpose_is_refused_with_its_name(tmp_path, content, fault):
    (tmp_path / "brought.json").write_text(content)
    with pytest.raises(BadInput, match=f"keypoints.points is mine: .*brought.json.*{fault}"):
        detect(tmp_path / "brought.json", tmp_path)


def test_the_file_and_the_detector_that_reads_it_are_asked_for_together():
    for config in (KeypointsConfig("mmpose-json"), KeypointsConfig(points="mine")):
        with pytest.raises(BadInput, match="expected mmpose-json with the name of mmpose's file"):
            config.check()


def test_a_file_far_larger_than_any_clips_points_is_refused_unread(tmp_path):
    with (tmp_path / "brought").open("wb") as file:
        file.truncate(MOST_BYTES + 1)
    with pytest.raises(ArtifactError, match=f"brought: has {MOST_BYTES + 1} bytes; key points of a clip have at most"):
        read_mmpose(tmp_path / "brought")
