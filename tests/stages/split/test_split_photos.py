"""split on folders of photos."""

import io
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageCms

from gsac.avatar.artifacts import Clip, frame_paths
from gsac.avatar.frame_files import read_frame
from gsac.stages.contract import BadInput, Job
from gsac.stages.split.config import SplitConfig
from gsac.stages.split.stage import run

ORIENTATION, FOCAL_35MM, EXIF_IFD = 0x0112, 0xA405, 0x8769


def photo(path, colour=(200, 60, 30), size=(60, 80), **save):
    """Left half in the colour, right half black."""
    pixels = np.zeros((size[1], size[0], 3), np.uint8)
    pixels[:, : size[0] // 2] = colour
    Image.fromarray(pixels).save(path, **save)


def split(source, out, **config):
    warnings = []
    out.mkdir()
    run(Job({"clip": source}, out, SplitConfig(**config), warn=lambda finding: warnings.append(finding.message)))
    return Clip.read(out / "clip.json"), [read_frame(p) for p in frame_paths(out / "frames")], warnings


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "photos").mkdir()
    return tmp_path / "photos"


def test_photos_come_in_natural_order_without_timestamps(folder, tmp_path):
    for i in (10, 9, 100):
        photo(folder / f"img{i}.png", (i, i, i))
    (folder / "notes.txt").write_text("x")
    (folder / "._img9.png").write_bytes(b"resource fork")
    clip, frames, _ = split(folder, tmp_path / "out")
    assert [int(f[0, 0, 0]) for f in frames] == [9, 10, 100]
    assert clip.timestamps_s is None and clip.fps is None and clip.focal_px is None


def test_photos_out_of_a_video_keep_its_times_and_the_frames_left_out_between_them(folder, tmp_path):
    for i in (8, 12, 20, 24):
        photo(folder / f"frame_{i:04d}.png", (i, i, i))
    clip, _, _ = split(folder, tmp_path / "out", photo_fps=8)
    assert clip.fps == 8
    assert clip.timestamps_s == pytest.approx([0, 0.5, 1.5, 2])
    (folder / "frame_0012.png").write_bytes(b"damaged")
    assert split(folder, tmp_path / "damaged", photo_fps=8)[0].timestamps_s == pytest.approx([0, 1.5, 2])
    assert split(folder, tmp_path / "few", photo_fps=8, count=2)[0].timestamps_s == pytest.approx([0, 2])


def test_photos_whose_names_tell_no_order_follow_each_other(folder, tmp_path):
    for name in "front", "left", "right":
        photo(folder / f"{name}.png")
    assert split(folder, tmp_path / "out", photo_fps=4)[0].timestamps_s == pytest.approx([0, 0.25, 0.5])


def test_the_plate_is_no_frame(folder, tmp_path):
    photo(folder / "0.png")
    photo(folder / "1.png")
    photo(folder / "Plate.PNG", (1, 2, 3))
    _, frames, _ = split(folder, tmp_path / "out")
    assert len(frames) == 2
    assert tuple(read_frame(tmp_path / "out/frames/plate.png")[0, 0]) == (1, 2, 3)


def test_exif_turns_the_photo_and_gives_the_focal_length(folder, tmp_path):
    exif = Image.Exif()
    exif[ORIENTATION] = 6
    exif.get_ifd(EXIF_IFD)[FOCAL_35MM] = 28
    photo(folder / "0.jpg", exif=exif)
    photo(folder / "1.jpg", exif=exif)
    clip, frames, _ = split(folder, tmp_path / "out")
    assert (clip.width, clip.height) == (80, 60)
    assert frames[0][5, 40, 0] > 150 and frames[0][55, 40, 0] < 50
    assert clip.focal_px == pytest.approx(28 / np.hypot(36, 24) * 100)


def test_the_focal_length_follows_the_scale(folder, tmp_path):
    exif = Image.Exif()
    exif.get_ifd(EXIF_IFD)[FOCAL_35MM] = 28
    photo(folder / "0.jpg", exif=exif)
    clip, _, warnings = split(folder, tmp_path / "out", max_height=40)
    assert (clip.width, clip.height) == (30, 40)
    assert clip.focal_px == pytest.approx(28 / np.hypot(36, 24) * 50)
    assert "one frame" in warnings[-1]


