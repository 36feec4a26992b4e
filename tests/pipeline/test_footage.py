"""What a clip holds is told from its header, without decoding."""

import json
import struct
import subprocess
from pathlib import Path

import pytest

from gsac.avatar.ffmpeg import ffmpeg_program
from gsac.pipeline.footage import Footage, expect_footage, footage_of_result, read_header
from gsac.stages.split.config import SplitConfig
from gsac.stages.split.probe import probe


@pytest.fixture(scope="module")
def clip(tmp_path_factory) -> Path:
    """24 frames of 96 x 64, which a tag turns upright."""
    folder = tmp_path_factory.mktemp("clip")
    source = ["-f", "lavfi", "-i", "testsrc=size=96x64:rate=12:duration=2", "-f", "lavfi", "-i", "anullsrc", "-t", "2"]
    run(*source, folder / "flat.mp4")
    run("-display_rotation", "90", "-i", folder / "flat.mp4", "-c", "copy", folder / "turned.mov")
    run("-i", folder / "flat.mp4", "-an", "-c:v", "libvpx", folder / "flat.webm")
    return folder / "turned.mov"


def run(*arguments: object) -> None:
    subprocess.run([ffmpeg_program(), "-loglevel", "error", *map(str, arguments)], check=True)


def test_frames_and_upright_size_are_those_that_split_finds(clip):
    header, video = read_header(clip), probe(clip)
    assert (header.frames, header.width, header.height) == (len(video.ticks), video.width, video.height) == (24, 64, 96)
    assert header.seconds == pytest.approx(2)


@pytest.mark.parametrize(("config", "expected"), [
    (SplitConfig(), Footage(24, 64, 96)), (SplitConfig(count=10), Footage(10, 64, 96)), (SplitConfig(fps=4), Footage(9, 64, 96)),
    (SplitConfig(count=None, max_height=48), Footage(24, 32, 48)), (None, Footage(24, 64, 96)),
])
def test_the_limits_of_split_hold_for_what_is_expected(clip, config, expected):
    assert expect_footage(clip, config) == expected


def test_a_folder_with_a_video_and_masks_tells_what_the_video_tells(clip, tmp_path):
    (tmp_path / "masks").mkdir()
    (tmp_path / "clip.mov").write_bytes(clip.read_bytes())
    assert expect_footage(tmp_path, SplitConfig()) == Footage(24, 64, 96)


def test_a_clip_that_does_not_tell_is_taken_for_as_much_as_the_parameters_allow(clip, tmp_path):
    assert expect_footage(clip.with_name("flat.webm"), SplitConfig(count=50)) == Footage(50, 720, 1280, read=False)
    for i in range(5):
        (tmp_path / f"{i}.jpg").touch()
    (tmp_path / "plate.jpg").touch()
    assert expect_footage(tmp_path, SplitConfig()) == Footage(5, 960, 1280, read=False)
    assert expect_footage(tmp_path, SplitConfig(count=3)).frames == 3


def test_no_damaged_header_is_an_error(clip, tmp_path):
    whole, damaged = clip.read_bytes(), tmp_path / "damaged.mov"
    for cut in range(0, len(whole), max(1, len(whole) // 60)):
        damaged.write_bytes(whole[:cut])
        read_header(damaged)
    at = whole.index(b"moov")
    for k in range(at - 4, len(whole), 7):
        damaged.write_bytes(whole[:k] + b"\xff\xff\xff\xff" + whole[k + 4:])
        read_header(damaged)
    for size in (0, 1, 2, 7):
        damaged.write_bytes(struct.pack(">I4s", size, b"moov") + b"\0" * 20)
        assert read_header(damaged) is None


def test_what_split_has_made_tells_exactly(tmp_path):
    (tmp_path / "frames").mkdir()
    for i in range(3):
        (tmp_path / "frames" / f"{i:06d}.png").write_bytes(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + struct.pack(">2I", 30, 40))
    facts = tmp_path / "clip.json"
    facts.write_text(json.dumps({"width": 36, "height": 48, "timestamps_s": [0, 1]}))
    assert footage_of_result(tmp_path / "frames", None) == Footage(3, 30, 40)
    assert footage_of_result(tmp_path / "frames", facts) == Footage(3, 36, 48)
    assert footage_of_result(None, facts) == Footage(2, 36, 48)
    facts.write_text(json.dumps({"width": 36, "height": 48, "timestamps_s": None}))
    assert footage_of_result(None, facts) is None, "photos: their number is not there"
    facts.write_text("[")
    assert footage_of_result(tmp_path / "frames", facts) is None and footage_of_result(tmp_path / "gone", None) is None
