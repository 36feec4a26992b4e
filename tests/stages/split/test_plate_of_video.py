"""The empty scene beside a video: read, cut and scaled as its frames are."""

import shutil
import subprocess

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

from gsac.avatar.artifacts import Clip, Crop, frame_paths
from gsac.avatar.frame_files import read_frame
from gsac.stages.contract import BadInput, Job
from gsac.stages.split.config import SplitConfig
from gsac.stages.split.film import find_film
from gsac.stages.split.photos import write_plate_of_video
from gsac.stages.split.stage import run

WIDTH, HEIGHT = 96, 160


def scene(width=WIDTH, height=HEIGHT):
    """(height, width, 3) uint8: every place has a colour of its own."""
    y, x = np.mgrid[:height, :width]
    return np.stack([255 * x / width, 255 * y / height, 0 * x + 90], -1).astype(np.uint8)


@pytest.fixture
def footage(tmp_path):
    """A folder with a lossless clip of the scene, in which something white moves, and its plate."""
    folder = tmp_path / "footage"
    folder.mkdir()
    video = np.tile(scene(), (6, 1, 1, 1))
    for t in range(6):
        video[t, 40:120, 20 + 4 * t:50 + 4 * t] = 255
    subprocess.run([imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s",
                    f"{WIDTH}x{HEIGHT}", "-r", "10", "-i", "-", "-c:v", "ffv1", "-pix_fmt", "bgr0", folder / "clip.mkv"],
                   input=video.tobytes(), check=True)
    Image.fromarray(scene()).save(folder / "plate.png")
    return folder


def split(folder, out, **config):
    out.mkdir()
    run(Job({"clip": folder}, out, SplitConfig(**config)))
    return Clip.read(out / "clip.json")


def test_the_plate_of_a_video_comes_along_at_the_frames_size_and_is_part_of_what_was_filmed(footage, tmp_path):
    clip = split(footage, tmp_path / "out", max_height=80)
    frames, plate = frame_paths(tmp_path / "out/frames"), read_frame(tmp_path / "out/frames/plate.png")
    assert len(frames) == 6 and plate.shape == (80, 48, 3) and clip.timestamps_s is not None
    np.testing.assert_allclose(plate[:, 40:].astype(int), read_frame(frames[0])[:, 40:].astype(int), atol=3)
    (footage / "plate.png").unlink()
    assert clip.source_sha256 != split(footage / "clip.mkv", tmp_path / "without").source_sha256


def test_it_is_cut_as_the_frames_are(footage, tmp_path):
    write_plate_of_video(footage / "plate.png", tmp_path, (WIDTH, HEIGHT), Crop(16, 40, 48, 80, 0.5), (24, 40))
    expected = scene()[40:120, 16:64].reshape(40, 2, 24, 2, 3).mean((1, 3))
    np.testing.assert_allclose(read_frame(tmp_path / "plate.png"), expected, atol=2)


def test_a_plate_of_another_aspect_and_two_plates_are_named(footage, tmp_path):
    Image.fromarray(scene(120, 160)).save(footage / "plate.png")
    with pytest.raises(BadInput, match=r"plate.png: has 120x160 px, the video 96x160; a plate beside a video"):
        split(footage, tmp_path / "out")
    Image.fromarray(scene()).save(footage / "plate.jpg")
    with pytest.raises(BadInput, match="has 2 plates"):
        split(footage, tmp_path / "again")


def test_one_video_alone_in_a_folder_is_the_footage_and_of_two_none_is(footage, tmp_path):
    (footage / "plate.png").unlink()
    (footage / "LICENSE").write_text("CC0")
    split(footage, tmp_path / "out")
    assert len(frame_paths(tmp_path / "out" / "frames")) == 6
    shutil.copy(footage / "clip.mkv", footage / "again.mp4")
    with pytest.raises(BadInput, match="give one of its 2 videos, such as footage/again.mp4"):
        split(footage, tmp_path / "again")


def test_photos_beside_a_video_are_the_footage_plate_or_not_and_the_video_is_told(footage, tmp_path):
    assert find_film(footage) == footage / "clip.mkv"
    Image.fromarray(scene()).save(footage / "IMG_1.png")
    assert find_film(footage) is None
    said, out = [], tmp_path / "out"
    out.mkdir()
    run(Job({"clip": footage}, out, SplitConfig(), note=said.append))
    assert said == ["1 photo of the folder taken, footage/clip.mkv not; give footage/clip.mkv itself to take that"]
    (footage / "masks").mkdir()
    assert find_film(footage) == footage / "clip.mkv"
