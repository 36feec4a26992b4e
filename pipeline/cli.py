"""The command `gsac`.

Only the module of the command that was typed is imported: a run with nothing to do must cost next to nothing.
"""

from __future__ import annotations

import argparse
import io
import os
import sys
from functools import partial
from typing import Any

from gsac.pipeline import commands
from gsac.pipeline.command_parser import CommandParser
from gsac.pipeline.errors import attached_summary, exit_code, sentence
from gsac.pipeline.interrupts import interrupts_heard
from gsac.pipeline.json_output import emit
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.reporter import Verbosity
from gsac.pipeline.versions import package_version
from gsac.pipeline.wrapping import fit

RUNNING = ("run", "demo", "batch", "stage", "bench")
"""Commands that run stages."""


def main(argv: list[str] | None = None) -> None:
    """Entry point; exits with an ExitCode."""
    open_closed_streams()
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="surrogateescape")  # a path whose bytes are not text is told by those bytes
    sys.exit(int(execute(sys.argv[1:] if argv is None else argv)))


def open_closed_streams() -> None:
    """Each standard stream that was closed leads to nowhere; else the next file opened would get its descriptor and its words."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            descriptor = os.open(os.devnull, os.O_RDWR)  # the lowest free one, which is the stream's own
            os.set_inheritable(descriptor, True)
            setattr(sys, name, os.fdopen(descriptor, mode))


def execute(argv: list[str]) -> ExitCode:
    """Runs one command line; a user's mistake is one line on stderr, never a traceback."""
    with interrupts_heard():
        return _execute(argv)


def _execute(argv: list[str]) -> ExitCode:
    arguments = None
    try:
        arguments = make_parser(argv).parse_args(argv)
        return arguments.do(arguments)
    except KeyboardInterrupt as error:
        goes_on = "; finished stages are kept, and the same command goes on from there"
        said = f"interrupted{goes_on if getattr(arguments, 'command', '') in RUNNING else ''}"
        return _give_up(said, ExitCode.INTERRUPTED, arguments, error)
    except BrokenPipeError:  # the reader of the answer has gone: the rest is dropped
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return ExitCode.INTERRUPTED
    except Exception as error:
        code = exit_code(error)
        if code is None:
            raise
        return _give_up(sentence(error), code, arguments, error)


def make_parser(argv: list[str]) -> argparse.ArgumentParser:
    """The parser of this command line: all commands by name, and the arguments of the one that was typed."""
    parser = CommandParser(
        prog="gsac", description="One phone clip of a turning person in, an animatable Gaussian avatar out.")
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    _add_verbosity(parser, default=Verbosity.NORMAL)
    parser.set_defaults(do=partial(_print_help, parser))
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND")
    typed = next((word for word in argv if not word.startswith("-")), None)
    added = {} if typed in commands.COMMANDS else commands.load_added()
    if typed is not None and typed not in commands.COMMANDS and typed not in added:
        raise commands.unknown_command(typed, added)
    helps = commands.COMMANDS | {name: module.HELP for name, module in added.items()}
    if typed is None:
        helps |= dict.fromkeys(commands.not_installed(added), commands.SETUP)
    for name, help_text in helps.items():
        command = subparsers.add_parser(name, help=help_text, description=help_text[0].upper() + help_text[1:] + ".")
        if name == typed:
            _add_verbosity(command)
            (added.get(name) or commands.load(name)).declare(command)
    return parser


def _add_verbosity(parser: argparse.ArgumentParser, default: Any = argparse.SUPPRESS) -> None:
    """-q and -v, which stand before the command's name or after it."""
    both = parser.add_mutually_exclusive_group()
    for letter, verbosity in (("q", Verbosity.QUIET), ("v", Verbosity.VERBOSE)):
        both.add_argument(f"-{letter}", f"--{verbosity.value}", dest="verbosity", action="store_const", const=verbosity,
                          default=default, help=verbosity.sentence)


class _Version(argparse.Action):
    """Reads the version only when it is asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *parsed: Any) -> None:
        print(f"gsac {package_version('gsac')}")
        parser.exit()


def _print_help(parser: argparse.ArgumentParser, arguments: argparse.Namespace) -> ExitCode:
    """The answer to `gsac` alone."""
    parser.print_help(sys.stderr)
    return ExitCode.USAGE


def _give_up(message: str, code: ExitCode, arguments: argparse.Namespace | None, error: BaseException) -> ExitCode:
    """Prints the message, with --json also an object on stdout that holds what the command had done before the error."""
    if getattr(arguments, "json", False):
        emit({"stages": [], "outputs": {}, "metrics": {}} | attached_summary(error) | {"error": message})
    print(fit(f"gsac: {message}", sys.stderr), file=sys.stderr, flush=True)
    return code


if __name__ == "__main__":
    main()
