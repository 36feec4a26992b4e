"""Masks beside the footage: whose frame they are of, where they land on it, and what is said of those that cannot be used."""

import subprocess

import cv2
import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

from gsac.avatar.artifacts import Clip, Crop, frame_paths
from gsac.avatar.frame_files import read_alpha, read_frame
from gsac.stages.contract import BadInput, Job
from gsac.stages.split.config import SplitConfig
from gsac.stages.split.masks import write_masks
from gsac.stages.split.stage import run

FRAMES, WIDTH, HEIGHT = 10, 96, 160


def soft_disc(x, y, width=WIDTH, height=HEIGHT):
    """(height, width) uint8: a disc with a soft edge, its middle at x, y in shares of the picture."""
    rows, columns = np.mgrid[:height, :width] + 0.5
    distance = np.hypot(columns - x * width, rows - y * height)
    return np.clip(255 * (0.15 * height - distance) / 6 + 128, 0, 255).astype(np.uint8)


def place(t):
    return 0.3 + 0.04 * t, 0.4


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    """A lossless clip of a bright disc that moves, whose brightness is its mask."""
    path = tmp_path_factory.mktemp("film") / "clip.mkv"
    video = np.stack([soft_disc(*place(t)) for t in range(FRAMES)])
    subprocess.run([imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "gray", "-s",
                    f"{WIDTH}x{HEIGHT}", "-r", "10", "-i", "-", "-c:v", "ffv1", path], input=video.tobytes(), check=True)
    return path


@pytest.fixture
def footage(film, tmp_path):
    """That clip in a folder with the masks of its frames."""
    folder = tmp_path / "footage"
    (folder / "masks").mkdir(parents=True)
    (folder / film.name).write_bytes(film.read_bytes())
    for t in range(FRAMES):
        Image.fromarray(soft_disc(*place(t))).save(folder / f"masks/{t:06d}.png")
    return folder


def split(folder, out, **config):
    """Alphas and frames, 0..1."""
    out.mkdir()
    run(Job({"clip": folder}, out, SplitConfig(**config)))
    masks, frames = frame_paths(out / "frames/masks"), frame_paths(out / "frames")
    assert [path.stem for path in masks] == [path.stem for path in frames]
    return [read_alpha(path) for path in masks], [read_frame(path)[..., 0] / 255 for path in frames]


def test_each_picked_frame_of_a_video_gets_the_mask_of_its_own_number(footage, tmp_path):
    alphas, frames = split(footage, tmp_path / "out", count=4)
    assert len(alphas) == 4
    for t, alpha, frame in zip((0, 3, 6, 9), alphas, frames, strict=True):
        assert np.abs(alpha - soft_disc(*place(t)) / 255).max() < 1 / 2048
        assert np.abs(alpha - frame).max() < 0.03


def test_a_mask_is_scaled_and_cut_as_its_frame_is(footage, tmp_path):
    alphas, frames = split(footage, tmp_path / "out", max_height=80)
    for alpha, frame in zip(alphas, frames, strict=True):
        assert alpha.shape == (80, 48) and np.abs(alpha - frame).max() < 0.06
    (tmp_path / "cut").mkdir()
    crop = Crop(12, 20, 60, 100, 0.5)
    write_masks(tmp_path / "cut", [footage / "masks/000002.png"] * 2, (WIDTH, HEIGHT), crop, (30, 50), np.array([False, True]))
    wanted = soft_disc(*place(2))[20:120, 12:72].reshape(50, 2, 30, 2).mean((1, 3)) / 255
    assert np.abs(read_alpha(tmp_path / "cut/masks/000000.exr") - wanted).max() < 1 / 2048
    assert np.abs(read_alpha(tmp_path / "cut/masks/000001.exr") - wanted[:, ::-1]).max() < 1 / 2048


