"""Turns a folder of photos into frames, and its plate, the empty scene, where there is one."""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image, ImageCms, ImageOps, UnidentifiedImageError

from gsac.avatar.artifacts import Crop
from gsac.avatar.frame_files import write_alpha, write_frame
from gsac.stages.contract import BadInput
from gsac.stages.findings import Code, Finding
from gsac.stages.split import focal
from gsac.stages.split.config import SplitConfig
from gsac.stages.split.crop import plan_crop, principal_point
from gsac.stages.split.film import MASKS, PHOTO_SUFFIXES, PLATE, find_plates, find_videos
from gsac.stages.split.people import People, find_extent, find_shown
from gsac.stages.split.pick import fit_size, pick_evenly, turn_size
from gsac.stages.split.picture_quality import HEIGHT, judge_pictures, look_at
from gsac.stages.split.upright import LARGE_ENOUGH, LOOKS, describe_quarters, find_quarters, lies_on_side, turn

UNSUPPORTED = {".dng", ".raw", ".cr2", ".nef"}
FORMATS = ("JPEG", "PNG", "WEBP", "BMP", "TIFF")
"""What Pillow may take a photo's content for, whatever its name says. It knows others that are programs: EPS runs Ghostscript."""
MOST_PIXELS, LONGEST_SIDE = 1 << 26, 65535
"""Of a photo: more would fill the memory, however small the file is."""
Image.MAX_IMAGE_PIXELS = None  # open_image has its own bound, and names it
ORIENTATION, SIDEWAYS = 0x0112, (5, 6, 7, 8)
"""EXIF's tag, and its values for a photo that lies on its side."""
SAME_ASPECT = 0.01
"""Photos whose aspects differ by less are stretched to one size: rounding makes the difference."""
COMPOSITED = "transparency composited over black"


def list_photos(folder: Path) -> tuple[list[Path], Path | None]:
    """Photos in natural order (2 before 10), and the plate if there is one; hidden files and those of other types are skipped."""
    files = sorted((p for p in folder.iterdir() if p.is_file() and not p.name.startswith(".")), key=natural_order)
    refused = [p.name for p in files if p.suffix.lower() in UNSUPPORTED]
    if refused:
        raise BadInput(f"{folder.name}/{refused[0]}: {Path(refused[0]).suffix} photos are not supported "
                       f"({len(refused)} of them). Export them as JPEG or PNG.")
    images = [p for p in files if p.suffix.lower() in PHOTO_SUFFIXES]
    photos = [p for p in images if p.stem.lower() != PLATE]
    if not photos:
        videos = find_videos(folder)
        one = f"one of its {len(videos)} videos, such as {folder.name}/{videos[0].name}" if videos else "a video file"
        raise BadInput(f"{folder.name}: holds no photos; expected {', '.join(sorted(PHOTO_SUFFIXES))} files of one person, "
                       f"or give {one}.")
    return photos, list_plate(folder)


def list_plate(folder: Path) -> Path | None:
    """The plate of a folder if there is one. Raises BadInput where there are several."""
    plates = find_plates(folder)
    if len(plates) > 1:
        raise BadInput(f"{folder.name}: has {len(plates)} plates ({', '.join(p.name for p in plates)}); keep one.")
    return plates[0] if plates else None


