"""The command `gsac`.

Only the module of the command that was typed is imported: a run with nothing to do must cost next to nothing.
"""

from __future__ import annotations

import argparse
import contextlib
import errno
import importlib
import json
import os
import signal
import sys
from typing import Any

from gsac.cache.errors import CacheError, CacheReadOnlyError, IntegrityError
from gsac.pipeline.outcomes import ExitCode
from gsac.stages.contract import BadInput, StageError

COMMANDS = {
    "run": "run a clip through the stages",
    "demo": "make a truth clip and run the whole job on it",
    "status": "what is up to date in the folder of a run",
    "explain": "what changed in the key of a stage",
    "stage": "run one stage, on a run's folder or on fixture artifacts",
    "batch": "run many clips over one cache",
    "cache": "list, check and clean the cache",
    "models": "list, pull and add model files",
    "bench": "run a benchmark",
    "view": "show an avatar in the browser",
    "render": "make a video of an avatar, moving or from all sides",
    "report": "write report.html of a run's folder",
}

PATH_ERRORS = (errno.EROFS, errno.EACCES, errno.EPERM, errno.ENOTDIR, errno.EISDIR, errno.EEXIST, errno.ENAMETOOLONG)
"""A path that the user gave cannot be what it has to be."""


def main(argv: list[str] | None = None) -> None:
    """Entry point; exits with an ExitCode."""
    sys.exit(int(execute(sys.argv[1:] if argv is None else argv)))


def execute(argv: list[str]) -> ExitCode:
    """Runs one command line; a user's mistake is one line on stderr, never a traceback."""
    with contextlib.suppress(ValueError):  # not in the main thread
        for how in (signal.SIGTERM, signal.SIGHUP):
            signal.signal(how, _interrupt)
    arguments = None
    try:
        arguments = _parser(argv).parse_args(argv)
        return arguments.do(arguments)
    except KeyboardInterrupt as error:
        return _give_up("interrupted; finished stages are kept", ExitCode.INTERRUPTED, arguments, error)
    except BrokenPipeError:  # whoever read the answer has gone: the rest goes nowhere, and quietly
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return ExitCode.INTERRUPTED
    except Exception as error:
        code = exit_code(error)
        if code is None:
            raise
        return _give_up(_words(error), code, arguments, error)


def exit_code(error: BaseException) -> ExitCode | None:
    """What an exception means to the shell; None for what nobody foresaw."""
    from gsac.pipeline.run import NotUpToDateError, StageFailedError

    if isinstance(error, StageFailedError):
        return exit_code(error.cause) or ExitCode.FAILED
    if isinstance(error, NotUpToDateError):
        return ExitCode.STALE
    if isinstance(error, (BadInput, CacheReadOnlyError)):
        return ExitCode.USAGE
    if isinstance(error, IntegrityError):
        return ExitCode.INTEGRITY
    if isinstance(error, (StageError, CacheError)):
        return ExitCode.FAILED
    if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
        return ExitCode.FAILED
    if isinstance(error, OSError) and error.errno in PATH_ERRORS:
        return ExitCode.USAGE
    return None


def emit(content: dict[str, Any]) -> None:
    """The one object of --json: the last line of stdout."""
    print(json.dumps(content), flush=True)


def _give_up(message: str, code: ExitCode, arguments: argparse.Namespace | None, error: BaseException) -> ExitCode:
    """Says why, with --json on stdout too; what was done before, a command leaves in the error's `summary`."""
    if getattr(arguments, "json", False):
        emit({"stages": [], "outputs": {}, "metrics": {}} | getattr(error, "summary", {}) | {"error": message})
    _complain(message)
    return code


def _parser(argv: list[str]) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gsac", description="One phone clip of a turning person in, an animatable Gaussian avatar out.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    typed = next((word for word in argv if not word.startswith("-")), None)
    for name, help_text in COMMANDS.items():
        command = commands.add_parser(name, help=help_text, description=help_text[0].upper() + help_text[1:] + ".")
        if name == typed:
            importlib.import_module(f"gsac.pipeline.commands.{name}").declare(command)
    return parser


def _words(error: Exception) -> str:
    if isinstance(error, OSError):
        what = {errno.ENOSPC: "no room left on the disk", errno.EDQUOT: "the disk quota is used up"}
        reason = what.get(error.errno, error.strerror)
        return f"{error.filename}: {reason}" if error.filename else str(reason)
    return str(error)


def _complain(message: str) -> None:
    print(f"gsac: {message}", file=sys.stderr, flush=True)


def _interrupt(signum: int, frame: Any) -> None:
    signal.signal(signum, signal.SIG_DFL)
    raise KeyboardInterrupt


if __name__ == "__main__":
    main()
