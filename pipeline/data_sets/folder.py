"""Any other data: a folder with `images/` and `masks/` of the same names, or the pictures themselves with or without `masks/`; and,
where there is a split, `train_split.txt` and `test_split.txt` with a name a line."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gsac.avatar.mask_file import MaskError, read_mask
from gsac.pipeline.data_sets.given import GivenClip, has_pictures, list_pictures, need_file, read_names, read_rgb, same_size
from gsac.stages.contract import BadInput

FPS = 30.0
NOTICE = "Imported from a folder of the user's; its own terms hold.\n"


def read(path: Path) -> Iterator[GivenClip]:
    """The one clip of the folder."""
    plain = not (path / "images").is_dir() and has_pictures(path)
    images = list_pictures(path if plain else path / "images")
    masks = None if plain and not (path / "masks").is_dir() else path / "masks"
    ends = [re.search(r"\d+$", image.stem) for image in images]
    numbers = [int(end[0]) for end in ends if end]
    if len(numbers) < len(images) or any(b <= a for a, b in zip(numbers, numbers[1:], strict=False)):
        numbers = list(range(len(images)))
    by_name = {image.name: number for image, number in zip(images, numbers, strict=True)}
    by_name |= {image.stem: number for image, number in zip(images, numbers, strict=True)}

    files = {part: path / f"{part}_split.txt" for part in ("train", "test")}
    split = {part: read_names(file, by_name) for part, file in files.items() if file.exists()}
    test = split.get("test", [])
    train = split.get("train", [number for number in numbers if number not in set(test)])
    kept = [(image, number) for image, number in zip(images, numbers, strict=True) if number in {*train, *test}]
    yield GivenClip(path.resolve().name, [number for _, number in kept],
                    lambda: (read_frame(image, masks) for image, _ in kept), NOTICE, FPS, train=train, test=test,
                    split_source="the folder's" if test else "",
                    sources=[image.name for image, _ in kept], masked=masks is not None)


def read_frame(path: Path, masks: Path | None) -> tuple[np.ndarray, np.ndarray | None]:
    """rgb (H, W, 3) and mask (H, W) of a picture; None without a folder of masks."""
    if masks is None:
        return read_rgb(path), None
    mask_path = need_file(masks / f"{path.stem}.png", "the mask")
    try:
        rgb, mask = read_rgb(path), np.rint(read_mask(mask_path) * 255).astype(np.uint8)
    except MaskError as e:
        raise BadInput(f"{masks.parent}/{e}") from e
    same_size(rgb, mask, mask_path)
    return rgb, mask
