import json
import os
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from gsac.avatar.artifacts import read_arrays
from gsac.avatar.network_files import ModelMissingError, model_path
from gsac.avatar.region import Region
from gsac.avatar.wholebody import FACE, HANDS
from gsac.benchmarks.perception import run_keypoints, run_stage, score_squats, score_truth, video_frames, write_split
from gsac.stages.contract import BadInput, Job, make_config
from gsac.stages.findings import Code
from gsac.stages.keypoints import STAGE
from gsac.stages.keypoints.config import MODELS, DetectorName, KeypointsConfig
from gsac.stages.keypoints.cut_off import Cut, find_cuts
from gsac.stages.keypoints.detection import Frame
from gsac.stages.keypoints.second_person import name_followed
from gsac.stages.keypoints.stage import DETECTORS, judge_size, report, run

FOOTAGE = Path(__file__).resolve().parents[4] / "shared" / "footage"
SQUATS, TRUTH = FOOTAGE / "squats" / "pose_squats.mp4", FOOTAGE / "truth-a" / "clip.mp4"


@pytest.fixture(scope="module")
def store() -> Path:
    root = Path(os.environ.get("GSAC_CACHE", "~/.cache/gsac")).expanduser()
    try:
        for name in KeypointsConfig().models():
            model_path(name, root)
    except ModelMissingError as missing:
        pytest.skip(str(missing))
    return root


def need(path: Path) -> Path:
    if not path.exists():
        pytest.skip(f"footage {path.parent.name}/{path.name} is not here")
    return path


def few(path: Path, *index: int) -> list[np.ndarray]:
    frames = list(video_frames(need(path)))
    return [frames[i] for i in index]


def stage_on(frames: list[np.ndarray], folder: Path, store: Path) -> tuple[dict, list[str]]:
    arrays, notes, _ = run_keypoints(iter(frames), folder, store)
    return arrays, notes["warnings"]


def test_a_wrong_parameter_is_named_with_its_choices():
    with pytest.raises(BadInput, match="keypoints.detector is 'alphapose'; choices: mediapipe, onnx-wholebody, mmpose-json"):
        make_config(STAGE, {"detector": "alphapose"})
    with pytest.raises(BadInput, match="keypoints.hand_threshold is 1.5"):
        KeypointsConfig(hand_threshold=1.5).check()


def test_every_detector_that_can_be_named_has_its_class_and_its_model_files():
    assert tuple(DETECTORS) == tuple(MODELS) == get_args(DetectorName)


def test_a_clip_without_a_person_is_refused(tmp_path, store):
    ports = write_split(iter([np.full((320, 240, 3), 120, np.uint8)] * 2), tmp_path / "split")
    with pytest.raises(BadInput, match="No person was found in any of the clip's 2 frames"):
        run_stage(STAGE, run, ports, tmp_path / "out", store)


def seen(**parts) -> Frame:
    """A frame with a person in the middle of 100 x 200 px."""
    frame = Frame()
    frame.score[:17] = 1
    frame.pose33[:] = (50, 100, 1)
    for points in parts.values():
        frame.score[points] = 1
    return frame


def warnings_of(frames: list[Frame], cuts: list[set[Cut]] | None = None) -> list[str]:
    warnings: list[str] = []
    report(Job({}, Path(), None, warn=lambda finding: warnings.append(finding.message)), frames, cuts or [set()] * len(frames))
    return warnings


def test_hardly_any_frame_with_a_person_is_told_as_hopeless_at_once():
    found = []
    job = Job({}, Path(), None, warn=found.append)
    report(job, [seen(**HANDS, face=FACE)] + [Frame()] * 19, [set()] * 20)
    assert found[0].code is Code.HARDLY_ANY_PERSON and found[0].figure == 1 and "1 of the clip's 20 frames" in found[0].message
    assert found[0].to_json()["severity"] == "hopeless"


def test_warnings_name_the_frames_without_a_person_and_with_two():
    whole = dict(HANDS, face=FACE)
    two = seen(**whole)
    two.region, two.others = Region((30, 100), 60), [Region((70, 100), 60)]
    warnings = warnings_of([seen(**whole), Frame(), Frame(), two])
    assert len(warnings) == 2
    assert "No person was found in 2 of 4 frames (1-2)" in warnings[0]
    assert "second person was seen in frame 3; the one on the left in the picture is followed." in warnings[1]


