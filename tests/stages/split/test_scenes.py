"""Of a clip that is cut together of several scenes one is used, the longest that shows a person, and split says so."""

import os
import subprocess
from pathlib import Path

import cv2
import imageio_ffmpeg
import numpy as np
import pytest

from gsac.avatar.artifacts import Clip, frame_paths
from gsac.avatar.frame_files import read_frame, write_frame
from gsac.avatar.network_files import ModelMissingError, model_path
from gsac.stages.contract import Job
from gsac.stages.findings import Code
from gsac.stages.split import stage
from gsac.stages.split.config import NETWORKS, SplitConfig
from gsac.stages.split.crop import Extent
from gsac.stages.split.people import People
from gsac.stages.split.picture_quality import find_scene_cuts
from gsac.stages.split.scenes import Scene, choose_scene, divide

FOOTAGE = Path(__file__).parents[4] / "shared" / "footage"
SIZE, RATE = (160, 240), 10


def room(seed: int) -> np.ndarray:
    """(H, W, 3) uint8, boxes of many colours."""
    rng = np.random.default_rng(seed)
    return cv2.resize(rng.integers(20, 230, (12, 8, 3), np.uint8), SIZE, interpolation=cv2.INTER_NEAREST)


def film(*scenes):
    """A dark bar that moves before a room: for each scene the room's seed and its number of frames."""
    for seed, frames in scenes:
        for t in range(frames):
            picture = room(seed)
            picture[40:220, 20 + t:36 + t] = (20, 30, 90)
            yield picture


def write(path, pictures):
    folder = path.with_suffix("")
    folder.mkdir()
    for t, picture in enumerate(pictures):
        write_frame(folder / f"{t:06d}.png", picture)
    ffmpeg("-framerate", RATE, "-i", folder / "%06d.png", "-c:v", "ffv1", path)
    return path


