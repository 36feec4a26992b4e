"""Coarser levels of detail in the making: whoever goes through them has each as soon as it is there."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future
from itertools import count

from gsac.avatar.gaussians import Gaussians


class Coarser:
    """Levels, the finest of them first. Several threads may go through them, each of them waits for the next level."""

    def __init__(self) -> None:
        self._coming: list[Future[Gaussians | None]] = [Future()]
        """Those that are there, then the next one, which is None where there is none."""

    @classmethod
    def none(cls) -> Coarser:
        """Of an avatar without levels."""
        empty = cls()
        empty.end()
        return empty

    def add(self, level: Gaussians) -> None:
        """The next one."""
        self._coming.append(Future())
        self._coming[-2].set_result(level)

    def end(self, error: BaseException | None = None) -> None:
        """That was the last one; or no more can be made, which all who wait for one shall learn."""
        if error is None:
            self._coming[-1].set_result(None)
        else:
            self._coming[-1].set_exception(error)

    def __iter__(self) -> Iterator[Gaussians]:
        for k in count():
            level = self._coming[k].result()
            if level is None:
                return
            yield level