def split_photos(photos: list[Path], plate: Path | None, frames: Path, config: SplitConfig, people: People | None,
                 warn: Callable[[Finding], None], progress: Callable[[int, int, str], None],
                 mask_of: Callable[[Path, int, int], np.ndarray] | None = None) -> dict:
    """Writes frames/%06d.png and frames/plate.png. people: who finds the person, None: the frames stay whole; mask_of: gives the
    mask (height, width) of a photo of this width and height, px, for frames/masks/%06d.exr. Returns the Clip fields width, height,
    focal_px, notes, crop, center, fps, timestamps_s, repeated."""
    picks = [photos[i] for i in pick_evenly(len(photos), config.count)]
    if len(picks) < len(photos):
        warn(Finding.of(Code.PHOTOS_DROPPED, figure=len(picks), given=len(photos), count=config.count))
    usual = usual_size(picks)
    quarters = 0 if people is None else find_quarters(people, read_small(picks, usual))
    if quarters:
        warn(describe_quarters(quarters))
    usual = turn_size(*usual, quarters)
    crop = find_crop(picks, usual, config, people, quarters)
    width, height = fit_size(*usual if crop is None else (crop.width, crop.height), config.max_height)

    def fit(rgb: np.ndarray, exif: Image.Exif) -> tuple[np.ndarray, float | None]:
        return place_photo(rgb, exif, usual, crop, (width, height))

    if mask_of is not None:
        (frames / MASKS).mkdir()
    moments = None if config.photo_fps is None else dict(zip(photos, photo_times(photos, config.photo_fps), strict=True))
    focals, times, looks, notes, other, lying, unread = [], [], [], set(), [], [], []
    for done, path in enumerate(picks):
        try:
            rgb, exif, had_alpha = read_photo(path)
        except BadInput as e:
            unread.append(e)
            continue
        if had_alpha:
            notes.add(COMPOSITED)
        if turn_size(rgb.shape[1], rgb.shape[0], quarters) != usual:
            other.append(path.name)
        small = fit_size(rgb.shape[1], rgb.shape[0], LARGE_ENOUGH)
        lying.append(people is not None and turn_size(rgb.shape[1], rgb.shape[0], quarters + 1) == usual != usual[::-1]
                     and lies_on_side(people, turn(_resize(rgb, *small), quarters)))
        if mask_of is not None:
            mask = turn(mask_of(path, rgb.shape[1], rgb.shape[0]), quarters)
            write_alpha(frames / MASKS / f"{len(focals):06d}.exr", fit(mask, exif)[0])
        shown, focal_px = fit(turn(rgb, quarters), exif)
        del rgb  # before the next one is read
        write_frame(frames / f"{len(focals):06d}.png", shown)
        focals.append(focal_px)
        times += [moments[path]] if moments else []
        looks.append(look_at(_resize(shown, *fit_size(width, height, HEIGHT))))
        progress(done + 1, len(picks), "frames")
    if not focals:
        raise unread[0]
    if unread:
        warn(Finding.of(Code.PHOTOS_UNREAD, figure=len(unread), given=len(picks), reasons="; ".join(map(str, unread))))
    if other:
        warn(Finding.of(Code.PHOTO_SIZES, figure=len(other), given=len(picks), width=usual[0], height=usual[1],
                        names=", ".join(other)))
    if any(lying):
        warn(Finding.of(Code.LIES_ON_SIDE, np.array(lying)))
    if plate is not None:
        rgb, _, had_alpha = read_photo(plate)
        if had_alpha:
            notes.add(COMPOSITED)
        write_frame(frames / "plate.png", fit(turn(rgb, quarters), Image.Exif())[0])
    find = None if people is None else partial(find_shown, people, frames)
    repeated, findings = judge_pictures(looks, moments is not None, find)
    for finding in findings:
        warn(finding)
    known = [f for f in focals if f is not None]
    if known and max(known) > 1.02 * min(known):
        warn(Finding.of(Code.PHOTO_ZOOM, least=min(known), most=max(known)))
    return {"width": width, "height": height, "focal_px": float(np.median(known)) if known else None,
            "notes": sorted(notes), "crop": crop, "fps": config.photo_fps,
            "timestamps_s": [round(time - times[0], 6) for time in times] or None,
            "repeated": np.flatnonzero(repeated).tolist(),
            "center": None if crop is None else principal_point(crop, (width, height), *usual)}


def photo_times(photos: list[Path], fps: float) -> np.ndarray:
    """(N,) s, rising, of photos in order. Where all names end in numbers that rise these count the frames, else the order does."""
    ends = [re.search(r"(\d+)$", photo.stem) for photo in photos]
    numbers = np.array([int(end[1]) if end else -1 for end in ends], float)
    if numbers[0] < 0 or (np.diff(numbers) <= 0).any():
        numbers = np.arange(len(photos), dtype=float)
    return (numbers - numbers[0]) / fps


