"""Errors that end a command: the sentence and the exit code of each."""

from __future__ import annotations

import errno
import os
import sysconfig
from pathlib import Path
from typing import Any

from gsac.cache.errors import CacheError, CacheFolderError, CacheReadOnlyError, CacheSetupError, IntegrityError
from gsac.pipeline.outcomes import ExitCode
from gsac.stages.contract import BadInput, StageError

PATH_ERRORS = (errno.EROFS, errno.EACCES, errno.EPERM, errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.EEXIST, errno.ENAMETOOLONG,
               errno.ELOOP, errno.EINVAL, errno.ENODEV, errno.ENXIO, errno.EOPNOTSUPP)
"""errno of a path from the user that cannot be read or written as it should."""
NO_FOLDER = "the folder in which you are is gone; change to one that is there"
NO_ROOM = {errno.ENOSPC: "no room left on the disk", errno.EDQUOT: "the disk quota is used up",
           errno.EFBIG: "the largest size of a file is reached (`ulimit -f`, or the disk's own)"}


class NotUpToDateError(Exception):
    """Something that should be there already is not (exit code 3)."""


class StageFailedError(Exception):
    """A stage failed with the error `cause`; stages that were finished before it are kept."""

    def __init__(self, stage: str, cause: Exception, log: Path):
        told = isinstance(cause, BadInput)  # the sentence says all
        seen = f" (log: {log})" if not told and log.is_file() and log.stat().st_size else ""
        super().__init__(f"stage {stage} failed: {cause}{seen}")
        self.stage = stage
        self.cause = cause


def attach_summary(error: BaseException, summary: dict[str, Any]) -> None:
    """Adds to an error the object of --json on the stages before it."""
    vars(error)["summary"] = summary


def attached_summary(error: BaseException) -> dict[str, Any]:
    """The object that `attach_summary` added, {} without one."""
    return vars(error).get("summary", {})


def exit_code(error: BaseException) -> ExitCode | None:
    """The exit code for an exception; None for a bug of ours."""
    if isinstance(error, StageFailedError):
        return exit_code(error.cause) or ExitCode.FAILED
    if isinstance(error, NotUpToDateError):
        return ExitCode.STALE
    if isinstance(error, (BadInput, CacheFolderError, CacheReadOnlyError, CacheSetupError)):
        return ExitCode.USAGE
    if isinstance(error, IntegrityError):
        return ExitCode.INTEGRITY
    if isinstance(error, (StageError, CacheError)):
        return ExitCode.FAILED
    if isinstance(error, OSError) and error.errno in NO_ROOM:
        return ExitCode.FAILED
    if isinstance(error, OSError) and error.errno in PATH_ERRORS and not _is_of_the_program(error.filename):
        return ExitCode.USAGE
    return None


def _is_of_the_program(path: Any) -> bool:
    """Whether a path lies in gsac's own code, or in that of Python and its packages: no fault of the user's."""
    if not isinstance(path, (str, os.PathLike)):
        return False
    packages = [marked.parent for marked in Path(__file__).resolve().parents[1].glob("*/__init__.py")]
    homes = [*packages, *(Path(sysconfig.get_path(name)) for name in ("stdlib", "purelib", "platlib"))]
    return any(Path(path).resolve().is_relative_to(home) for home in homes)


def ending(error: BaseException) -> tuple[ExitCode, str]:
    """Exit code and sentence of what ended a clip's run; a bug of ours names itself."""
    if isinstance(error, KeyboardInterrupt):
        return ExitCode.INTERRUPTED, "interrupted"
    code = exit_code(error)
    if code is None or not isinstance(error, Exception):
        return ExitCode.FAILED, f"{type(error).__name__}: {error}"
    return code, sentence(error)


def sentence(error: Exception) -> str:
    """The line that the user reads."""
    if isinstance(error, OSError):
        if error.errno == errno.ENOENT and not error.filename:
            return NO_FOLDER  # only the current folder is asked for without a name
        reason = NO_ROOM.get(error.errno or 0, error.strerror)
        return f"{error.filename}: {reason}" if error.filename else str(reason)
    return str(error)
