"""Writes a clip of a data set as a folder that `gsac run` takes: frames, masks beside them, camera, poses, split and notice."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from gsac.avatar.artifacts import write_arrays
from gsac.avatar.files import write_file
from gsac.avatar.frame_files import write_frame, write_image
from gsac.cache.half_made import half_made
from gsac.pipeline.data_sets.given import GivenClip
from gsac.stages.contract import BadInput

SPLIT, CAMERAS, POSES, NOTICE, MASKS = "split.json", "cameras.json", "poses.npz", "NOTICE.txt", "masks"


def write_clip(clip: GivenClip, folder: Path) -> None:
    """Writes the folder, whole or not at all. Raises BadInput where it is there already."""
    if folder.exists():
        raise BadInput(f"{folder}: is there already; remove it or give another --out")
    if not clip.numbers:
        raise BadInput(f"{clip.name}: has no frame of the split; the data are cut off, or of another subject")
    folder.parent.mkdir(parents=True, exist_ok=True)
    with half_made(folder.parent) as (temp, _):
        made = temp / folder.name
        (made / MASKS if clip.masked else made).mkdir(parents=True)
        size, names = None, clip.names(clip.numbers)
        for name, (rgb, mask) in zip(names, clip.frames(), strict=True):
            size = size or (rgb.shape[1], rgb.shape[0])
            if (rgb.shape[1], rgb.shape[0]) != size:
                raise BadInput(f"{clip.name}: frame {name} has {rgb.shape[1]}x{rgb.shape[0]} px, those before {size[0]}x{size[1]}")
            write_frame(made / f"{name}.png", rgb)
            if mask is not None:
                write_image(made / MASKS / f"{name}.png", mask)
        assert size is not None
        write_json(made / SPLIT, describe_split(clip))
        if clip.lens is not None:
            write_json(made / CAMERAS, describe_camera(clip, size))
        if clip.poses:
            write_arrays(made / POSES, **clip.poses)
        write_file(made / NOTICE, clip.notice.encode())
        made.rename(folder)


def describe_split(clip: GivenClip) -> dict:
    """The content of split.json."""
    out = {"fps": clip.fps, "split": clip.split_source, "train": clip.names(clip.train), "test": clip.names(clip.test)}
    return out if clip.sources is None else out | {"sources": dict(zip(clip.names(clip.numbers), clip.sources, strict=True))}


def describe_camera(clip: GivenClip, size: tuple[int, int]) -> dict:
    """The content of cameras.json. size: width and height, px."""
    assert clip.lens is not None
    out: dict = {"width": size[0], "height": size[1], "focal": list(clip.lens.focal), "center": list(clip.lens.center)}
    if clip.extrinsics is not None:
        out["extrinsics"] = dict(zip(clip.names(clip.numbers), np.round(clip.extrinsics, 9).tolist(), strict=True))
    return out


def write_json(path: Path, content: dict) -> None:
    """Writes it with sorted names."""
    write_file(path, (json.dumps(content, indent=1, sort_keys=True) + "\n").encode())
