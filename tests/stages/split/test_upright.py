"""Footage whose person lies on the side or is upside down is turned, with all that lies beside it; other footage stays as it is."""

import os
import subprocess
from pathlib import Path

import cv2
import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

from gsac.avatar.artifacts import Clip, frame_paths
from gsac.avatar.frame_files import read_alpha, read_frame
from gsac.avatar.network_files import ModelMissingError, model_path
from gsac.stages.contract import Job
from gsac.stages.findings import Code
from gsac.stages.split import stage
from gsac.stages.split.config import NETWORKS, SplitConfig
from gsac.stages.split.crop import Extent
from gsac.stages.split.keyframes import read_key_frames
from gsac.stages.split.people import People
from gsac.stages.split.probe import probe
from gsac.stages.split.upright import find_quarters

FOOTAGE = Path(__file__).parents[4] / "shared" / "footage"
WIDTH, HEIGHT, FRAMES = 72, 128, 6


def person(t: int = 0) -> np.ndarray:
    """(HEIGHT, WIDTH, 3) uint8: a red head over a blue trunk, before a room whose places all have their own colour."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    scene = np.stack([60 + 60 * x / WIDTH, 60 + 60 * y / HEIGHT, np.full(x.shape, 90)], -1).astype(np.uint8)
    scene[20:40, 24 + t:44 + t], scene[40:110, 24 + t:44 + t] = (250, 0, 0), (0, 0, 250)
    return scene


def mask(t: int = 0) -> np.ndarray:
    """(HEIGHT, WIDTH) uint8, of the person."""
    return np.uint8(255 * ((person(t)[..., 0] == 250) | (person(t)[..., 2] == 250)))


class RedHeads(People):
    """Takes red for a head and blue for the trunk below it."""

    def lean(self, image):
        head, trunk = (image[..., channel].astype(int) - image[..., 1] > 120 for channel in (0, 2))
        if not head.any():
            return None
        y, x = np.argwhere(head).mean(0) - np.argwhere(trunk).mean(0)
        return float(np.arctan2(x, -y))

    def look(self, image):
        self.looked, self.seen = self.looked + 1, self.seen + 1
        rows, columns = np.nonzero(image.astype(int).max(2) - image[..., 1] > 120)
        return Extent.of(np.array([[columns.min(), rows.min()], [columns.max(), rows.max()]], float))

    follow = look


@pytest.fixture
def red_heads(monkeypatch):
    monkeypatch.setattr(stage, "People", RedHeads)


def make_clip(path: Path, quarters: int) -> Path:
    """A lossless clip of the person, turned counter-clockwise by so many quarters."""
    video = np.stack([np.rot90(person(t), quarters) for t in range(FRAMES)])
    path.parent.mkdir(exist_ok=True)
    subprocess.run([imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s",
                    f"{video.shape[2]}x{video.shape[1]}", "-r", "10", "-i", "-", "-c:v", "ffv1", "-pix_fmt", "bgr0", path],
                   input=video.tobytes(), check=True)
    return path


def split(source: Path, out: Path, **config):
    told = []
    out.mkdir()
    stage.run(Job({"clip": source}, out, SplitConfig(**config), models=dict.fromkeys(NETWORKS, Path()), warn=told.append))
    clip, frames = Clip.read(out / "clip.json"), [read_frame(path) for path in frame_paths(out / "frames")]
    assert {frame.shape for frame in frames} == {(clip.height, clip.width, 3)}
    return frames, [finding for finding in told if finding.code in (Code.TURNED_UPRIGHT, Code.LIES_ON_SIDE)]


@pytest.mark.parametrize("quarters, way", [(1, "a quarter to the right"), (2, "a half"), (3, "a quarter to the left")])
def test_who_lies_on_either_side_or_is_upside_down_stands_in_the_frames_and_the_user_is_told(tmp_path, red_heads, quarters, way):
    frames, (told,) = split(make_clip(tmp_path / "a/clip.mkv", quarters), tmp_path / "out")
    assert f"turned by {way}." in told.message and told.figure == 4 - quarters
    for t, frame in enumerate(frames):
        np.testing.assert_allclose(frame.astype(int), person(t), atol=3)


def test_who_stands_stays_so(tmp_path, red_heads, monkeypatch):
    clip = make_clip(tmp_path / "a/clip.mkv", 0)
    frames, told = split(clip, tmp_path / "out")
    monkeypatch.setattr(stage, "NETWORKS", ("absent",))  # nobody is looked for
    same, _ = split(clip, tmp_path / "same")
    assert told == [] and np.array_equal(frames, same)


def tag(path: Path, *options: str) -> Path:
    """The clip as MP4, nearly lossless, with a display matrix by ffmpeg's options."""
    ffmpeg = [imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error"]
    plain, tagged = path.with_name("plain.mp4"), path.with_name("tagged.mp4")
    subprocess.run([*ffmpeg, "-i", path, "-c:v", "libx264", "-crf", "1", "-pix_fmt", "yuv444p", plain], check=True)
    subprocess.run([*ffmpeg, *options, "-i", plain, "-c", "copy", tagged], check=True)
    return tagged


def test_who_lies_in_a_clip_that_was_trimmed_to_frames_between_key_frames_stands_in_the_frames(tmp_path, red_heads):
    trimmed = tag(make_clip(tmp_path / "a/clip.mkv", 1), "-ss", "0.2")
    video = probe(trimmed)
    assert len(video.ticks) == FRAMES - 2 and len(video.key_ticks) == 0
    frames, (told,) = split(trimmed, tmp_path / "out")
    assert told.figure == 3
    for t, frame in enumerate(frames, 2):
        assert np.abs(frame.astype(int) - person(t)).mean() < 3


def test_a_tag_for_the_wrong_side_is_put_right(tmp_path, red_heads):
    tagged = tag(make_clip(tmp_path / "a/clip.mkv", 1), "-display_rotation", "180")
    frames, (told,) = split(tagged, tmp_path / "out")
    assert "to the left" in told.message
    np.testing.assert_allclose(frames[2].astype(int), person(2), atol=40)
    assert np.abs(frames[2].astype(int) - person(2)).mean() < 4


@pytest.mark.parametrize("quarters, mirror", [(0, "-display_hflip"), (2, "-display_vflip")])
def test_who_stands_by_a_tag_that_mirrors_stays_so(tmp_path, red_heads, quarters, mirror):
    frames, told = split(tag(make_clip(tmp_path / "a/clip.mkv", quarters), mirror), tmp_path / "out")
    assert told == [] and np.abs(frames[2].astype(int) - np.fliplr(person(2))).mean() < 4


@pytest.mark.parametrize("mirror", [[], ["-display_hflip"]])
@pytest.mark.parametrize("angle", ["0", "90", "180", "270"])
def test_key_frames_are_the_pictures_that_ffmpeg_writes_by_any_tag(tmp_path, angle, mirror):
    tagged = tag(make_clip(tmp_path / "a/clip.mkv", 0), "-display_rotation", angle, *mirror)
    video = probe(tagged)
    picture = next(read_key_frames(tagged, video, 1, video.width, video.height))
    written = subprocess.run([imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error", "-i", tagged, "-frames:v", "1",
                              "-f", "rawvideo", "-pix_fmt", "rgb24", "-"], check=True, capture_output=True).stdout
    np.testing.assert_allclose(picture.astype(int), np.frombuffer(written, np.uint8).reshape(picture.shape), atol=2)


def test_a_tag_of_zeros_turns_nothing(tmp_path):
    tagged = tag(make_clip(tmp_path / "a/clip.mkv", 0))
    content = bytearray(tagged.read_bytes())
    matrix = content.index(b"tkhd") + 44
    content[matrix:matrix + 36] = bytes(36)
    tagged.write_bytes(content)
    picture = next(read_key_frames(tagged, probe(tagged), 1, WIDTH, HEIGHT))
    assert np.abs(picture.astype(int) - person()).mean() < 4


def test_large_footage_is_cut_about_the_person_after_it_was_turned(tmp_path, red_heads):
    video = np.stack([np.rot90(np.pad(person(t), ((100, 100), (80, 80), (0, 0)), "edge")) for t in range(FRAMES)])
    (tmp_path / "a").mkdir()
    subprocess.run([imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s",
                    f"{video.shape[2]}x{video.shape[1]}", "-r", "10", "-i", "-", "-c:v", "ffv1", "-pix_fmt", "bgr0",
                    tmp_path / "a/clip.mkv"], input=video.tobytes(), check=True)
    split(tmp_path / "a/clip.mkv", tmp_path / "out", max_height=128)
    clip, frame = Clip.read(tmp_path / "out/clip.json"), read_frame(tmp_path / "out/frames/000000.png").astype(int)
    assert clip.crop is not None and clip.height <= 128
    head, trunk = (np.argwhere(frame[..., channel] - frame[..., 1] > 120) for channel in (0, 2))
    assert head[:, 0].max() <= trunk[:, 0].min() + 1 and np.ptp(trunk[:, 0]) > 1.2 * 70 * 128 / 328


@pytest.mark.parametrize("quarters", [1, 2])
def test_masks_and_plate_follow(tmp_path, red_heads, quarters):
    folder = make_clip(tmp_path / "a/clip.mkv", quarters).parent
    (folder / "masks").mkdir()
    for t in range(FRAMES):
        Image.fromarray(np.rot90(mask(t), quarters)).save(folder / f"masks/{t:06d}.png")
    room = person()
    room[20:110, 24:44] = 70
    Image.fromarray(np.rot90(room, quarters)).save(folder / "plate.png")
    split(folder, tmp_path / "out")
    frames = tmp_path / "out/frames"
    np.testing.assert_allclose(read_frame(frames / "plate.png").astype(int), room, atol=2)
    for t, path in enumerate(frame_paths(frames / "masks")):
        np.testing.assert_allclose(read_alpha(path), mask(t) / 255, atol=0.01)


@pytest.mark.parametrize("quarters, way", [(2, "a half"), (3, "to the left")])
def test_photos_are_turned_with_their_masks_and_plate(tmp_path, red_heads, quarters, way):
    folder = tmp_path / "photos"
    (folder / "masks").mkdir(parents=True)
    for t in range(FRAMES):
        Image.fromarray(np.rot90(person(t), quarters)).save(folder / f"IMG_{t}.png")
        Image.fromarray(np.rot90(mask(t), quarters)).save(folder / f"masks/IMG_{t}.png")
    Image.fromarray(np.rot90(person(), quarters)).save(folder / "plate.png")
    frames, (told,) = split(folder, tmp_path / "out")
    assert way in told.message and np.array_equal(frames, [person(t) for t in range(FRAMES)])
    assert np.array_equal(read_frame(tmp_path / "out/frames/plate.png"), person())
    for t, path in enumerate(frame_paths(tmp_path / "out/frames/masks")):
        np.testing.assert_allclose(read_alpha(path), mask(t) / 255, atol=0.01)


def test_a_photo_that_lies_on_its_side_among_others_is_named(tmp_path, red_heads):
    (tmp_path / "photos").mkdir()
    for t in range(FRAMES):
        Image.fromarray(np.rot90(person(t), t == 2)).save(tmp_path / f"photos/IMG_{t}.png")
    frames, (told,) = split(tmp_path / "photos", tmp_path / "out")
    assert told.code is Code.LIES_ON_SIDE and told.frames == [[2, 2]] and np.array_equal(frames[3], person(3))


def test_who_lies_down_in_some_of_the_pictures_is_not_turned_and_who_stands_in_the_first_one_costs_one_look():
    people, looked = RedHeads({}), []
    stands, left, over, right = (np.rot90(person(), quarters) for quarters in range(4))
    nobody = np.zeros_like(stands)

    def watched(*pictures):
        looked.clear()
        for picture in pictures:
            looked.append(picture)
            yield picture

    assert find_quarters(people, watched(left, stands, stands, left, stands)) == 0
    assert find_quarters(people, watched(left, right, left, right)) == 0
    assert find_quarters(people, watched(left, left, nobody, left, stands)) == 3
    assert find_quarters(people, watched(nobody, right, right)) == 1
    assert find_quarters(people, watched(over, stands, over, stands)) == find_quarters(people, watched(over, left)) == 0
    assert find_quarters(people, watched(over, nobody, over, stands)) == 2
    assert find_quarters(people, watched(nobody, nobody)) == find_quarters(people, watched()) == 0
    assert find_quarters(people, watched(stands, left, left, left)) == 0 and len(looked) == 1


def test_an_empty_room_that_the_network_takes_for_somebody_who_lies_turns_nothing():
    class SomebodyEverywhere(RedHeads):
        def lean(self, image):
            lean = super().lean(image)
            return lean if lean is not None else 1.5 if image.shape[0] == HEIGHT else 3.0

    people, empty = SomebodyEverywhere({}), np.zeros_like(person())
    assert find_quarters(people, [empty] * 5) == find_quarters(people, [empty, empty, empty, person(), empty]) == 0
    assert find_quarters(people, [np.rot90(empty)] * 5) == 0, "somebody who hangs head down however the room is turned"
    assert find_quarters(people, [np.rot90(person()), np.rot90(empty), np.rot90(empty)]) == 3


@pytest.mark.parametrize("quarters", [0, 1, 2, 3])
def test_the_networks_see_which_way_a_person_is_turned(quarters):
    root = Path(os.environ.get("GSAC_CACHE", "~/.cache/gsac")).expanduser()
    try:
        people = People({name: model_path(name, root) for name in NETWORKS})
    except ModelMissingError as missing:
        pytest.skip(str(missing))
    if not (FOOTAGE / "truth-a/clip.mp4").exists():
        pytest.skip("footage truth-a/clip.mp4 is not here")
    image = cv2.cvtColor(cv2.VideoCapture(str(FOOTAGE / "truth-a/clip.mp4")).read()[1], cv2.COLOR_BGR2RGB)
    assert find_quarters(people, [np.ascontiguousarray(np.rot90(image, -quarters))]) == quarters
