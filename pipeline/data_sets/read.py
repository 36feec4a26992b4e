"""The data sets by name."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from pathlib import Path

from gsac.pipeline.data_sets.given import GivenClip
from gsac.stages.contract import BadInput

DATA_SETS = ("peoplesnapshot", "xhumans", "neuman", "folder")
"""Names of the modules that read them, and of the command's choices."""


def read_data_set(name: str, path: Path) -> Iterator[GivenClip]:
    """The clips of a data set; their frames are read when they are written. Raises BadInput that names what is missing."""
    if not path.is_dir():
        raise BadInput(f"{path}: no such folder; give the folder that the data set was unpacked to")
    return importlib.import_module(f"gsac.pipeline.data_sets.{name}").read(path.resolve())