@pytest.mark.parametrize(("own", "others", "words"), [
    ((70, 60), [(30, 60)], "the one on the right in the picture"),
    ((50, 90), [(30, 60), (80, 60)], "the larger one"),
    ((50, 60), [(30, 90), (80, 90)], "the smaller one"),
    ((50, 60), [(30, 60), (80, 60)], "only one of them"),
])
def test_who_is_followed_is_told_by_side_or_else_by_size(own, others, words):
    frame = Frame()
    frame.region, *frame.others = (Region((x, 100), side) for x, side in (own, *others))
    assert name_followed([Frame(), frame]) == words


def test_what_flickers_like_a_person_without_face_or_hand_is_refused_at_once():
    with pytest.raises(BadInput, match=r"something like one shows in 2 of 9 frames \(3, 5\) only, and never a face"):
        warnings_of([seen() if t in (3, 5) else Frame() for t in range(9)])
    assert warnings_of([seen(face=FACE) if t == 3 else Frame() for t in range(9)])
    assert warnings_of([seen() if t < 3 else Frame() for t in range(9)])


def test_parts_that_were_never_seen_are_warned_of():
    warnings = warnings_of([seen(right=HANDS["right"])])
    assert [w.split(";")[0] for w in warnings] == ["The left hand was never seen",
                                                   "The face was never seen from the front"]


def test_who_lies_on_the_side_is_told_to_turn_the_clip_and_who_bows_is_not():
    def lean(degrees):
        frame = seen(**HANDS, face=FACE)
        frame.score[[5, 6, 11, 12]], frame.xy[[5, 6]] = 1, (50, 50)
        frame.xy[[11, 12]] = 50 + 40 * np.array([np.sin(np.radians(degrees)), np.cos(np.radians(degrees))])
        return frame

    lying = warnings_of([lean(90), lean(-80), lean(5), Frame(), lean(-100)])
    assert any("lies on the side in 3 of 5 frames (0-1, 4)" in said and "Turn the clip by a quarter" in said for said in lying)
    for standing in ([lean(90), lean(0), lean(30), lean(70)], [lean(180)] * 4):
        assert not any("lies on the side" in said for said in warnings_of(standing))


def test_head_feet_and_sides_at_the_edge_are_told_apart_up_to_the_crown():
    def cuts(at, points=(31,)):
        frame = seen()
        frame.pose33[list(points)] = (*at, 1)
        return find_cuts(frame, 100, 200)

    assert cuts((50, 150)) == set()
    assert cuts((50, 199.8)) == {Cut.FEET} and cuts((-3, 150)) == {Cut.SIDE} and cuts((101, 230)) == {Cut.FEET, Cut.SIDE}
    assert cuts((50, -5), points=(0,)) == {Cut.HEAD} and cuts((50, -5), points=(15,)) == {Cut.OTHER}
    crown = seen()
    crown.pose33[[2, 5]], crown.pose33[[9, 10]] = (50, 14, 1), (50, 24, 1)
    assert find_cuts(crown, 100, 200) == {Cut.HEAD}
    without = Frame()
    without.xy[:23], without.score[:17] = (50, 100), 1
    without.xy[16] = (50, 200)
    assert find_cuts(without, 100, 200) == {Cut.FEET}, "feet of score 0 at the corner do not count, the ankle does"


def test_which_part_the_edge_cuts_off_is_said_with_its_frames():
    whole = dict(HANDS, face=FACE)
    warning, = warnings_of([seen(**whole)] * 4, [{Cut.HEAD, Cut.FEET}, {Cut.FEET}, set(), {Cut.FEET}])
    assert warning.startswith("The edge of the picture cuts off the head in frame 0, the feet in 3 of 4 frames (0-1, 3); what lies")


def sizes_told(*cut: set[Cut], height: float = 100) -> list[str]:
    """Of a person whose seen points span `height` px in each frame."""
    found = []
    xy = np.zeros((len(cut), 133, 2), np.float32)
    xy[:, 0, 1] = height
    arrays = {"xy": xy, "score": np.ones((len(cut), 133), np.float32), "world": np.full((len(cut), 133, 3), np.nan, np.float32)}
    judge_size(Job({}, Path(), None, warn=lambda finding: found.append(finding.code.word)), arrays, list(cut))
    return found


def test_who_is_cut_off_above_or_below_is_not_told_to_come_closer():
    assert sizes_told({Cut.FEET}, {Cut.FEET, Cut.SIDE}, set()) == sizes_told({Cut.OTHER}, {Cut.HEAD}) == []
    assert sizes_told({Cut.SIDE}, {Cut.FEET}, set()) == sizes_told(set()) == ["small_person"]
    assert sizes_told(set(), height=400) == []


