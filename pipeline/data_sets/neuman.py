"""NeuMan (Jiang et al. 2022): a folder a scene, with `images/`, `segmentations/` (0 where the person is), COLMAP's `sparse/` as
text and `train_split.txt`, `val_split.txt`, `test_split.txt`.

The camera moves with the one who films. Poses are left out: they are pickles of Python objects, or lie in COLMAP's own scale.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from gsac.pipeline.data_sets.given import (
    GivenClip,
    Lens,
    list_pictures,
    need_file,
    need_lens,
    read_grey,
    read_lines,
    read_names,
    read_rgb,
    same_size,
)
from gsac.stages.contract import BadInput

FPS = 30.0
"""Of the frames' numbers; the data set does not tell it."""
LENSES = {"PINHOLE": (0, 1, 2, 3), "SIMPLE_PINHOLE": (0, 0, 1, 2), "SIMPLE_RADIAL": (0, 0, 1, 2), "OPENCV": (0, 1, 2, 3)}
"""COLMAP's model -> places of both focal lengths and of the centre among its parameters."""
NOTICE = ("NeuMan: W. Jiang, K. M. Yi, G. Samei, O. Tuzel, A. Ranjan: NeuMan: Neural Human Radiance Field from a Single Video, "
          "ECCV 2022.\nhttps://github.com/apple/ml-neuman\nUnder the licence that came with your download; frames and masks here "
          "are that data set's.\n")


def read(path: Path) -> Iterator[GivenClip]:
    """The clip of a scene's folder, or of each scene in a folder of them."""
    inside = [folder for folder in sorted(path.iterdir()) if (folder / "images").is_dir()]
    for folder in [path] if (path / "images").is_dir() else inside or [path]:
        yield read_scene(folder)


def read_scene(folder: Path) -> GivenClip:
    """The clip of one scene."""
    images = list_pictures(folder / "images")
    number = {path.name: number_of(path) for path in images}
    parts = {part: read_names(folder / f"{part}_split.txt", number) for part in ("train", "test")}
    chosen = {*parts["train"], *parts["test"]}
    kept = [path for path in images if number[path.name] in chosen]
    lens, turns = read_colmap(folder / "sparse", [path.name for path in kept])
    return GivenClip(folder.name, [number[path.name] for path in kept], lambda: map(read_frame, kept), NOTICE, FPS, lens=lens,
                     extrinsics=turns, train=parts["train"], test=parts["test"], split_source="NeuMan")


def number_of(path: Path) -> int:
    """A frame's number by its name."""
    if not path.stem.isdecimal():
        raise BadInput(f"{path}: is misnamed; expected a number such as 00000.png")
    return int(path.stem)


def read_frame(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """rgb (H, W, 3) and mask (H, W) of a picture."""
    mask_path = need_file(path.parent.parent / "segmentations" / path.name, "the mask")
    rgb, grey = read_rgb(path), read_grey(mask_path)
    if grey.dtype != np.uint8:
        raise BadInput(f"{mask_path}: has {8 * grey.itemsize} bits a pixel; expected 8, 0 where the person is and 255 elsewhere")
    same_size(rgb, grey, mask_path)
    return rgb, 255 - grey


def read_colmap(folder: Path, names: list[str]) -> tuple[Lens, np.ndarray]:
    """The lens, and world -> camera (T, 3, 4) of pictures by name, from COLMAP's text files."""
    cameras, images = (need_file(folder / f"{name}.txt", "COLMAP's text file") for name in ("cameras", "images"))
    lines = [line.split() for line in read_lines(cameras) if not line.startswith("#")]
    if len(lines) != 1 or len(lines[0]) < 7 or lines[0][1] not in LENSES:
        raise BadInput(f"{cameras}: expected one camera of {', '.join(LENSES)}, found {len(lines)} lines")
    try:
        values = [float(value) for value in lines[0][4:]]
        fx, fy, cx, cy = (values[at] for at in LENSES[lines[0][1]])
        turns = {}
        for row in map(str.split, read_lines(images)):
            if len(row) == 10 and re.search(r"\.(png|jpe?g)$", row[9], re.IGNORECASE):
                w, x, y, z, *shift = (float(value) for value in row[1:8])
                turns[row[9]] = np.column_stack([Rotation.from_quat([x, y, z, w]).as_matrix(), shift])
    except (ValueError, IndexError) as e:
        raise BadInput(f"{folder}: cameras.txt or images.txt is not COLMAP's text ({e})") from e
    missing = [name for name in names if name not in turns]
    if missing:
        raise BadInput(f"{images}: has no camera of {missing[0]}")
    odd = [name for name in names if not np.isfinite(turns[name]).all()]
    if odd:
        raise BadInput(f"{images}: the camera of {odd[0]} has a number that is not finite; download it again")
    return need_lens(Lens((fx, fy), (cx, cy)), cameras), np.stack([turns[name] for name in names])