def find_crop(photos: list[Path], usual: tuple[int, int], config: SplitConfig, people: People | None,
              quarters: int = 0) -> Crop | None:
    """About the person in all photos; None where they stay whole. usual: width and height, px, that most of them have once they are
    turned by so many quarters."""
    if people is None or not config.crop or config.max_height is None or usual[1] <= config.max_height:
        return None
    size = fit_size(*usual, config.max_height)

    def small() -> Iterator[np.ndarray]:
        for path in photos:
            with contextlib.suppress(BadInput):  # it is left out, and read_photo says why
                rgb, exif, _ = read_photo(path, turn_size(*size, quarters))
                yield fit_photo(turn(rgb, quarters), exif, *size)[0]

    extent = find_extent(people, small(), *usual, config.max_height)
    return plan_crop(extent, *usual, config.max_height) if extent is not None else None


def read_small(photos: list[Path], usual: tuple[int, int]) -> Iterator[np.ndarray]:
    """(h, w, 3) uint8 of some of the photos, by which they are turned. usual: width and height, px, that most of them have."""
    size = fit_size(*usual, LARGE_ENOUGH)
    for i in pick_evenly(len(photos), LOOKS):
        with contextlib.suppress(BadInput):
            rgb, exif, _ = read_photo(photos[i], size)
            yield fit_photo(rgb, exif, *size)[0]


def usual_size(photos: list[Path]) -> tuple[int, int]:
    """Width and height, px, that most photos have when they stand upright; of two as frequent, the earlier photo's."""
    sizes = []
    for path in photos:
        try:
            with open_image(path) as image:
                sizes.append(image.size[::-1] if image.getexif().get(ORIENTATION) in SIDEWAYS else image.size)
        except Exception:  # read_photo says why
            continue
    return max(sizes, key=sizes.count, default=(1, 1))


def fit_photo(rgb: np.ndarray, exif: Image.Exif, width: int, height: int) -> tuple[np.ndarray, float | None]:
    """The photo rgb (H, W, 3) as large as it fits into width x height, px, and its focal length there, px.

    What another aspect leaves free at two edges repeats the edge.
    """
    import cv2

    wide, high = rgb.shape[1], rgb.shape[0]
    scale = min(width / wide, height / high)
    if abs(wide / high * height / width - 1) < SAME_ASPECT:
        inner = (width, height)
    else:
        inner = max(1, round(wide * scale)), max(1, round(high * scale))
    shown = _resize(rgb, *inner)
    left, top = (width - inner[0]) // 2, (height - inner[1]) // 2
    if inner != (width, height):
        shown = cv2.copyMakeBorder(shown, top, height - inner[1] - top, left, width - inner[0] - left, cv2.BORDER_REPLICATE)
    return shown, focal.from_exif(exif, *inner)


def place_photo(rgb: np.ndarray, exif: Image.Exif, usual: tuple[int, int], crop: Crop | None,
                size: tuple[int, int]) -> tuple[np.ndarray, float | None]:
    """The photo rgb (H, W, 3) as a frame, cut as all are, and its focal length there, px. usual, size: width and height of the
    footage and of the frames, px."""
    if crop is None:
        return fit_photo(rgb, exif, *size)
    shown, focal_px = fit_photo(rgb, exif, *usual)
    part = shown[crop.y: crop.y + crop.height, crop.x: crop.x + crop.width]
    return _resize(part, *size), None if focal_px is None else focal_px * crop.scale


def write_plate_of_video(plate: Path, frames: Path, footage: tuple[int, int], crop: Crop | None, size: tuple[int, int],
                         quarters: int = 0) -> None:
    """Writes plate.png as the frames of a video are made. Raises BadInput where it is no picture of the video's aspect. footage,
    size: width and height of the video and of the frames, px; quarters: by which the footage was turned (`upright`)."""
    rgb = turn(read_photo(plate)[0], quarters)
    height, width = rgb.shape[:2]
    if abs(width / height * footage[1] / footage[0] - 1) >= SAME_ASPECT:
        raise BadInput(f"{plate.name}: has {width}x{height} px, the video {footage[0]}x{footage[1]}; a plate beside a video is a "
                       "picture of the empty scene out of a video by the same camera from the same stand, or remove it")
    write_frame(frames / f"{PLATE}.png", place_photo(rgb, Image.Exif(), footage, crop, size)[0])


