"""Memory of this machine, shared out among clips that run at once."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Iterator

SHARE = 0.8
"""Of the machine's memory that a batch may fill."""


def machine_mb() -> float:
    """Memory of this machine."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**20


class Memory:
    """So many MB; who wants more than is free waits, and who wants more than there is gets all."""

    def __init__(self, limit_mb: float):
        self.limit_mb = limit_mb
        self._free = limit_mb
        self._changed = threading.Condition()
        self._ended = False

    @contextlib.contextmanager
    def take(self, wanted_mb: float) -> Iterator[bool]:
        """Holds memory for a while; False where the batch ended while it waited."""
        share = min(wanted_mb, self.limit_mb)
        with self._changed:
            self._changed.wait_for(lambda: self._ended or self._free >= share)
            ended = self._ended
            self._free -= share
        try:
            yield not ended
        finally:
            with self._changed:
                self._free += share
                self._changed.notify_all()

    def end(self) -> None:
        """Nobody waits any more."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()
