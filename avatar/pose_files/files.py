"""Reads a file of poses as arrays over its frames: an npz of all frames, or a zip of one npz or json a frame. No pickle is read."""

from __future__ import annotations

import json
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from gsac.avatar.artifacts import ArtifactError
from gsac.avatar.npz import NpzError, open_zip, read_npz

MOST_MEMBER = 8 << 20
"""Bytes of one frame's file."""
SHARED = "shape_param.json"
"""ExAvatar's shape of all frames, a plain list."""
FRAME = re.compile(r"(\d+)(?:_\d+)?$")
"""Name of a frame's file: its number, and a person's as SMPLer-X has it."""
FRAME_IDS = "frame_ids"
"""WHAM's array of frame numbers."""


def read_frames(path: Path) -> tuple[dict[str, np.ndarray], np.ndarray | None]:
    """Arrays (n, ...) by name, and the frames' numbers (n,) where the file has them. Raises ArtifactError."""
    try:
        with open_zip(path) as file:
            names = [m.filename for m in file.infolist() if not m.is_dir()]
            if not any(name.endswith(".npy") for name in names):
                return _stack(path, file, names)
        arrays = read_npz(path)
    except (NpzError, OSError, zipfile.BadZipFile) as e:
        raise ArtifactError(f"{path}: not a readable npz, or zip of one npz or json a frame ({e})") from e
    numbers = arrays.pop(FRAME_IDS, None)
    if numbers is not None and (numbers.dtype.kind not in "iu" or not numbers.size):
        raise ArtifactError(f"{path}: {FRAME_IDS} holds no whole numbers; expected the number of each pose's frame")
    return arrays, None if numbers is None else numbers.ravel().astype(int)


def _stack(path: Path, file: zipfile.ZipFile, names: list[str]) -> tuple[dict[str, np.ndarray], np.ndarray]:
    frames: dict[int, tuple[str, dict[str, np.ndarray]]] = {}
    shared: dict[str, np.ndarray] = {}
    for name in names:
        reader = READERS.get(Path(name).suffix)
        found = FRAME.match(Path(name).stem)
        if reader is None or not (found or Path(name).name == SHARED):
            continue
        if file.getinfo(name).file_size > MOST_MEMBER:
            raise ArtifactError(f"{path}: {name} has more than {MOST_MEMBER} bytes, which no frame's parameters have")
        try:
            arrays = reader(file.read(name))
        except (ValueError, TypeError, AttributeError, RecursionError) as e:
            raise ArtifactError(f"{path}: {name} is not readable ({e})") from e
        if found is None:
            shared = arrays
            continue
        number = int(found[1])
        if number in frames:
            raise ArtifactError(f"{path}: frame {number} is in {frames[number][0]} and in {name}; leave one person's files")
        frames[number] = name, arrays
    if not frames:
        raise ArtifactError(f"{path}: no frame's file is in it; expected one npz or json a frame, named by the frame's number")
    numbers = sorted(frames)
    first, keys = frames[numbers[0]][0], frames[numbers[0]][1]
    for number in numbers:
        name, arrays = frames[number]
        for key, values in keys.items():
            if key not in arrays or arrays[key].size != values.size:
                raise ArtifactError(f"{path}: {key} of {name} is not like that of {first}; every frame needs the same arrays")
    return {key: np.stack([frames[n][1][key].ravel() for n in numbers]) for key in keys} | shared, np.array(numbers)


def _read_json(content: bytes) -> dict[str, np.ndarray]:
    values = json.loads(content)
    return {name: np.array(numbers, float) for name, numbers in (values if isinstance(values, dict) else {"shape": values}).items()}


def _read_npz(content: bytes) -> dict[str, np.ndarray]:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "frame.npz"
        path.write_bytes(content)
        return read_npz(path, objects=False)


READERS: dict[str, Callable[[bytes], dict[str, np.ndarray]]] = {".json": _read_json, ".npz": _read_npz}
"""Suffix of a frame's file -> its reader."""