def test_transparency_sixteen_bits_and_palettes_become_eight_bit_rgb(folder, tmp_path):
    Image.fromarray(np.full((80, 60, 4), (200, 100, 50, 128), np.uint8)).save(folder / "0.png")
    Image.fromarray(np.full((80, 60), 32896, np.uint16)).save(folder / "1.png")
    Image.fromarray(np.full((80, 60, 3), (10, 20, 30), np.uint8)).quantize(4).save(folder / "2.png")
    clip, frames, _ = split(folder, tmp_path / "out")
    assert frames[0][0, 0] == pytest.approx([100, 50, 25], abs=1)
    assert frames[1][0, 0] == pytest.approx([128, 128, 128], abs=1)
    assert frames[2][0, 0] == pytest.approx([10, 20, 30], abs=2)
    assert clip.notes == ["transparency composited over black"]


def test_a_colour_profile_is_turned_into_srgb(folder, tmp_path):
    srgb = bytearray(ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes())
    swapped = bytearray(srgb)  # the same profile with the primaries of red and blue exchanged
    red, blue = swapped.find(b"rXYZ"), swapped.find(b"bXYZ")
    swapped[red : red + 4], swapped[blue : blue + 4] = b"bXYZ", b"rXYZ"
    photo(folder / "0.png", icc_profile=bytes(srgb))
    photo(folder / "1.png", icc_profile=bytes(swapped))
    photo(folder / "2.png", icc_profile=b"broken")
    _, frames, _ = split(folder, tmp_path / "out")
    assert frames[0][0, 0] == pytest.approx([200, 60, 30], abs=1)
    assert frames[1][0, 0] == pytest.approx([30, 60, 200], abs=4)
    assert frames[2][0, 0] == pytest.approx([200, 60, 30], abs=1)


def test_count_keeps_first_and_last(folder, tmp_path):
    for i in range(9):
        photo(folder / f"{i}.png", (i, 0, 0))
    _, frames, warnings = split(folder, tmp_path / "out", count=3)
    assert [int(f[0, 0, 0]) for f in frames] == [0, 4, 8] and "3 kept" in warnings[0]


def test_photos_of_other_sizes_are_scaled_to_the_usual_one_with_a_warning(folder, tmp_path):
    exif = Image.Exif()
    exif.get_ifd(EXIF_IFD)[FOCAL_35MM] = 28
    for name, size in (("0.jpg", (120, 160)), ("1.jpg", (60, 80)), ("2.jpg", (60, 80)), ("3.jpg", (60, 81))):
        photo(folder / name, size=size, exif=exif)
    clip, frames, warnings = split(folder, tmp_path / "out")
    assert (clip.width, clip.height) == (60, 80) and {f.shape for f in frames} == {(80, 60, 3)}
    assert all(f[40, 10, 0] > 150 and f[40, 50, 0] < 50 for f in frames)
    assert clip.focal_px == pytest.approx(28 / np.hypot(36, 24) * 100, rel=0.01)
    assert [w for w in warnings if "2 of 4 photos have another size than 60x80" in w and "0.jpg, 3.jpg" in w]


def test_a_photo_of_another_shape_is_shown_whole_and_its_focal_length_is_its_own(folder, tmp_path):
    exif = Image.Exif()
    exif.get_ifd(EXIF_IFD)[FOCAL_35MM] = 28
    photo(folder / "0.jpg", size=(80, 60), exif=exif)
    for i in (1, 2):
        photo(folder / f"{i}.jpg", exif=exif)
    _, frames, warnings = split(folder, tmp_path / "out")
    assert frames[0].shape == (80, 60, 3)
    assert frames[0][40, 10, 0] > 150 and frames[0][40, 50, 0] < 50, "both of its halves are there"
    assert frames[0][2, 10, 0] > 150, "the free edge repeats the photo's"
    assert "focal lengths differ" in " ".join(warnings)


def test_a_photo_that_cannot_be_read_is_left_out_with_a_warning(folder, tmp_path):
    for i in (0, 2, 3):
        photo(folder / f"{i}.png", (50 + i, 0, 0))
    (folder / "1.png").write_bytes((folder / "0.png").read_bytes()[:60])
    _, frames, warnings = split(folder, tmp_path / "out")
    assert [int(f[0, 0, 0]) for f in frames] == [50, 52, 53]
    assert "1 of 4 photos left out" in warnings[0] and "1.png" in warnings[0]