def ffmpeg(*arguments):
    subprocess.run([imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-loglevel", "error", *map(str, arguments)], check=True)


def split(source, out, models=None, **config):
    found = []
    out.mkdir()
    stage.run(Job({"clip": source}, out, SplitConfig(**config), models=models or {}, warn=found.append))
    times = np.array(Clip.read(out / "clip.json").timestamps_s)
    return times, [read_frame(path) for path in frame_paths(out / "frames")], {finding.code: finding for finding in found}


def mean_off(picture, seed):
    return np.abs(picture.astype(int) - room(seed)).mean()


@pytest.mark.parametrize(("scenes", "used", "seconds"), [
    (((1, 14), (2, 30)), 2, (1.4, 4.3)), (((1, 30), (2, 14)), 1, (0, 2.9)), (((1, 12), (2, 24), (3, 12)), 2, (1.2, 3.5))])
def test_the_longest_scene_is_used_with_all_frames_that_it_may_have_at_its_own_times(tmp_path, scenes, used, seconds):
    times, frames, found = split(write(tmp_path / "clip.mkv", film(*scenes)), tmp_path / "out", count=22)
    assert len(frames) == 22 and max(mean_off(frame, used) for frame in frames) < 15
    assert times[0] >= seconds[0] - 0.01 and times[-1] <= seconds[1] + 0.01
    assert np.ptp(times) > np.ptp(seconds) - 0.25
    assert f"of {len(scenes)} scenes" in found[Code.SCENES_LEFT_OUT].message and Code.SCENE_CUT not in found


def test_a_cut_that_shows_only_where_frames_lie_close_is_found_too(tmp_path):
    times, frames, found = split(write(tmp_path / "clip.mkv", film((1, 30), (2, 6), (3, 50))), tmp_path / "out", count=12)
    assert len(frames) == 12 and max(mean_off(frame, 3) for frame in frames) < 15 and times[0] >= 3.6
    assert Code.SCENES_LEFT_OUT in found


def test_a_camera_that_swings_and_a_clip_of_one_scene_lose_no_frame(tmp_path):
    wide = np.random.default_rng(4).integers(20, 230, (12, 90, 3), np.uint8)
    swing = [cv2.resize(wide[:, 3 * t:3 * t + 8], SIZE, interpolation=cv2.INTER_NEAREST) for t in range(20)]
    assert not find_scene_cuts(np.stack([cv2.resize(p, (20, 30)).astype(np.float32) for p in swing])).any()
    times, frames, found = split(write(tmp_path / "clip.mkv", film((1, 20))), tmp_path / "out")
    assert len(frames) == 20 and Code.SCENES_LEFT_OUT not in found and times[0] == 0


class Seen(People):
    """A person where the picture is bright, whole unless it is very bright."""

    def __init__(self):
        super().__init__({})

    def look(self, image):
        level = image.mean()
        return None if level < 50 else Extent(np.array([20.0, 20, 80, 220 if level < 150 else 300]), 200.0)


def test_a_whole_person_counts_more_than_a_part_and_a_part_more_than_nobody(tmp_path):
    for t, level in enumerate(np.repeat([10, 100, 200, 10], [8, 4, 8, 12])):
        write_frame(tmp_path / f"{t:06d}.png", np.full((240, 160, 3), level, np.uint8))
    frames, times = frame_paths(tmp_path), np.arange(32) / RATE
    scenes = [(Scene(first, last), np.arange(first, last + 1)) for first, last in ((0, 7), (8, 11), (12, 19), (20, 31))]
    assert choose_scene(scenes, times, frames, Seen()) == Scene(8, 11)
    assert choose_scene([scenes[0], scenes[2]], times, frames, Seen()) == Scene(12, 19)
    assert choose_scene([scenes[0], scenes[3]], times, frames, Seen()) == Scene(20, 31)  # nobody at all: the longest
    assert choose_scene(scenes, times, frames, None) == Scene(20, 31)


def test_where_pictures_are_missing_nothing_is_divided():
    assert divide(Scene(0, 9), np.arange(10), [np.zeros((30, 20, 3))] * 9) [0][0] == Scene(0, 9)


@pytest.mark.footage
@pytest.mark.slow
@pytest.mark.parametrize(("order", "used"), [(("turn", "squats"), "squats"), (("nobody", "turn"), "turn"),
                                             (("head of squats", "turn", "head of squats"), "turn")])
def test_real_clips_that_are_cut_together_give_the_scene_of_one_person(tmp_path, order, used):
    if not FOOTAGE.is_dir():
        pytest.skip("the footage is not here")
    turn, squats = ("-itsscale", "3", "-i", FOOTAGE / "truth-a/clip.mp4"), FOOTAGE / "squats/pose_squats.mp4"
    sources = {"turn": turn, "squats": ("-i", squats), "head of squats": ("-t", "4", "-i", squats),
               "nobody": ("-f", "lavfi", "-t", "12", "-i", "testsrc=size=360x640:rate=10")}
    seconds = {"turn": 6.0, "squats": 13.0, "head of squats": 4.0, "nobody": 12.0}
    shape = ";".join(f"[{i}:v]scale=360:640,fps=10,format=yuv420p,setsar=1[v{i}]" for i in range(len(order)))
    joined = "".join(f"[v{i}]" for i in range(len(order))) + f"concat=n={len(order)}"
    clip = tmp_path / "clip.mp4"
    ffmpeg(*[word for name in order for word in sources[name]], "-filter_complex", f"{shape};{joined}", "-crf", "12", clip)
    root = Path(os.environ.get("GSAC_CACHE", "~/.cache/gsac")).expanduser()
    try:
        models = {name: model_path(name, root) for name in NETWORKS}
    except ModelMissingError as missing:
        pytest.skip(str(missing))
    times, _, found = split(clip, tmp_path / "out", models, count=40)
    first = sum(seconds[name] for name in order[:order.index(used)])
    assert first - 0.01 <= times[0] < first + 0.6
    assert first + seconds[used] - 0.6 < times[-1] < first + seconds[used]
    assert f"of {len(order)} scenes" in found[Code.SCENES_LEFT_OUT].message
