"""gsac demo: makes a truth clip and runs all stages on it."""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path

from gsac.cache.half_made import half_made
from gsac.pipeline.clip_work import ClipWork
from gsac.pipeline.closing import closing_lines
from gsac.pipeline.commands.options import add_quality, open_journal, open_store, progress_reporter
from gsac.pipeline.journal import Journal
from gsac.pipeline.keys import Keys
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.placing import keep_aside
from gsac.pipeline.project import Project
from gsac.pipeline.quality import resolve_quality
from gsac.pipeline.run import Options
from gsac.pipeline.run_folder import RunFolder

CLIP_FILE = "clip.mp4"


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("--out", type=Path, default=Path("demo"), metavar="DIR", help="default: ./demo")
    add_quality(command)
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    root = arguments.out.absolute()
    with progress_reporter(arguments) as reporter, open_journal(arguments, reporter) as journal:
        store, project = open_store(journal), Project.at_hand()
        configs = resolve_quality(arguments.quality, project)
        if not (root / "clip" / CLIP_FILE).is_file():
            Keys(project, configs, store).pull_models(project.graph.steps, journal.note)
        clip, folder = make_truth_clip(root / "clip", journal), RunFolder(root / "avatar")
        ClipWork(project, configs, store, Options(quality=arguments.quality), journal).do(clip.resolve(), folder)
        for line in closing_lines(folder):
            journal.note(line)
        print(folder.root, flush=True)
    return ExitCode.OK


def make_truth_clip(folder: Path, journal: Journal) -> Path:
    """clip.mp4 in the folder; rendered, whole or not at all, if it is not there yet."""
    if (folder / CLIP_FILE).is_file():
        return folder / CLIP_FILE
    from gsac.turntable.clip import make_clip

    journal.note(f"the clip is made in {folder}")
    journal.starts("truth", "no clip yet")  # a reason goes into traces, which hold no paths
    began = time.monotonic()
    folder.parent.mkdir(parents=True, exist_ok=True)
    with half_made(folder.parent) as (temp, _):
        made = make_clip(temp / folder.name, seed=1,
                         progress=lambda done, total, unit: journal.progress("truth", done, total, unit))
        if os.path.lexists(folder):
            keep_aside(folder, journal.note)
        (temp / folder.name).rename(folder)
    journal.finishes("truth", time.monotonic() - began)
    return folder / made.name
