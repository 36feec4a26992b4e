"""The commands of `gsac`, one module each: `declare(parser)` adds its arguments, and `do`, which runs it.

Commands of packages above this one are found by the entry point group `gsac.commands`; such a module also has `HELP`. Entry points
are slow to read: they are only asked for where no command of this package was typed.
"""

from __future__ import annotations

import argparse
import importlib
from typing import Protocol, cast

from gsac.pipeline.project import shipped_dag
from gsac.stages.contract import BadInput, did_you_mean

COMMANDS = {
    "run": "run a clip through the stages",
    "check": "look at a clip for seconds: what would come of it, and what to film again",
    "demo": "make a truth clip and run the whole job on it",
    "status": "what is up to date in the folder of a run",
    "explain": "what changed in the key of a stage",
    "stage": "run one stage, on a run's folder or on fixture artifacts",
    "fixtures": "cut what every stage of a run read, as plain files that replay it elsewhere",
    "batch": "run many clips over one cache",
    "events": "what the runs or the batch in a folder have told: stages, progress, warnings, ends",
    "cache": "list, check, clean and share the cache",
    "models": "list, pull, add and remove model files",
    "data": "import a data set that you downloaded: frames, masks, cameras, poses and the published split",
    "view": "show an avatar in the browser",
    "render": "make a video of an avatar, moving or from all sides",
    "convert": "write an avatar as VRM, USDZ, SOG or splats in glTF",
    "report": "write report.html of a run's folder",
    "pack": "make one zip of an avatar with viewer, report and exports, which opens anywhere",
    "lineage": "where an artifact comes from: clip, parameters, code, model files, packages, device, time",
    "bundle": "move a clip's results as one verified file",
    "compare": "write a page that shows two runs side by side",
}
"""Name -> help, of the modules beside this file."""
GROUP = "gsac.commands"
SETUP = "declared in pyproject.toml and not installed in this environment; run `make setup`"


class Command(Protocol):
    """A command's module; HELP only where it comes by an entry point."""

    HELP: str

    def declare(self, command: argparse.ArgumentParser) -> None: ...


def load(name: str) -> Command:
    """The module of a command of this package."""
    return cast(Command, importlib.import_module(f"{__name__}.{name}"))


def load_added() -> dict[str, Command]:
    """Commands by entry point. BadInput names one that cannot be imported."""
    from importlib.metadata import entry_points

    found = {}
    for point in entry_points(group=GROUP):
        try:
            found[point.name] = point.load()
        except (ImportError, AttributeError) as error:
            raise BadInput(f"the command {point.name} cannot be loaded ({error}); run `make setup`") from error
    return found


def not_installed(added: dict[str, Command]) -> set[str]:
    """Commands that the checkout declares and that the environment, installed before, does not know; none in a wheel."""
    file = shipped_dag().with_name("pyproject.toml")
    if not file.is_file():
        return set()
    import tomllib

    declared = tomllib.loads(file.read_text())["project"].get("entry-points", {}).get(GROUP, {})
    return declared.keys() - added.keys()


def unknown_command(typed: str, added: dict[str, Command]) -> BadInput:
    """The answer to a word that is no command."""
    missing = not_installed(added)
    if typed in missing:
        return BadInput(f"the command {typed} is {SETUP}")
    known = [*COMMANDS, *added, *missing]
    return BadInput(f"unknown command {typed}{did_you_mean(typed, known)}; known: {', '.join(known)}")
