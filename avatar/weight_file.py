"""Reads network weights from .safetensors, .npz or a state_dict saved by torch: arrays only, no code is run."""

from __future__ import annotations

import json
import math
import pickle
import zipfile
from pathlib import Path

import numpy as np

from gsac.avatar.npz import MOST_BYTES, open_zip, read_npz

TORCH = (".pth", ".pt", ".ckpt", ".bin")
SUFFIXES = (".safetensors", ".npz", *TORCH)
SAFETENSORS = {"F64": "<f8", "F32": "<f4", "F16": "<f2", "BF16": "<u2"}
LARGEST_HEADER = 16 << 20


class WeightsError(ValueError):
    """A file of weights cannot be used. The message names the file, the array and the expected content."""


def read_weights(path: Path) -> dict[str, np.ndarray]:
    """Name -> float32 array (...), of the file's arrays of floats. Raises `WeightsError`."""
    try:
        if path.suffix == ".safetensors":
            return _safetensors(path)
        if path.suffix == ".npz":
            with np.errstate(over="ignore"):
                return {name: np.asarray(values, np.float32) for name, values in read_npz(path).items() if values.dtype.kind == "f"}
        if path.suffix in TORCH:
            return _torch(path)
    except FileNotFoundError as error:
        raise WeightsError(f"{path}: no such file") from error
    except WeightsError:
        raise
    except Exception as error:  # zipfile, json and torch raise nearly anything on a damaged file
        raise WeightsError(f"{path} cannot be read as {path.suffix}: {error or type(error).__name__}") from error
    raise WeightsError(f"{path}: unknown kind of file; give one of {', '.join(SUFFIXES)}")


def _safetensors(path: Path) -> dict[str, np.ndarray]:
    """The format: 8 bytes of length, a JSON header, the arrays' bytes."""
    if path.stat().st_size > MOST_BYTES:
        raise ValueError(f"it has {path.stat().st_size} bytes; at most {MOST_BYTES} are read")
    data = path.read_bytes()
    length = int.from_bytes(data[:8], "little")
    if len(data) < 8 or length > len(data) - 8:
        raise ValueError("the file ends within its header")
    if length > LARGEST_HEADER:
        raise ValueError(f"its header has {length} bytes; at most {LARGEST_HEADER} are read")
    found, start, room = {}, 8 + length, len(data) - 8 - length
    for name, entry in json.loads(data[8:start]).items():
        if name == "__metadata__" or entry["dtype"] not in SAFETENSORS:
            continue
        kind = np.dtype(SAFETENSORS[entry["dtype"]])
        begin, end = (start + int(x) for x in entry["data_offsets"])
        if not start <= begin <= end <= len(data) or end - begin != kind.itemsize * math.prod(entry["shape"]):
            raise ValueError(f"{name} lies outside of the file or has another size than its shape says")
        room -= end - begin
        if room < 0:
            raise ValueError(f"{name} lies where another array lies")
        values = np.frombuffer(data[begin:end], kind).reshape(entry["shape"])
        if entry["dtype"] == "BF16":  # the upper half of a float32
            values = (values.astype(np.uint32) << 16).view(np.float32)
        found[name] = values.astype(np.float32)
    return found


def _torch(path: Path) -> dict[str, np.ndarray]:
    import torch

    if zipfile.is_zipfile(path):
        with open_zip(path) as file:
            unpacked = sum(member.file_size for member in file.infolist())
        if unpacked > MOST_BYTES:
            raise ValueError(f"it has {unpacked} bytes when unpacked; at most {MOST_BYTES} are read")
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
    except (pickle.UnpicklingError, RuntimeError) as error:
        raise WeightsError(f"{path} is no plain state_dict; save it with torch.save(model.state_dict(), FILE) "
                           f"({str(error).splitlines()[0]})") from error
    if isinstance(state, dict) and isinstance(state.get("state_dict"), dict):
        state = state["state_dict"]
    if not isinstance(state, dict):
        raise ValueError(f"it holds a {type(state).__name__}, not a state_dict")
    floats = {str(name): value for name, value in state.items() if isinstance(value, torch.Tensor) and value.is_floating_point()}
    numbers = sum(value.numel() for value in floats.values())  # an expanded tensor says more than its file holds
    if 4 * numbers > MOST_BYTES:
        raise ValueError(f"it holds {numbers} numbers; at most {MOST_BYTES // 4} are read")
    return {name: value.detach().float().numpy() for name, value in floats.items()}
