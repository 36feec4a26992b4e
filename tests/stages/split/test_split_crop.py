"""split on footage in which the person is small: frames are cut about them before they are scaled."""

import filecmp
import os
import subprocess
from pathlib import Path

import cv2
import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

from gsac.avatar.artifacts import Clip, frame_paths
from gsac.avatar.frame_files import read_frame
from gsac.avatar.network_files import ModelMissingError, model_path
from gsac.stages.contract import Job
from gsac.stages.split import stage
from gsac.stages.split.config import NETWORKS, SplitConfig
from gsac.stages.split.crop import Extent, plan_crop
from gsac.stages.split.keyframes import read_key_frames
from gsac.stages.split.people import People, find_extent
from gsac.stages.split.probe import probe

FOOTAGE = Path(__file__).parents[4] / "shared" / "footage"
WIDTH, HEIGHT, MOST = 270, 480, 160
STANDS = "drawbox=60:300:40:120:white:fill"
"""A person as high as a quarter of the footage, left of its middle and low."""
FOCAL_35MM, EXIF_IFD = 0xA405, 0x8769


class WhitePeople(People):
    """Takes white for a person."""

    def look(self, image):
        self.looked += 1
        rows, columns = np.nonzero(image.min(2) > 200)
        if not len(rows):
            return None
        self.seen += 1
        return Extent.of(np.array([[columns.min(), rows.min()], [columns.max() + 1, rows.max() + 1]], float))

    follow = look

    def lean(self, image):
        return 0.0


@pytest.fixture(autouse=True)
def white_people(monkeypatch):
    monkeypatch.setattr(stage, "People", WhitePeople)


def make_clip(path, *boxes, encode=()):
    subprocess.run([imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-loglevel", "error", "-f", "lavfi", "-i",
                    f"color=0x404040:size={WIDTH}x{HEIGHT}:rate=10:duration=1,format=yuv420p", "-vf", ",".join(boxes), "-c:v",
                    "libx264", "-crf", "4", *encode, str(path)], check=True)
    return path


def split(source, out, networks=NETWORKS, **config):
    told = []
    out.mkdir()
    stage.run(Job({"clip": source}, out, SplitConfig(max_height=MOST, **config), models=dict.fromkeys(networks, Path()),
                  warn=lambda finding: told.append(finding.message), note=told.append))
    clip = Clip.read(out / "clip.json")
    frames = [read_frame(p) for p in frame_paths(out / "frames")]
    assert {frame.shape for frame in frames} == {(clip.height, clip.width, 3)} and clip.height <= MOST
    return clip, frames, told


def white(frame):
    """x0, y0, x1, y1 px of what is white in a frame (H, W, 3)."""
    rows, columns = np.nonzero(frame.min(2) > 127)
    return np.array([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1])


def test_a_person_who_fills_a_quarter_of_the_footage_is_cut_out_and_larger_in_the_frames(tmp_path):
    clip, frames, told = split(make_clip(tmp_path / "a.mp4", STANDS), tmp_path / "out")
    box = white(frames[0])
    assert box[3] - box[1] >= 2.5 * 120 * MOST / HEIGHT and len(frames) == 10
    assert told[1:] == [f"The frames are cut to {clip.crop.width}x{clip.crop.height} px about the person before they are scaled "
                        "(split.crop=false keeps them whole)."] and "Nothing moves" in told[0]
    corner = np.array([clip.crop.x, clip.crop.y] * 2)
    assert box / clip.crop.scale + corner == pytest.approx(np.array([60, 300, 100, 420]), abs=1.5)
    assert np.array(clip.center) / clip.crop.scale + corner[:2] == pytest.approx(np.array([WIDTH, HEIGHT]) / 2, abs=1)
    assert clip.longer_side == pytest.approx(HEIGHT * clip.crop.scale, abs=0.5)


def test_an_arm_raised_between_key_frames_is_not_cut(tmp_path):
    arm = "drawbox=100:320:90:10:white:fill:enable='between(t,0.45,0.75)'"
    clip, frames, _ = split(make_clip(tmp_path / "a.mp4", STANDS, arm, encode=("-g", "100")), tmp_path / "out")
    box = white(frames[6])
    assert box[2] / clip.crop.scale + clip.crop.x == pytest.approx(190, abs=1.5)
    assert box[2] + 10 * clip.crop.scale < clip.width
    assert [p.name for p in sorted((tmp_path / "out/frames").iterdir())] == [f"{i:06d}.png" for i in range(10)]


@pytest.mark.parametrize("why", ["walks", "large", "rarely seen", "no networks", "switched off"])
def test_footage_stays_whole_to_the_byte_where_a_crop_gains_little_or_the_person_is_not_known(tmp_path, why):
    seen = {"walks": ["drawbox=60:'20+340*t':40:120:white:fill"], "large": ["drawbox=60:50:100:380:white:fill"],
            "rarely seen": [f"{STANDS}:enable='lt(t,0.35)'"]}.get(why, [STANDS])
    source = make_clip(tmp_path / "a.mp4", *seen, encode=("-g", "2"))
    clip, _, told = split(source, tmp_path / "1", () if why == "no networks" else NETWORKS, crop=why != "switched off")
    split(source, tmp_path / "2", ())
    names = ["clip.json", *(f"frames/{i:06d}.png" for i in range(10))]
    assert filecmp.cmpfiles(tmp_path / "1", tmp_path / "2", names, shallow=False)[0] == names
    assert clip.crop is None and (clip.width, clip.height) == (90, 160) and not any("cut to" in line for line in told)
    assert "cent" not in (tmp_path / "1/clip.json").read_text() and "crop" not in (tmp_path / "1/clip.json").read_text()


