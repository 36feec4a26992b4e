"""What a run shares with other machines, where GSAC_REMOTE names a place: it fetches what is there and uploads what it makes.

The place may be away, slow or full: the run then goes on alone, says so once, and what it could not upload can be pushed later.
"""

from __future__ import annotations

import contextlib
import functools
import queue
import threading
from collections.abc import Callable, Collection, Iterator
from typing import TYPE_CHECKING, TypeVar

from gsac.cache.errors import CacheError
from gsac.cache.key import KeyParts
from gsac.cache.lease import single_flight
from gsac.cache.record import Record
from gsac.cache.root import named_remote
from gsac.cache.store import Store
from gsac.pipeline.reporter import Speaker

if TYPE_CHECKING:
    from gsac.cache.remote.claim import Claim
    from gsac.cache.remote.results import Results

Answer = TypeVar("Answer")
PATIENCE_S = 0.5
"""A wait for uploads that takes longer is said."""


@functools.cache
def results_at(url: str) -> Results:
    """The shared results at a place, with what this process knows of them. CacheSetupError where it cannot be one."""
    from gsac.cache.remote.bucket import Bucket  # only where a run shares: it costs time to load
    from gsac.cache.remote.results import Results

    return Results(Bucket(url))


def shared_results() -> Results | None:
    """Those that GSAC_REMOTE names; None where it is not set."""
    url = named_remote()
    return results_at(url) if url else None


@contextlib.contextmanager
def sharing(store: Store, say: Speaker) -> Iterator[Sharing | None]:
    """None where nothing is shared. At the end the last uploads are waited for, unless the run was interrupted."""
    results = shared_results()
    if results is None:
        yield None
        return
    shares = Sharing(results, store, say)
    try:
        yield shares
    except KeyboardInterrupt:
        shares.abandon()
        raise
    except BaseException:
        shares.finish()
        raise
    shares.finish()


class Sharing:
    """One run's dealings with the shared results. `say` is spoken to by the run's own thread alone."""

    def __init__(self, results: Results, store: Store, say: Speaker) -> None:
        self.results, self.store, self.say = results, store, say
        self._due: queue.SimpleQueue[tuple[Record, Claim | None] | None] = queue.SimpleQueue()
        self._claims: dict[str, Claim] = {}
        """Key -> claim, of what this run computes now."""
        self._missed: list[str] = []
        """Stages whose result could not be uploaded."""
        self._error = ""
        """The first of the uploader's errors."""
        self._stopped = False
        self._uploader: threading.Thread | None = None

    def fetch(self, parts: KeyParts, outputs: Collection[str], waiting: Callable[[], None]) -> Record | None:
        """The shared result of a key that is not here, put into the store; None where there is none to be had now.

        waiting: called once if another run here is at work on the key.
        """
        with single_flight(self.store, parts.key, waiting, outputs) as there:
            return there or self._try(lambda: self._fetch(parts, outputs))

    @contextlib.contextmanager
    def claimed(self, parts: KeyParts, outputs: Collection[str]) -> Iterator[Record | None]:
        """The shared result of a key that is not here; None: the caller computes it, while other machines wait for its upload."""
        from gsac.cache.remote.claim import claim_or_fetch

        def waiting() -> None:
            self.say.note(f"{parts.stage}: another machine computes the same result; waiting for it")

        found = self._try(lambda: claim_or_fetch(self.results.bucket, parts.key, lambda: self._fetch(parts, outputs), waiting))
        if found is None or isinstance(found, Record):
            yield found
            return
        self._claims[parts.key] = found
        try:
            yield None
        finally:
            unused = self._claims.pop(parts.key, None)
            if unused is not None:
                unused.release()

    def upload(self, record: Record) -> None:
        """Uploads a result while the run goes on, then gives its claim back."""
        if self._uploader is None:
            self._uploader = threading.Thread(target=self._work, daemon=True)
            self._uploader.start()
        self._due.put((record, self._claims.pop(record.key, None)))

    def finish(self) -> None:
        """Waits for the uploads, and says what could not be uploaded."""
        if self._uploader is not None:
            self._due.put(None)
            self._uploader.join(PATIENCE_S)
            if self._uploader.is_alive():
                self.say.note(f"uploading results to {self.results.bucket.url}")
                self._uploader.join()
        if self._missed:
            why = f" ({self._error})" if self._error else ""
            self.say.note(f"gsac: warning: not uploaded: {', '.join(self._missed)}{why}; `gsac cache push` does it later")

    def abandon(self) -> None:
        """Leaves off; what was not uploaded stays here."""
        self._stopped = True

    def _fetch(self, parts: KeyParts, outputs: Collection[str]) -> Record | None:
        record = self.results.fetch(self.store, parts.stage, parts.key, outputs)
        if record is not None:
            self.say.note(f"{parts.stage}: fetched from {self.results.bucket.url}")
        return record

    def _try(self, ask: Callable[[], Answer]) -> Answer | None:
        """What the shared place answers; None while it fails, which is said once a process."""
        from gsac.cache.remote.bucket import RemoteError

        bucket = self.results.bucket
        if bucket.rests:
            return None
        try:
            return ask()
        except RemoteError as error:
            bucket.fails(error)
            if not bucket.said_failing:
                bucket.said_failing = True
                self.say.note(f"gsac: warning: {error}; the run goes on without it")
            return None

    def _work(self) -> None:
        while (due := self._due.get()) is not None and not self._stopped:
            record, claim = due
            try:
                self._upload(record)
            finally:
                if claim is not None:
                    claim.release()

    def _upload(self, record: Record) -> None:
        from gsac.cache.remote.bucket import RemoteError

        bucket = self.results.bucket
        try:
            if not bucket.rests:
                self.results.push(self.store, record)
                return
        except (CacheError, OSError) as error:
            if isinstance(error, RemoteError):
                bucket.fails(error)
            self._error = self._error or str(error)
        self._missed.append(record.parts.stage)
