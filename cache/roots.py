"""Roots: folders that show results as links into the store. gc keeps what a root shows; a root whose folder is gone drops out.

roots/<digest of the path>     holds the folder's path
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
from dataclasses import dataclass
from pathlib import Path

from gsac.cache.errors import CacheError
from gsac.cache.store import Store

OBJECT = re.compile(r"/objects/([0-9a-f]{2})/(\1[0-9a-f]{62}(?:\.[^/]+)?)$")


@dataclass(frozen=True)
class Root:
    """One folder and the objects that it shows."""

    folder: Path
    links: dict[str, str]
    """Relative path of a link -> name of its object."""


def register(store: Store, folder: Path) -> None:
    """Makes a folder a root; does nothing where it is one, or where the store may only be read."""
    path = os.fsencode(folder.absolute())
    file = store.root / "roots" / hashlib.sha256(path).hexdigest()
    if file.exists():
        return
    with contextlib.suppress(OSError, CacheError), store.private("root") as folder:
        (folder / file.name).write_bytes(path)
        os.replace(folder / file.name, file)


def find_roots(store: Store) -> list[Root]:
    """All roots whose folder is there, in the order of their paths."""
    folders = [Path(os.fsdecode(file.read_bytes())) for file in _files(store)]
    return [Root(folder, find_links(folder)) for folder in sorted(folders) if folder.is_dir()]


def gone(store: Store) -> list[Path]:
    """Files of the roots whose folder is gone, not of those that another user may not look into."""
    return [file for file in _files(store) if _is_gone(file.read_bytes())]


def find_links(folder: Path) -> dict[str, str]:
    """Relative path -> object's name, of the links below a folder; links are not followed, hidden folders left out."""
    links = {}
    folders = [(str(folder), "")]
    while folders:
        path, prefix = folders.pop()
        with contextlib.suppress(OSError), os.scandir(path) as entries:
            for entry in entries:
                if entry.is_symlink():
                    name = object_of(Path(entry.path))
                    if name is not None:
                        links[prefix + entry.name] = name
                elif entry.is_dir(follow_symlinks=False) and not entry.name.startswith("."):
                    folders.append((entry.path, f"{prefix}{entry.name}/"))
    return dict(sorted(links.items()))


def object_of(path: Path) -> str | None:
    """Name of the object of some store that a link leads to, be it there or gone; None for anything else."""
    found = OBJECT.search(os.readlink(path)) if path.is_symlink() else None
    return found[2] if found else None


def is_object(path: Path) -> bool:
    """Whether a path is that of an object of some store."""
    return OBJECT.search(str(path)) is not None


def _is_gone(folder: bytes) -> bool:
    try:
        os.stat(folder)
    except (FileNotFoundError, NotADirectoryError):
        return True
    except OSError:
        return False
    return False


def _files(store: Store) -> list[Path]:
    folder = store.root / "roots"
    return [file for file in folder.iterdir() if not file.suffix and file.is_file()] if folder.is_dir() else []