@pytest.mark.footage
def test_one_frame_is_enough_and_the_file_repeats_to_the_byte(tmp_path, store):
    image = few(SQUATS, 0)
    arrays, _ = stage_on(image, tmp_path / "a", store)
    stage_on(image, tmp_path / "b", store)
    assert arrays["xy"].shape == (1, 133, 2) and arrays["score"].all(axis=1).sum() == 0
    assert np.isfinite(arrays["world"][0, :17]).all()
    first, again = ((tmp_path / d / "keypoints" / "keypoints.npz").read_bytes() for d in "ab")
    assert first == again


@pytest.mark.footage
def test_a_frame_without_the_person_has_no_points_and_a_warning(tmp_path, store):
    image = few(SQUATS, 0)[0]
    arrays, warnings = stage_on([image, np.full_like(image, 128), image], tmp_path, store)
    assert arrays["score"].any(axis=1).tolist() == [True, False, True]
    assert any("No person was found in frame 1" in w for w in warnings)


@pytest.mark.footage
def test_the_same_person_is_followed_when_a_second_one_comes(tmp_path, store):
    first, other = few(SQUATS, 0, 1), few(TRUTH, 0)[0]
    alone, pair = np.hstack([first[0], np.full_like(other, 130)]), np.hstack([first[1], other])
    arrays, warnings = stage_on([alone, pair], tmp_path, store)
    assert (arrays["xy"][:, 5:17, 0] < 720).all()
    assert any("second person was seen in frame 1; the one on the left in the picture is followed" in w for w in warnings)


@pytest.mark.footage
def test_a_person_cut_by_the_frame_is_warned_of(tmp_path, store):
    image = few(SQUATS, 0)[0]
    _, warnings = stage_on([np.ascontiguousarray(image[:880])], tmp_path, store)
    assert any("The edge of the picture cuts off the feet in the only frame;" in w for w in warnings)
    _, warnings = stage_on([np.ascontiguousarray(image[220:])], tmp_path / "headless", store)
    assert any("The edge of the picture cuts off the head in the only frame;" in w for w in warnings)


@pytest.mark.footage
def test_a_photo_read_as_frame_gives_the_same_points_at_twice_the_size(tmp_path, store):
    import cv2

    image = few(SQUATS, 4)[0]
    small, _ = stage_on([image], tmp_path / "a", store)
    large, _ = stage_on([cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)], tmp_path / "b", store)
    both = (small["score"] > 0.5) & (large["score"] > 0.5)
    assert both[:, :17].sum() > 12
    assert np.median(np.linalg.norm(large["xy"] / 2 - small["xy"], axis=-1)[both]) < 4


@pytest.mark.footage
@pytest.mark.slow
def test_body_points_agree_with_an_independent_implementation(tmp_path, store):
    reference = np.array(json.loads(need(FOOTAGE / "squats" / "pose_squats.full.json").read_text()))[::3]
    arrays, _ = stage_on(list(video_frames(SQUATS))[::3], tmp_path, store)
    figures = score_squats(arrays, reference)
    assert figures["person"] == 1
    assert figures["points_median_percent_of_height"] <= 1.5


@pytest.mark.footage
@pytest.mark.slow
def test_points_lie_where_the_rendered_truth_has_them(tmp_path, store):
    truth = read_arrays(need(FOOTAGE / "truth-a" / "truth.npz"))
    arrays, _ = stage_on(list(video_frames(need(TRUTH))), tmp_path, store)
    figures = score_truth(arrays, truth)
    assert figures["person"] == 60
    assert figures["body_median_px"] <= 13
    assert figures["visible_hands_found"] >= 0.88 and figures["hand_median_px"] <= 4.5
    assert figures["hands_in_the_wrong_place"] == 0
    assert figures["face_found"] >= 0.46 and figures["face_found_within_75_deg"] == 1
    assert figures["face_found_beyond_110_deg"] == 0


@pytest.mark.footage
@pytest.mark.slow
def test_a_person_is_found_in_every_photo_of_a_turn(tmp_path, store):
    from gsac.avatar.frame_files import read_frame

    photos = sorted(need(FOOTAGE / "turn-photos" / "000.jpg").parent.glob("[0-9]*.jpg"))
    arrays, warnings = stage_on([read_frame(path) for path in photos], tmp_path, store)
    assert arrays["score"].any(axis=1).sum() == len(photos) == 7
    assert not any("second person" in w for w in warnings)
    assert arrays["score"][[0, 6]][:, FACE].any(axis=1).all() and not arrays["score"][3, FACE].any()
