"""gsac events: what the runs or the batch in a folder have told."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from gsac.pipeline.event_file import follow_events, read_events, require_events
from gsac.pipeline.events import BatchEnded, ClipEnded, Event, StageLine, StageProgress
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.reporter import Verbosity, words_of


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("folder", nargs="?", type=Path, default=Path("."), metavar="DIR",
                         help="the folder of a run or of a batch (default: here)")
    command.add_argument("--follow", action="store_true", help="go on until the run or batch has ended")
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    folder = arguments.folder.absolute()
    require_events(folder)
    events = follow_events(folder, is_end) if arguments.follow else read_events(folder)
    for event in events:
        if arguments.verbosity is Verbosity.VERBOSE or arguments.follow or not isinstance(event, (StageLine, StageProgress)):
            print(line_of(event), flush=arguments.follow)
    return ExitCode.OK


def is_end(event: Event) -> bool:
    """Whether a run, or a batch, ends with it."""
    return isinstance(event, BatchEnded) or (isinstance(event, ClipEnded) and not event.batch)


def line_of(event: Event) -> str:
    """`2026-11-23 21:05:10 clip.mp4: 7/8 train: starts (first run)`"""
    when = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(event.time))
    clip = f"{event.clip}{f' (run {event.attempt})' if event.attempt > 1 else ''}: " if event.clip else ""
    return f"{when} {clip}{words_of(event)}"
