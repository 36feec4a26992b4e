"""Claims of running processes: one run at a time computes a key, and gc spares what a run in progress uses."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Collection, Iterable, Iterator

from gsac.cache.errors import CacheReadOnlyError, from_os_error
from gsac.cache.lock import exclusive, if_free, shared, without_locks
from gsac.cache.record import Record
from gsac.cache.store import Store


@contextlib.contextmanager
def single_flight(
    store: Store, key: str, waiting: Callable[[], None] = lambda: None, outputs: Collection[str] | None = None,
) -> Iterator[Record | None]:
    """Locks the key and gives the record published under it by then; None: the caller computes it.

    outputs: those that the stage declares, as `Store.lookup` takes them.
    `waiting` is called once if another run holds the key. Should that run die, the next one gets the key at once.
    A read-only store cannot be locked: every run then computes for itself.
    """
    with contextlib.ExitStack() as held:
        with contextlib.suppress(CacheReadOnlyError):
            try:
                held.enter_context(exclusive(store.root / "leases" / f"{key}.lock", waiting))
            except OSError as error:
                raise from_os_error(error, store.root) from error
        yield store.lookup(key, outputs)


class Lease:
    """What a run in progress uses, by key or by object; `add` it before looking it up."""

    def __init__(self, store: Store, descriptor: int | None) -> None:
        self._store, self._descriptor = store, descriptor

    def add(self, *names: str) -> None:
        """Keeps gc from removing the results of these keys and the objects of these names."""
        if self._descriptor is not None:
            with shared(self._store.root / "lock"):  # not while gc sweeps
                os.write(self._descriptor, "".join(f"{name}\n" for name in names).encode())


@contextlib.contextmanager
def in_use(store: Store, names: Iterable[str] = ()) -> Iterator[Lease]:
    """While open, gc keeps the records and outputs of these keys, the objects of these names, and those added later."""
    file = store.root / "leases" / f"{os.getpid()}-{os.urandom(6).hex()}.run"
    with contextlib.ExitStack() as held:
        try:
            lease = Lease(store, held.enter_context(exclusive(file)))
            if file.parent in without_locks:
                store.say(f"gsac: warning: the file system of the cache {store.root} has no locks: processes of this machine keep "
                          "clear of each other, but `gsac cache gc` does not see runs on other machines")
        except OSError:
            lease = Lease(store, None)  # read-only: gc cannot run on it either
        lease.add(*names)
        yield lease


def live_names(store: Store) -> set[str]:
    """Keys that living runs use or compute, and names of objects that they read; the leases of dead runs are removed."""
    names: set[str] = set()
    for file in (store.root / "leases").glob("[!.]*"):
        with if_free(file) as free, contextlib.suppress(OSError):
            if free:
                file.unlink()
            elif file.suffix == ".run":
                names.update(file.read_text().split())
            else:
                names.add(file.stem)
    return names
