"""What a stage reads where the user keeps it: it may be written, or replaced and put back, while it is read."""

from __future__ import annotations

from pathlib import Path

from gsac.cache.digest import tree_digest, tree_files
from gsac.cache.errors import CacheError
from gsac.cache.memo import identity
from gsac.cache.store import Store
from gsac.stages.contract import BadInput


class Source:
    """A file or folder as it was when its digest was taken."""

    def __init__(self, path: Path, store: Store):
        self.path, self._store = path, store
        self._stats = _stats(path)  # first: what is written while it is hashed has another stat at the end
        self.digest = source_digest(path, store)

    def is_untouched(self) -> bool:
        """Whether nobody has written or replaced it since. The content is compared as well: a file that was written a moment before
        may be written again within the clock's grain, and keep its stat."""
        return self._stats == _stats(self.path) and source_digest(self.path, self._store) == self.digest

    def look_again(self) -> None:
        """Takes what is there now for what is to be read. BadInput where its content is another."""
        self._stats = _stats(self.path)
        if source_digest(self.path, self._store) != self.digest:
            raise BadInput(f"{self.path} changed while it was being read; run again when it is complete")


def source_digest(path: Path, store: Store) -> str:
    """Tree digest of a file or folder of the user's. BadInput where it does not exist or cannot be read."""
    if not path.exists():
        raise BadInput(f"{path}: no such file or folder; give a video or a folder of photos")
    try:
        return tree_digest(path, store.memo)[0]
    except OSError as e:
        raise BadInput(f"{path}: cannot be read ({e.strerror})") from e
    except CacheError as e:
        raise BadInput(f"the clip cannot be read: {e}; take it out of the folder") from e


def _stats(path: Path) -> dict[str, tuple[int, ...]] | None:
    """Relative name -> what identifies a file, and whether it was put there anew; None where it cannot be seen."""
    try:
        return {name: identity(file.stat()) for name, file in tree_files(path).items()}
    except (OSError, CacheError):
        return None