def test_a_person_who_leaves_the_crop_altogether_is_in_frames_that_are_whole(tmp_path):
    leaves = [f"{STANDS}:enable='lt(t,0.35)'", "drawbox=200:20:40:120:white:fill:enable='gte(t,0.35)'"]
    clip, frames, _ = split(make_clip(tmp_path / "a.mp4", *leaves, encode=("-g", "100")), tmp_path / "out")
    assert clip.crop is None and len(frames) == 10


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_crop_is_right_in_footage_that_lies_on_its_side(tmp_path, mirrored):
    lying = make_clip(tmp_path / "lying.mp4", STANDS, *["hflip"] * mirrored, "transpose=clock")
    turned = tmp_path / "turned.mp4"
    subprocess.run([imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-loglevel", "error", "-display_rotation", "90",
                    *["-display_hflip"] * mirrored, "-i", str(lying), "-c", "copy", str(turned)], check=True)
    upright = next(read_key_frames(turned, probe(turned), 3, WIDTH, HEIGHT))
    assert upright.shape == (HEIGHT, WIDTH, 3) and white(upright) == pytest.approx(np.array([60, 300, 100, 420]), abs=1)
    clip, frames, _ = split(turned, tmp_path / "out")
    box = white(frames[0]) / clip.crop.scale + [clip.crop.x, clip.crop.y] * 2
    assert box == pytest.approx(np.array([60, 300, 100, 420]), abs=1.5)


def test_photos_and_their_plate_are_cut_alike_and_keep_their_focal_length(tmp_path):
    folder = tmp_path / "photos"
    folder.mkdir()
    exif = Image.Exif()
    exif.get_ifd(EXIF_IFD)[FOCAL_35MM] = 26
    for i, name in enumerate(["0.jpg", "1.jpg", "plate.jpg"]):
        pixels = np.full((HEIGHT, WIDTH, 3), 64, np.uint8)
        pixels[300:420, 60 + 10 * i: 100 + 10 * i] = 255
        Image.fromarray(pixels).save(folder / name, exif=exif, quality=95)
    clip, frames, _ = split(folder, tmp_path / "out")
    shown = [*frames, read_frame(tmp_path / "out/frames/plate.png")]
    assert [white(image)[0] / clip.crop.scale + clip.crop.x for image in shown] == pytest.approx([60, 70, 80], abs=1.5)
    assert clip.focal_px == pytest.approx(26 / np.hypot(36, 24) * np.hypot(WIDTH, HEIGHT) * clip.crop.scale)


def test_the_crop_of_a_video_keeps_the_focal_length_that_the_phone_wrote(tmp_path):
    tag = ("-movflags", "use_metadata_tags", "-metadata", "com.apple.quicktime.camera.focal_length.35mm_equivalent=26")
    clip, _, _ = split(make_clip(tmp_path / "a.mov", STANDS, encode=tag), tmp_path / "out")
    assert clip.focal_px == pytest.approx(26 / np.hypot(36, 24) * np.hypot(WIDTH, HEIGHT) * clip.crop.scale)


@pytest.mark.parametrize("seed", range(4))
def test_a_planned_crop_holds_the_person_lies_in_the_footage_and_starts_on_even_pixels(seed):
    rng = np.random.default_rng(seed)
    for _ in range(50):
        width, height = rng.integers(300, 2200, 2)
        low = rng.uniform(0, 0.8, 2) * [width, height]
        extent = Extent.of(np.array([low, low + rng.uniform(0.1, 0.3, 2) * [width, height]]))
        crop = plan_crop(extent, int(width), int(height), 200)
        if crop is None:
            continue
        low, high = np.array([crop.x, crop.y]), np.array([crop.x + crop.width, crop.y + crop.height])
        assert not (low % 2).any() and (low >= 0).all() and (high <= [width, height]).all()
        assert (low <= extent.box[:2].clip(0)).all() and (high >= extent.box[2:].clip(None, [width, height])).all()
        assert crop.height * crop.scale == pytest.approx(min(crop.height, 200))


@pytest.mark.parametrize("share", [0.4, 0.2])
def test_the_networks_find_all_of_a_small_person(share):
    root = Path(os.environ.get("GSAC_CACHE", "~/.cache/gsac")).expanduser()
    try:
        people = People({name: model_path(name, root) for name in NETWORKS})
    except ModelMissingError as missing:
        pytest.skip(str(missing))
    if not (FOOTAGE / "truth-a/clip.mp4").exists():
        pytest.skip("footage truth-a/clip.mp4 is not here")
    image = cv2.cvtColor(cv2.VideoCapture(str(FOOTAGE / "truth-a/clip.mp4")).read()[1], cv2.COLOR_BGR2RGB)
    mask = cv2.imread(str(FOOTAGE / "truth-a/mask/0000.png"), cv2.IMREAD_GRAYSCALE)
    scale = share * len(image) / np.ptp(np.flatnonzero((mask > 127).any(1)))
    scene = np.full_like(image, 120)
    small, shape = (cv2.resize(each, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) for each in (image, mask))
    scene[400: 400 + len(small), 300: 300 + small.shape[1]] = small
    rows, columns = np.nonzero(shape > 127)
    extent = find_extent(people, [scene], image.shape[1], image.shape[0], len(image) // 2)
    assert (extent.box[:2] < [columns.min() + 300, rows.min() + 400]).all()
    assert (extent.box[2:] > [columns.max() + 300, rows.max() + 400]).all()
    assert extent.tall == pytest.approx(np.ptp(rows), rel=0.2)