def test_masks_of_another_size_lie_where_the_person_is(footage, tmp_path):
    for t in range(FRAMES):
        Image.fromarray(soft_disc(*place(t), WIDTH // 2, HEIGHT // 2)).save(footage / f"masks/{t:06d}.png")
    alphas, _ = split(footage, tmp_path / "out")
    rows, columns = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    for t, alpha in enumerate(alphas):
        x, y = place(t)
        assert alpha.shape == (HEIGHT, WIDTH)
        assert abs((alpha * columns).sum() / alpha.sum() - x * WIDTH) < 0.05
        assert abs((alpha * rows).sum() / alpha.sum() - y * HEIGHT) < 0.05


def test_photos_take_the_masks_of_their_names_upright_and_in_their_size(tmp_path):
    folder = tmp_path / "photos"
    (folder / "masks").mkdir(parents=True)
    sideways = Image.Exif()
    sideways[0x0112] = 6
    for name, size, x in (("a", (WIDTH, HEIGHT), 0.4), ("b", (WIDTH, HEIGHT), 0.5), ("c", (2 * WIDTH, 2 * HEIGHT), 0.6)):
        mask = soft_disc(x, 0.5, *size)
        Image.fromarray(mask).save(folder / f"masks/{name}.png")
        grey = np.rot90(mask) if name == "b" else mask
        Image.fromarray(np.dstack([grey] * 3)).save(folder / f"{name}.png", exif=sideways if name == "b" else None)
    alphas, frames = split(folder, tmp_path / "out")
    assert len(alphas) == 3
    for alpha, frame in zip(alphas, frames, strict=True):
        assert np.abs(alpha - frame).max() < 0.01


def bad(folder, name, content):
    cv2.imwrite(str(folder / "masks" / name), content)


@pytest.mark.parametrize(("spoil", "words"), [
    (lambda f: (f / "masks/000003.png").unlink(), "masks/000003.png: is missing, the mask of frame 3 of the video"),
    (lambda f: (f / "masks/000003.png").rename(f / "masks/three.png"), "masks/three.png: is none of the video's frames; masks are "
                                                                      "named by their numbers, 000000.png to 000009.png"),
    (lambda f: bad(f, "000010.png", soft_disc(0.5, 0.5)), "masks/000010.png: is none of the video's frames"),
    (lambda f: bad(f, "3.png", soft_disc(0.5, 0.5)), "masks/3.png: 000003.png has the same name"),
    (lambda f: bad(f, "000003.png", soft_disc(0.5, 0.5, 100, 100)), "masks/000003.png: is 100x100 px, of another aspect"),
    (lambda f: bad(f, "000003.png", np.zeros((HEIGHT, WIDTH), np.uint8)), "masks/000003.png: is empty"),
    (lambda f: bad(f, "000003.png", np.full((HEIGHT, WIDTH, 3), (10, 200, 30), np.uint8)), "masks/000003.png: is coloured"),
    (lambda f: (f / "masks/000003.png").write_bytes(b""), "masks/000003.png: cannot be read as an image"),
    (lambda f: (f / "masks/notes.txt").write_text("?"), "masks/notes.txt: is no mask"),
    (lambda f: [mask.unlink() for mask in (f / "masks").iterdir()], "masks: the folder is empty"),
])
def test_a_mask_that_cannot_be_used_is_named_with_what_was_expected(footage, tmp_path, spoil, words):
    spoil(footage)
    with pytest.raises(BadInput) as error:
        split(footage, tmp_path / "out")
    assert words in str(error.value) and str(error.value).count("masks/masks") == 0


def test_a_photo_without_a_mask_and_a_mask_without_a_photo_are_named(tmp_path):
    (tmp_path / "masks").mkdir()
    for name in "ab":
        Image.fromarray(np.dstack([soft_disc(0.5, 0.5)] * 3)).save(tmp_path / f"{name}.png")
    Image.fromarray(soft_disc(0.5, 0.5)).save(tmp_path / "masks/a.png")
    with pytest.raises(BadInput, match="masks/b.png: is missing, the mask of photo b.png"):
        split(tmp_path, tmp_path / "out")
    Image.fromarray(soft_disc(0.5, 0.5)).save(tmp_path / "masks/c.png")
    with pytest.raises(BadInput, match="masks/c.png: belongs to no photo"):
        split(tmp_path, tmp_path / "again")


def test_a_clip_with_masks_is_the_clip_itself_in_clip_json(footage, film, tmp_path):
    for source, out in ((footage, tmp_path / "with"), (film, tmp_path / "without")):
        out.mkdir()
        run(Job({"clip": source}, out, SplitConfig()))
    assert Clip.read(tmp_path / "with/clip.json") == Clip.read(tmp_path / "without/clip.json")
