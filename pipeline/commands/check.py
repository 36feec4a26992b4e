"""gsac check CLIP: looks at a clip for seconds, by the first stages on a few frames, and says what would come of it."""

from __future__ import annotations

import argparse
import contextlib
from pathlib import Path

from gsac.cache.half_made import half_made, temporary_folder
from gsac.pipeline.asked_clip import find_clip
from gsac.pipeline.clip_check import LAST, PARAMS, check_clip
from gsac.pipeline.commands.options import add_clip, add_json, answer_reporter, open_store, progress_reporter
from gsac.pipeline.json_output import emit
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.own_store import writable_store
from gsac.pipeline.params import resolve
from gsac.pipeline.project import Project
from gsac.pipeline.run import ClipRun, HopelessClipError, Options
from gsac.pipeline.run_folder import OWN_STORE, RunFolder


def declare(command: argparse.ArgumentParser) -> None:
    add_clip(command)
    add_json(command)
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    project, clip = Project.at_hand(), find_clip(arguments.clip)
    configs = resolve(project, options={"gsac check": PARAMS})
    options = Options(until=LAST, fleeting=True)
    with progress_reporter(arguments) as reporter, half_made(temporary_folder()) as (folder, _):
        store = writable_store(open_store(reporter), folder / OWN_STORE, reporter)
        run_folder = RunFolder(folder / clip.name)
        clip_run = ClipRun(project, configs, store, run_folder)
        with run_folder.hold():
            run_folder.prepare(clip, project, configs, store)
            clip_run.keys.pull_models(clip_run.select(options), reporter.note)
            with contextlib.suppress(HopelessClipError):  # the finding says so
                clip_run.run(clip, options)
        outputs = {port: Path(path) for port, path in clip_run.summary()["outputs"].items()}
        found = [pair for result in clip_run.results for pair in zip(result.warnings, result.findings, strict=True)]
        check = check_clip(outputs["split/clip.json"], outputs["keypoints/keypoints.npz"], found)
        stages = clip_run.summary()["stages"]
    answer = answer_reporter(arguments)
    for line in check.lines:
        answer.result(line)
    if arguments.json:
        emit({"stages": stages, "outputs": {}, "metrics": {}, **check.to_json()})
    return check.prospect.exit_code