def test_heic_photos_are_read_with_their_focal_length_and_colours(folder, tmp_path):
    pillow_heif = pytest.importorskip("pillow_heif")
    pillow_heif.register_heif_opener()
    exif = Image.Exif()
    exif.get_ifd(EXIF_IFD)[FOCAL_35MM] = 28
    for name in ("IMG_1.HEIC", "IMG_2.heif"):
        photo(folder / name, format="HEIF", exif=exif, quality=95, size=(64, 80))
    clip, frames, warnings = split(folder, tmp_path / "out")
    assert len(frames) == 2 and (clip.width, clip.height) == (64, 80)
    assert frames[0][40, 5] == pytest.approx([200, 60, 30], abs=12) and frames[0][40, 59, 0] < 50
    assert clip.focal_px == pytest.approx(28 / np.hypot(36, 24) * np.hypot(64, 80)) and not warnings


@pytest.mark.parametrize(("name", "content", "message"), [
    ("notes.txt", b"x", "holds no photos"),
    ("a.DNG", b"x", "a.DNG.*Export them as JPEG"),
    ("a.HEIC", b"x", "a.HEIC.*cannot be read"),
    ("a.jpg", b"not a jpeg", "a.jpg.*cannot be read"),
])
def test_a_folder_that_gives_no_photo_is_bad_input(folder, tmp_path, name, content, message):
    (folder / name).write_bytes(content)
    with pytest.raises(BadInput, match=message):
        split(folder, tmp_path / "out")


def drawn(format, size=(8, 8)):
    buffer = io.BytesIO()
    Image.new("RGB", size).save(buffer, format)
    return buffer.getvalue()


@pytest.mark.parametrize("format", ["EPS", "GIF", "TGA", "PCX", "DDS", "ICNS", "PPM", "PDF"])
def test_a_photo_is_never_a_program_nor_of_a_kind_that_nobody_asked_for(folder, tmp_path, monkeypatch, format):
    monkeypatch.setattr("PIL.EpsImagePlugin.Ghostscript", lambda *_, **__: pytest.fail("a photo was run as a program"))
    (folder / "a.jpg").write_bytes(drawn(format))
    with pytest.raises(BadInput, match=r"a\.jpg: cannot be read as an image \(its content is no JPEG, PNG"):
        split(folder, tmp_path / "out")


@pytest.mark.parametrize(("name", "format"), [("a.jpg", "PNG"), ("b.png", "JPEG"), ("c.jpg", "WEBP"), ("d.jpg", "HEIF")])
def test_a_photo_of_another_kind_than_its_name_says_is_read_by_its_content(folder, tmp_path, name, format):
    pytest.importorskip("pillow_heif").register_heif_opener()
    (folder / name).write_bytes(drawn(format, (64, 64)))
    _, frames, _ = split(folder, tmp_path / "out")
    assert len(frames) == 1


@pytest.mark.parametrize(("width", "height"), [(8193, 8192), (60000, 60000), (3, 65536)])
def test_a_photo_of_too_many_pixels_is_refused_before_it_is_decoded(folder, tmp_path, width, height):
    small = bytearray(drawn("PNG"))
    small[16:24] = width.to_bytes(4, "big") + height.to_bytes(4, "big")
    small[29:33] = zlib.crc32(small[12:29]).to_bytes(4, "big")
    (folder / "a.png").write_bytes(small)
    with pytest.raises(BadInput, match=rf"a\.png: has {width}x{height} pixels; at most 67108864, and 65535 a side, are read"):
        split(folder, tmp_path / "out")


def test_a_cut_photo_is_bad_input(folder, tmp_path):
    buffer = io.BytesIO()
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (80, 60, 3), np.uint8)).save(buffer, "JPEG")
    (folder / "0.jpg").write_bytes(buffer.getvalue()[:900])
    with pytest.raises(BadInput, match="0.jpg"):
        split(folder, tmp_path / "out")


def test_a_single_photo_works_with_a_warning(tmp_path):
    photo(tmp_path / "me.jpg")
    clip, frames, warnings = split(tmp_path / "me.jpg", tmp_path / "out")
    assert len(frames) == 1 and clip.timestamps_s is None and "one frame" in warnings[0]


@pytest.mark.footage
def test_the_turn_photos_and_their_plate_keep_their_aspect(tmp_path):
    source = Path(__file__).parents[4] / "shared/footage/turn-photos"
    if not source.exists():
        pytest.skip("footage turn-photos is not here")
    clip, frames, _ = split(source, tmp_path / "out")
    assert (clip.width, clip.height, len(frames)) == (1707, 1280, 7)
    assert read_frame(tmp_path / "out/frames/plate.png").shape == frames[0].shape
