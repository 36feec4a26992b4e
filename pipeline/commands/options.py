"""Arguments that several commands share."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gsac.cache.errors import CacheFolderError
from gsac.cache.gc import sweep_store
from gsac.cache.half_made import sweep, temporary_folder
from gsac.cache.store import Store
from gsac.pipeline.keys import BODY
from gsac.pipeline.params import Values, resolve
from gsac.pipeline.project import Project
from gsac.pipeline.quality import QUALITIES, STANDARD
from gsac.pipeline.reporter import PlainReporter, Speaker, open_reporter
from gsac.pipeline.rows import stale_reasons
from gsac.pipeline.run import ClipRun
from gsac.pipeline.run_folder import OWN_STORE, RunFolder
from gsac.stages.contract import BadInput

if TYPE_CHECKING:
    from gsac.pipeline.journal import Journal


def add_clip(command: argparse.ArgumentParser) -> None:
    command.add_argument("clip", nargs="?", type=Path, metavar="CLIP",
                         help="a video, or a folder of photos; masks/ beside either in a folder (default: the clip of the run "
                              "whose folder this is)")


def add_params(command: argparse.ArgumentParser) -> None:
    command.add_argument("--params", type=Path, metavar="FILE", help="YAML file with sections of parameters")
    command.add_argument("--set", action="append", default=[], metavar="stage.key=value",
                         help="one parameter; may be repeated")


def add_quality(command: argparse.ArgumentParser) -> None:
    command.add_argument("--quality", default=STANDARD, metavar="NAME",
                         help=f"{', '.join(QUALITIES)}: how good, and how long it takes (default: {STANDARD})")


def add_person(command: argparse.ArgumentParser) -> None:
    command.add_argument("--height", type=float, metavar="M",
                         help="how tall the person is, metres; fixes the scale, which one camera cannot see (smplx.height_m)")
    command.add_argument("--body", metavar="NAME",
                         help="body model of all stages: open, or a name that `gsac models add` was given (body_model)")


def values_of_person(arguments: argparse.Namespace, project: Project) -> dict[str, Values]:
    """Parameters by the option of `add_person` that gave them."""
    given: dict[str, Values] = {}
    if arguments.height is not None:
        given[f"--height {arguments.height:g}"] = {"smplx": {"height_m": arguments.height}}
    if arguments.body is not None:
        stages = [name for name in project.graph.steps if hasattr(project.stage(name).config(), BODY)]
        given[f"--body {arguments.body}"] = {name: {BODY: arguments.body} for name in stages}
    return given


def add_json(command: argparse.ArgumentParser) -> None:
    command.add_argument("--json", action="store_true", help="one JSON object as the last line of stdout")


def add_force(command: argparse.ArgumentParser) -> None:
    command.add_argument("--force", action="store_true", help="write over a file that is there already")


def require_free(file: Path, force: bool) -> None:
    """BadInput where a file would be written over without --force, where a folder is in its place, or where none can be written."""
    if file.is_dir():
        raise BadInput(f"{file} is a folder; give the name of a file")
    if os.path.lexists(file) and not force:
        raise BadInput(f"{file} is there already; give another --out, or --force to write over it")
    if not os.access(file.parent, os.W_OK):
        raise BadInput(f"{file.parent} may not be written into; give another --out")


def warn_stale(run_folder: RunFolder, say: Speaker, only: str = "") -> None:
    """Warns of results in the folder, of `only` one stage, that are not up to date: files made of them may not agree."""
    for name, why in stale_reasons(run_folder).items():
        if only in ("", name):
            say.note(f"gsac: warning: {run_folder.root}: {name} is not up to date ({why})")


def add_run_folder(command: argparse.ArgumentParser) -> None:
    command.add_argument("folder", nargs="?", type=Path, default=Path("."), metavar="DIR",
                         help="the folder of a run (default: here)")


def progress_reporter(arguments: argparse.Namespace) -> PlainReporter:
    """Of a command that does something, on stderr."""
    return open_reporter(arguments.verbosity, plain=getattr(arguments, "json", False) or getattr(arguments, "events", False))


def add_events(command: argparse.ArgumentParser) -> None:
    command.add_argument("--events", action="store_true",
                         help="each event as a JSON line on stdout, as it happens, before the result (docs/events.md)")


@contextlib.contextmanager
def open_journal(arguments: argparse.Namespace, reporter: PlainReporter, of_batch: bool = False) -> Iterator[Journal]:
    """Of a command that runs clips: the reporter hears it, stdout with --events, and the place that OTEL_* names."""
    from gsac.pipeline.journal import Journal, print_event
    from gsac.pipeline.tracing import traced

    printers = [print_event] if getattr(arguments, "events", False) else []
    journal = Journal(reporter.take, *printers, of_batch=of_batch)
    with traced(journal):
        yield journal


def answer_reporter(arguments: argparse.Namespace) -> PlainReporter:
    """Of a command that answers a question: on stdout, or on stderr where --json has stdout."""
    if arguments.json:
        return open_reporter(arguments.verbosity, plain=True)
    return PlainReporter(sys.stdout)


def open_store(say: Speaker) -> Store:
    """The store of GSAC_CACHE; it reports what it finds damaged. What killed processes left in it and in the system's folder of
    temporary files is removed."""
    store = Store.open(say=say.note)
    sweep_store(store)
    sweep(temporary_folder())
    return store


def find_store(reporter: PlainReporter) -> Store:
    """The store of GSAC_CACHE as it is, of which nothing is made. CacheFolderError where a file is in its place."""
    store = Store.open(say=reporter.note, make=False)
    if store.root.exists() and not store.root.is_dir():
        raise CacheFolderError(f"{store.root} is a file; set GSAC_CACHE to the folder of a cache")
    return store


def open_store_of(run_folder: RunFolder, reporter: PlainReporter) -> Store:
    """The store that a run in this folder would use now: its own where the cache may only be read."""
    store, own = Store.open(say=reporter.note), run_folder.root / OWN_STORE
    return store if store.writable or not own.is_dir() else Store(own, say=reporter.note, below=store)


def open_run_folder(
    arguments: argparse.Namespace, start: Path, only: str = ""
) -> tuple[RunFolder, Project, dict[str, Any]]:
    """The folder of a run, its stages, and its parameters (of `only` one stage) with --params and --set on top."""
    run_folder = RunFolder.around(start)
    project = run_folder.project(Project.at_hand())
    file = getattr(arguments, "params", None) or run_folder.params
    return run_folder, project, resolve(project, file, arguments.set, only)


def open_clip_run(arguments: argparse.Namespace, reporter: PlainReporter) -> ClipRun:
    """The run in `arguments.folder` as it would go now; nothing runs."""
    folder, project, configs = open_run_folder(arguments, arguments.folder)
    return ClipRun(project, configs, open_store_of(folder, reporter), folder)
