"""The folder of the store, and the place that it shares with others."""

from __future__ import annotations

import os
from pathlib import Path

from gsac.cache.errors import CacheFolderError

REMOTE = "GSAC_REMOTE"
NOT_FOR_ALL = 0o775
"""Mode of a new store, less the umask: who may write to a store can put results into it."""


def default_root() -> Path:
    """$GSAC_CACHE, else ~/.cache/gsac. CacheFolderError where that names the home of nobody."""
    named = os.environ.get("GSAC_CACHE")
    try:
        return Path(named).expanduser().absolute() if named else Path.home() / ".cache" / "gsac"
    except RuntimeError as error:
        asked = f"GSAC_CACHE={named}" if named else "the cache belongs into the home folder"
        raise CacheFolderError(f"{asked}: there is no such home folder; set GSAC_CACHE to the full path of a folder") from error


def named_remote() -> str | None:
    """$GSAC_REMOTE, the place of the results that several machines share; None where nothing is shared."""
    return os.environ.get(REMOTE) or None


def make_root(root: Path) -> None:
    """Makes the folder of a store, which no umask opens to everybody."""
    if not root.is_dir():
        root.parent.mkdir(parents=True, exist_ok=True)
        root.mkdir(mode=NOT_FOR_ALL, exist_ok=True)