def open_image(path: Path) -> Image.Image:
    """Opens a photo, whose pixels are decoded later; the first HEIC one loads what decodes it. BadInput where it is larger than
    MOST_PIXELS or LONGEST_SIDE; Pillow's errors."""
    with path.open("rb") as file:
        is_heic = file.read(8)[4:] == b"ftyp"
    if is_heic:
        import pillow_heif

        pillow_heif.register_heif_opener()
    image = Image.open(path, formats=("HEIF",) if is_heic else FORMATS)
    width, height = image.size
    if width * height > MOST_PIXELS or max(width, height) > LONGEST_SIDE:
        image.close()
        raise BadInput(f"{path.name}: has {width}x{height} pixels; at most {MOST_PIXELS}, and {LONGEST_SIDE} a side, are read. "
                       "Export it smaller.")
    return image


def read_photo(path: Path, least: tuple[int, int] | None = None) -> tuple[np.ndarray, Image.Exif, bool]:
    """(H, W, 3) uint8 sRGB turned upright, its EXIF, and whether it had transparency (composited over black).

    least: width and height, px; a JPEG may then come smaller, though not smaller than that, in a fraction of the time.
    """
    try:
        with open_image(path) as image:
            exif, profile = image.getexif(), image.info.get("icc_profile")
            if least is not None:
                image.draft(None, (min(least), min(least)))
            image.load()
        ImageOps.exif_transpose(image, in_place=True)
        has_alpha = image.has_transparency_data
        if image.mode.startswith(("I", "F")):  # 16-bit grey: Pillow would clip it
            image = _eight_bits(image)
        image = _in_mode(image, "RGBA" if has_alpha else image.mode if image.mode in ("RGB", "CMYK") else "RGB")
        image = _to_srgb(image, profile)
        if has_alpha:
            image = Image.alpha_composite(Image.new("RGBA", image.size, (0, 0, 0, 255)), image)
        return np.asarray(_in_mode(image, "RGB")), exif, has_alpha
    except BadInput:
        raise
    except UnidentifiedImageError as e:
        raise BadInput(f"{path.name}: cannot be read as an image (its content is no {', '.join(FORMATS)} or HEIC). "
                       "Remove it or export it again.") from e
    except Exception as e:  # a damaged file makes Pillow's readers raise nearly anything
        raise BadInput(f"{path.name}: cannot be read as an image ({e or type(e).__name__}). Remove it or export it again.") from e


def _in_mode(image: Image.Image, mode: str) -> Image.Image:
    """The image itself where it has the mode: a copy of a large photo costs much."""
    return image if image.mode == mode else image.convert(mode)


def _eight_bits(image: Image.Image) -> Image.Image:
    """Of 16-bit grey, or numbers of another kind; row by row: in float64 the whole would be eight times as large."""
    grey = np.asarray(image)
    out = np.empty(grey.shape, np.uint8)
    for row, of in zip(out, grey, strict=True):
        row[:] = (of.astype(np.float64) / 257).round().clip(0, 255)
    return Image.fromarray(out)


def _to_srgb(image: Image.Image, profile: bytes | None) -> Image.Image:
    """Converts by the photo's profile: phones store Display P3, which looks pale when read as sRGB."""
    if profile is None:
        return image
    try:
        source = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        mode = "RGBA" if image.mode == "RGBA" else "RGB"
        return ImageCms.profileToProfile(image, source, ImageCms.createProfile("sRGB"), outputMode=mode) or image
    except (ImageCms.PyCMSError, OSError):
        return image  # a profile for another colour model, or a broken one: browsers ignore it too


def _resize(rgb: np.ndarray, width: int, height: int) -> np.ndarray:
    import cv2

    if rgb.shape[:2] == (height, width):
        return rgb
    return cv2.resize(rgb, (width, height), interpolation=cv2.INTER_AREA)


def natural_order(path: Path) -> list:
    """A key that sorts paths by name, numbers in it by their value."""
    return [(0, int(part), "") if part.isdecimal() else (1, 0, part.lower()) for part in re.split(r"(\d+)", path.name)]
