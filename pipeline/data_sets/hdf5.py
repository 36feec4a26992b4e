"""Reads arrays of a data set's HDF5 file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gsac.avatar import hdf5
from gsac.pipeline.data_sets.given import need_file
from gsac.stages.contract import BadInput


def read_hdf5(path: Path, *names: str) -> dict[str, np.ndarray]:
    """Arrays (...) by name. Raises BadInput where one is missing or h5py is."""
    need_file(path)
    try:
        return hdf5.read_hdf5(path, *names)
    except hdf5.Hdf5Error as e:
        raise BadInput(str(e)) from e
