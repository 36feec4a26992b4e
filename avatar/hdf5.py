"""Reads arrays of an HDF5 file, by h5py of the extra `data`: arrays that lie in the file itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np


class Hdf5Error(ValueError):
    """A file cannot be read as HDF5. The message names the file, the array and what to do."""


def read_hdf5(path: Path, *names: str) -> dict[str, np.ndarray]:
    """Arrays (...) by name. Raises Hdf5Error where one is missing or h5py is."""
    require_h5py(path.name)
    import h5py

    try:
        with h5py.File(path, "r") as file:
            missing = [name for name in names if name not in file]
            if missing:
                raise Hdf5Error(f"{path}: has no array {missing[0]}; it has {', '.join(sorted(file)) or 'none'}")
            found = {}
            for name in names:
                array = file[name] if isinstance(file.get(name, getlink=True), h5py.HardLink) else None
                if not isinstance(array, h5py.Dataset) or array.external:
                    raise Hdf5Error(f"{path}: {name} is no array of this file itself; download it again")
                found[name] = np.asarray(array)
            return found
    except OSError as e:
        raise Hdf5Error(f"{path}: cannot be read as HDF5 ({e}); download it again") from e


def require_h5py(what: str) -> None:
    """Raises Hdf5Error where h5py is not installed. what: the name of the file that needs it."""
    try:
        import h5py  # noqa: F401, whether it is here
    except ImportError as e:
        raise Hdf5Error(f"{what} is HDF5, and the package h5py, which reads it, is not installed; run "
                        "`pip install \"gsac[data]\"`, or `pip install h5py` in gsac's environment") from e
