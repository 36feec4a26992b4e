"""Names a process so that another can tell whether it has died, where the file system refuses locks."""

from __future__ import annotations

import os
import platform
from pathlib import Path

PROC = Path("/proc")


def this_process() -> str:
    """Host, boot, name space, number and start of this process; empty where the system has no /proc."""
    try:
        return " ".join((*_here(), str(os.getpid()), _started(os.getpid())))
    except OSError:
        return ""


def is_dead(owner: str) -> bool:
    """Whether the process that `this_process` named is gone for sure; False for one of another machine or container."""
    try:
        host, boot, space, number, started = owner.split()
        here = _here()
    except (OSError, ValueError):
        return False
    if host != here[0]:
        return False
    if boot != here[1]:
        return True
    return space == here[2] and (not number.isdecimal() or _start_or_none(int(number)) != started)


def _here() -> tuple[str, str, str]:
    boot = (PROC / "sys" / "kernel" / "random" / "boot_id").read_text().strip()
    return platform.node() or "-", boot, os.readlink(PROC / "self" / "ns" / "pid")


def _started(number: int) -> str:
    """Clock ticks from the machine's boot to the process's start. ProcessLookupError for one that waits to be buried."""
    state, *fields = (PROC / str(number) / "stat").read_text().rsplit(")", 1)[1].split()
    if state in ("Z", "X"):
        raise ProcessLookupError(number)
    return fields[18]


def _start_or_none(number: int) -> str | None:
    try:
        return _started(number)
    except OSError:
        return None
