"""Arguments that several commands share."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from gsac.cache.store import Store
from gsac.pipeline.params import resolve
from gsac.pipeline.project import Project
from gsac.pipeline.reporter import PlainReporter
from gsac.pipeline.run_folder import OWN_STORE, RunFolder


def add_params(command: argparse.ArgumentParser) -> None:
    command.add_argument("--params", type=Path, metavar="FILE", help="YAML file with sections of parameters")
    command.add_argument("--set", action="append", default=[], metavar="stage.key=value",
                         help="one parameter; may be repeated")


def add_json(command: argparse.ArgumentParser) -> None:
    command.add_argument("--json", action="store_true", help="one JSON object as the last line of stdout")


def add_workspace(command: argparse.ArgumentParser) -> None:
    command.add_argument("folder", nargs="?", type=Path, default=Path("."), help="the folder of a run (default: here)")


def answers(arguments: argparse.Namespace) -> PlainReporter:
    """What was asked for goes to stdout, unless --json has it."""
    return PlainReporter(sys.stderr if arguments.json else sys.stdout)


def open_store(reporter: PlainReporter, instead: Path | None = None) -> Store:
    """The store of GSAC_CACHE, which says aloud what it finds damaged.

    Where it may only be read, results of this run go to `instead`, and what it holds is still used.
    """
    store = Store.open(say=reporter.note)
    if instead is None or store.writable:
        return store
    reporter.note(f"gsac: warning: the cache {store.root} cannot be written; this run keeps its results in {instead}")
    return Store(instead, say=reporter.note, below=store)


def open_store_of(workspace: RunFolder, reporter: PlainReporter) -> Store:
    """The store that a run in this folder would use now: its own where the cache may only be read."""
    store, own = Store.open(say=reporter.note), workspace.root / OWN_STORE
    return store if store.writable or not own.is_dir() else Store(own, say=reporter.note, below=store)


def open_workspace(
    arguments: argparse.Namespace, start: Path, only: str = ""
) -> tuple[RunFolder, Project, dict[str, Any]]:
    """The folder of a run, its stages, and its parameters (of `only` one stage) with --params and --set on top."""
    workspace = RunFolder.around(start)
    project = workspace.project(Project.at_hand())
    file = getattr(arguments, "params", None) or workspace.params
    return workspace, project, resolve(project, file, arguments.set, only)
