"""Turns a folder of photos into frames, and its plate, the empty scene, where there is one."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image, ImageCms, ImageOps, UnidentifiedImageError

from gsac.avatar.artifacts import write_frame
from gsac.stages.contract import BadInput
from gsac.stages.split import focal
from gsac.stages.split.config import SplitConfig
from gsac.stages.split.pick import fit_size, pick_evenly

SUFFIXES = {".jpg", ".jpeg", ".png", ".webp", ".bmp", ".tif", ".tiff"}
UNSUPPORTED = {".heic", ".heif", ".dng", ".raw", ".cr2", ".nef"}
VIDEO_SUFFIXES = {".mp4", ".mov", ".m4v", ".mkv", ".webm", ".avi"}
PLATE = "plate"


def list_photos(folder: Path) -> tuple[list[Path], Path | None]:
    """Photos in natural order (2 before 10), and the plate if there is one; hidden files and those of other types are skipped."""
    files = sorted((p for p in folder.iterdir() if p.is_file() and not p.name.startswith(".")), key=_natural)
    refused = [p.name for p in files if p.suffix.lower() in UNSUPPORTED]
    if refused:
        raise BadInput(f"{folder.name}/{refused[0]}: {Path(refused[0]).suffix} photos are not supported "
                       f"({len(refused)} of them). Export them as JPEG or PNG.")
    images = [p for p in files if p.suffix.lower() in SUFFIXES]
    plates = [p for p in images if p.stem.lower() == PLATE]
    if len(plates) > 1:
        raise BadInput(f"{folder.name}: has {len(plates)} plates ({', '.join(p.name for p in plates)}); keep one.")
    photos = [p for p in images if p.stem.lower() != PLATE]
    if not photos:
        videos = [p.name for p in files if p.suffix.lower() in VIDEO_SUFFIXES]
        hint = f"or give one of its {len(videos)} videos, such as {folder.name}/{videos[0]}" if videos else "or give a video file"
        raise BadInput(f"{folder.name}: holds no photos; expected {', '.join(sorted(SUFFIXES))} files of one person, {hint}.")
    return photos, plates[0] if plates else None


def split_photos(photos: list[Path], plate: Path | None, frames: Path, config: SplitConfig, warn: Callable[[str], None],
                 progress: Callable[[int, int, str], None]) -> dict:
    """Writes frames/%06d.png and frames/plate.png. Returns the Clip fields width, height, focal_px, notes."""
    picks = [photos[i] for i in pick_evenly(len(photos), config.count)]
    if len(picks) < len(photos):
        warn(f"{len(photos)} photos given, {len(picks)} kept evenly (split.count is {config.count}).")
    first_size, focals, notes = None, [], set()
    for i, path in enumerate(picks + [plate] * (plate is not None)):
        rgb, exif, had_alpha = read_photo(path)
        size = (rgb.shape[1], rgb.shape[0])
        first_size = first_size or size
        if size != first_size:
            raise BadInput(f"{path.name} is {size[0]}x{size[1]} and {picks[0].name} is {first_size[0]}x{first_size[1]}"
                           "; expected photos of one size, from one camera that stands still.")
        if had_alpha:
            notes.add("transparency composited over black")
        width, height = fit_size(*size, config.max_height)
        if path == plate:
            write_frame(frames / "plate.png", _resize(rgb, width, height))
            continue
        focals.append(focal.from_exif(exif, width, height))
        write_frame(frames / f"{i:06d}.png", _resize(rgb, width, height))
        progress(i + 1, len(picks), "frames")
    known = [f for f in focals if f is not None]
    if known and max(known) > 1.02 * min(known):
        warn(f"the photos' focal lengths differ ({min(known):.0f} to {max(known):.0f} px): was the zoom moved? "
             "Their median is used.")
    return {"width": width, "height": height, "focal_px": float(np.median(known)) if known else None,
            "notes": sorted(notes)}


def read_photo(path: Path) -> tuple[np.ndarray, Image.Exif, bool]:
    """(H, W, 3) uint8 sRGB turned upright, its EXIF, and whether it had transparency (composited over black)."""
    try:
        with Image.open(path) as image:
            exif, profile = image.getexif(), image.info.get("icc_profile")
            image = ImageOps.exif_transpose(image)
            has_alpha = image.has_transparency_data
            if image.mode.startswith(("I", "F")):  # 16-bit grey: Pillow would clip it
                image = Image.fromarray((np.asarray(image, np.float64) / 257).round().clip(0, 255).astype(np.uint8))
            image = image.convert("RGBA" if has_alpha else image.mode if image.mode in ("RGB", "CMYK") else "RGB")
            image = _to_srgb(image, profile)
    except (UnidentifiedImageError, OSError, SyntaxError) as e:
        raise BadInput(f"{path.name}: cannot be read as an image ({e}). Remove it or export it again.") from e
    if has_alpha:
        image = Image.alpha_composite(Image.new("RGBA", image.size, (0, 0, 0, 255)), image)
    return np.asarray(image.convert("RGB")), exif, has_alpha


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


def _natural(path: Path) -> list:
    return [(0, int(part), "") if part.isdigit() else (1, 0, part.lower()) for part in re.split(r"(\d+)", path.name)]
