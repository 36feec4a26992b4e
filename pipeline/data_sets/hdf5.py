"""Reads arrays of an HDF5 file, by h5py of the extra `data`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gsac.pipeline.data_sets.given import need_file
from gsac.stages.contract import BadInput


def read_hdf5(path: Path, *names: str) -> dict[str, np.ndarray]:
    """Arrays (...) by name. Raises BadInput where one is missing or h5py is."""
    need_file(path)
    try:
        import h5py
    except ImportError as e:
        raise BadInput(f"{path.name} is HDF5, and the package h5py, which reads it, is not installed; run "
                       "`pip install \"gsac[data]\"`, or `pip install h5py` in gsac's environment") from e
    try:
        with h5py.File(path, "r") as file:
            missing = [name for name in names if name not in file]
            if missing:
                raise BadInput(f"{path}: has no array {missing[0]}; it has {', '.join(sorted(file)) or 'none'}")
            found = {}
            for name in names:
                array = file[name] if isinstance(file.get(name, getlink=True), h5py.HardLink) else None
                if not isinstance(array, h5py.Dataset) or array.external:
                    raise BadInput(f"{path}: {name} is no array of this file itself; download it again")
                found[name] = np.asarray(array)
            return found
    except OSError as e:
        raise BadInput(f"{path}: cannot be read as HDF5 ({e}); download it again") from e
