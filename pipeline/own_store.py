"""Where the results of a run lie whose cache may only be read."""

from __future__ import annotations

from pathlib import Path

from gsac.cache.store import Store
from gsac.pipeline.reporter import Speaker


def writable_store(store: Store, instead: Path, say: Speaker) -> Store:
    """The store; where it may only be read one at `instead`, which gets the results of this run and still uses what it holds.

    To be called when nothing of the user's can be at fault any more, since it makes a folder.
    """
    if store.writable:
        return store
    say.note(f"gsac: warning: the cache {store.root} cannot be written; this run keeps its results in {instead}")
    return Store(instead, say=say.note, below=store)
