"""Claims of keys across machines: one of them computes a key, the others wait and fetch what it has made.

A claim is an object that is put where there is none, and put anew every BEAT_S while its owner lives. Who waits compares what it
reads with what it read before, by its own monotonic clock: clocks of machines are never compared. Losing a race, or an owner that
only seemed dead, costs work, never correctness: results are put where there is none.
"""

from __future__ import annotations

import contextlib
import json
import os
import platform
import threading
import time
from collections.abc import Callable

from gsac.cache.record import Record
from gsac.cache.remote.bucket import Bucket, RemoteError
from gsac.cache.remote.results import LEASES

EXPIRES_S = 120.0
"""A claim that did not change for so long is its owner's no more."""
BEAT_S = 30.0
POLL_S = 2.0
LONGEST_WAIT_S = 3600.0
"""Who has waited so long computes by itself."""
LARGEST = 4096


class Claim:
    """A key that this process computes; `release` it when its result is there, or will not be."""

    def __init__(self, bucket: Bucket, key: str) -> None:
        self.bucket, self.name = bucket, claim_name(key)
        self._owner = f"{platform.node()} {os.getpid()} {os.urandom(8).hex()}"
        self._beats = 0
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    def take(self) -> bool:
        """Whether nobody had claimed it, and it is this process's now."""
        if self.bucket.put_new(self.name, self._text()) or self._is_mine():  # an answer may be lost after the claim was put
            self._keep()
            return True
        return False

    def take_over(self, tag: str | None) -> bool:
        """Whether the claim of this tag, whose owner is gone, is this process's now."""
        if self.bucket.replace(self.name, self._text(), tag):
            self._keep()
            return True
        return False

    def release(self) -> None:
        """Ends the claim, if it is still this process's; one that cannot be removed expires."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join()
        with contextlib.suppress(RemoteError):
            if not (self.bucket.rests and self.bucket.silent) and self._is_mine():
                self.bucket.delete([self.name])

    def _keep(self) -> None:
        self._thread = threading.Thread(target=self._beat, daemon=True)
        self._thread.start()

    def _beat(self) -> None:
        while not self._ended.wait(BEAT_S):
            with contextlib.suppress(RemoteError):
                there = self.bucket.read(self.name, LARGEST)
                if there is None or not self._wrote(there.data):
                    return
                self._beats += 1
                self.bucket.replace(self.name, self._text(), there.tag)

    def _is_mine(self) -> bool:
        there = self.bucket.read(self.name, LARGEST)
        return there is not None and self._wrote(there.data)

    def _wrote(self, data: bytes) -> bool:
        with contextlib.suppress(ValueError, RecursionError):
            raw = json.loads(data)
            return isinstance(raw, dict) and raw.get("owner") == self._owner
        return False

    def _text(self) -> bytes:
        return json.dumps({"owner": self._owner, "beats": self._beats, "expires_s": EXPIRES_S}).encode()


def claim_name(key: str) -> str:
    """Where the claim of a key lies."""
    return f"{LEASES}/{key}.json"


def claim_or_fetch(
    bucket: Bucket, key: str, fetch: Callable[[], Record | None], waiting: Callable[[], None] = lambda: None,
) -> Claim | Record | None:
    """The shared record of a key, as `fetch` gives it, or a claim: then the caller computes it.

    waiting: called once if another machine holds the key. None after LONGEST_WAIT_S: the caller computes it all the same.
    Raises RemoteError.
    """
    claim = Claim(bucket, key)
    began = since = time.monotonic()
    before: bytes | None = None
    while True:
        record = fetch()
        if record is not None:
            return record
        there = bucket.read(claim.name, LARGEST)
        now = time.monotonic()
        if there is None:
            taken = claim.take()
        elif there.data != before:
            taken, before, since = False, there.data, now
        else:
            taken = now - since > EXPIRES_S and claim.take_over(there.tag)
        if taken:
            try:
                record = fetch()  # its last owner may have put it there meanwhile
            except BaseException:
                claim.release()
                raise
            if record is None:
                return claim
            claim.release()
            return record
        if there is not None:
            if now == since and before is not None:
                waiting()
                waiting = _nothing
            if now - began > LONGEST_WAIT_S:
                return None
            time.sleep(POLL_S)


def _nothing() -> None:
    pass
