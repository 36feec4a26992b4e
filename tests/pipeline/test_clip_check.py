"""gsac check says what would come of a clip, and gsac run stops where nothing can."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.artifacts import Clip
from gsac.pipeline import clip_check
from gsac.pipeline.clip_check import ClipCheck, Prospect
from gsac.pipeline.outcomes import ExitCode
from gsac.stages.findings import Code, Finding
from gsac.stages.first_look import FirstLook

FOOTAGE = Path(__file__).resolve().parents[3] / "shared" / "footage"
LOOK = FirstLook(4, 4, 500.0, 350.0, 60.0, 70.0)


def checked(*findings: Finding) -> ClipCheck:
    return ClipCheck(LOOK, [0.0, 0.5, 1.0, 1.5], [(finding.message, finding.to_json()) for finding in findings])


def test_news_leave_a_clip_good_and_the_worst_finding_decides():
    repeated = Finding.of(Code.REPEATED, np.array([0, 1, 0, 0], bool))
    dark, hopeless = Finding.of(Code.FACE_NEVER_DETECTED), Finding.of(Code.HARDLY_ANY_PERSON, figure=1, given=40)
    assert checked().prospect is checked(repeated).prospect is Prospect.GOOD
    assert checked(repeated, dark).prospect is Prospect.POORER and checked(dark, hopeless).prospect is Prospect.HOPELESS
    assert [prospect.exit_code for prospect in Prospect] == [ExitCode.OK, ExitCode.FAILED, ExitCode.USAGE]


def test_what_to_film_again_is_said_with_the_times_at_which_it_went_wrong():
    lines = checked(Finding.of(Code.BLURRED, np.array([1, 0, 1, 1], bool), figure=0.5)).lines
    assert lines[0] == Prospect.POORER.sentence and "The clip lasts 1.5 s." in lines[1]
    assert lines[2].startswith("- The picture is blurred") and "turn slower. (at 0.0, 1.0 to 1.5 s)" in lines[2]


@pytest.mark.parametrize(("seconds", "said"), [(0.2, ["hand_hidden"]), (0.4, [])])
def test_hands_are_not_blamed_by_neighbours_that_lie_far_apart(tmp_path, monkeypatch, seconds, said):
    monkeypatch.setattr(FirstLook, "of", lambda points: LOOK)
    monkeypatch.setattr(clip_check, "check_keypoints", lambda path: {})
    Clip(30.0, [seconds * t for t in range(4)], 90, 160, None, "0" * 64).write(tmp_path / "clip.json")
    hidden = Finding.of(Code.HAND_HIDDEN, np.array([0, 1, 1, 0], bool), figure=2, side="left")
    found = clip_check.check_clip(tmp_path / "clip.json", tmp_path, [(hidden.message, hidden.to_json())]).findings
    assert [entry["code"] for _, entry in found] == said


def test_of_frames_that_show_nobody_it_is_said_once(tmp_path, monkeypatch):
    monkeypatch.setattr(FirstLook, "of", lambda points: LOOK)
    monkeypatch.setattr(clip_check, "check_keypoints", lambda path: {})
    Clip(30.0, [0.2 * t for t in range(4)], 90, 160, None, "0" * 64).write(tmp_path / "clip.json")
    empty, more = np.array([1, 1, 0, 0], bool), np.array([1, 1, 1, 0], bool)
    told = [Finding.of(Code.NO_PERSON, empty), Finding.of(Code.NOT_FITTED, empty, reason="no person is seen"),
            Finding.of(Code.NOT_FITTED, more, reason="no person is seen")]
    found = clip_check.check_clip(tmp_path / "clip.json", tmp_path, [(each.message, each.to_json()) for each in told]).findings
    assert [(entry["code"], entry["frames"]) for _, entry in found] == [("no_person", [[0, 1]]), ("not_fitted", [[0, 2]])]


@pytest.mark.parametrize(("photos", "said"), [(2, ["part_of_turn"]), (3, ["part_of_turn"]), (4, ["part_of_turn"]), (7, [])])
def test_between_photos_nothing_is_seen_and_between_the_frames_of_a_video_the_turn_goes_on(tmp_path, monkeypatch, photos, said):
    monkeypatch.setattr(FirstLook, "of", lambda points: replace(LOOK, frames=photos, seen=photos, turn=360 * (1 - 1 / photos) - 1))
    monkeypatch.setattr(clip_check, "check_keypoints", lambda path: {})
    for times, expected in ((None, said), ([0.3 * t for t in range(photos)], [])):
        Clip(None if times is None else 30.0, times, 90, 160, None, "0" * 64).write(tmp_path / "clip.json")
        check = clip_check.check_clip(tmp_path / "clip.json", tmp_path, [])
        assert [entry["code"] for _, entry in check.findings] == expected
        assert check.prospect is (Prospect.POORER if expected else Prospect.GOOD)


def test_a_run_stops_where_nothing_can_come_of_the_clip_and_goes_on_anyway(toy):
    done = toy.run("--set", "cut.trouble=hopeless")
    assert done.code == ExitCode.USAGE and "1 of the clip's 40 frames only" in done.err and "--anyway goes on" in done.err
    assert [stage["name"] for stage in done.json["stages"]] == ["cut"] and "Traceback" not in done.err
    assert toy.run("--set", "cut.trouble=hopeless").code == ExitCode.USAGE  # from the cache as well
    assert toy.run("--set", "cut.trouble=hopeless", "--anyway").code == ExitCode.OK


@pytest.mark.slow
@pytest.mark.footage
@pytest.mark.parametrize(("clip", "code", "words", "unsure"), [
    ("truth-a/clip.mp4", 0, [], set()),
    ("squats/pose_squats.mp4", 1, ["part_of_turn"], {"arm_doubtful"}),  # her left hand is lost for 3 s: hidden, or its arm in doubt
])
def test_check_finds_nothing_wrong_with_a_turn_and_names_what_a_clip_lacks(tmp_path, clip, code, words, unsure):
    if not (FOOTAGE / clip).exists():
        pytest.skip(f"footage {clip} is not here")
    done = subprocess.run([sys.executable, "-m", "gsac.pipeline.cli", "check", FOOTAGE / clip, "--json"], cwd=tmp_path,
                          capture_output=True, text=True, env=os.environ)
    said = json.loads(done.stdout.splitlines()[-1])
    assert done.returncode == code and [each for finding in said["findings"] if (each := finding["code"]) not in unsure] == words
    assert not list(tmp_path.iterdir())
