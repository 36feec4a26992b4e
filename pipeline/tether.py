"""Ends a process, and those that it has started, as soon as the one that started it has ended, however that came.

`python -m gsac.pipeline.tether MODULE ARGUMENTS` runs a module so. The starter holds the other end of its stdin and has given it
a process group of its own.
"""

from __future__ import annotations

import contextlib
import os
import runpy
import select
import signal
import subprocess
import sys
from collections.abc import Iterator
from typing import Any


def tether(*inherited: int) -> None:
    """Leaves behind a process that kills this one's group once stdin has no writer any more.

    inherited: descriptors whose end somebody waits for, which that process gives up. To be called before there are threads: a
    process of its own sees the end at once, whatever keeps this one busy.
    """
    group = os.getpgid(0)
    if os.fork():
        return
    try:
        for how in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(how, signal.SIG_IGN)  # the group's end is its own too
        for descriptor in (1, 2, *inherited):
            os.close(descriptor)
        closed = select.poll()
        closed.register(0, 0)  # no event but the one that cannot be left out: all writers are gone
        while not closed.poll():
            pass
        os.killpg(group, signal.SIGKILL)
    finally:
        os._exit(0)


@contextlib.contextmanager
def tethered(module: str, *arguments: str, **options: Any) -> Iterator[subprocess.Popen]:
    """`python -m MODULE ARGUMENTS`, which ends with this process. Leaving the context kills it. options: as of Popen."""
    command = [sys.executable, "-P", "-m", "gsac.pipeline.tether", module, *arguments]
    with subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True, **options) as process:
        try:
            yield process
        finally:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)


if __name__ == "__main__":
    tether()
    sys.argv = sys.argv[1:]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
