"""gsac demo: a truth clip, and the whole job on it."""

from __future__ import annotations

import argparse
import shutil
import time
from pathlib import Path

from gsac.pipeline.commands.options import open_store
from gsac.pipeline.commands.run import run_clip
from gsac.pipeline.outcomes import ExitCode, Outcome
from gsac.pipeline.reporter import PlainReporter, reporter
from gsac.pipeline.run_folder import OWN_STORE, REPORT

CLIP_FILE = "clip.mp4"


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("--out", type=Path, default=Path("demo"), metavar="DIR", help="default: ./demo")
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    root = arguments.out.absolute()
    with reporter() as voice:
        clip = truth_clip(root / "clip", voice)
        workspace = run_clip(clip, root / "avatar", open_store(voice, root / "avatar" / OWN_STORE), voice)
    print(f"avatar:  {workspace.root / 'export' / 'avatar.gsac'}")
    print(f"viewer:  {workspace.root / 'export' / 'viewer.html'}   (or `gsac view {workspace.root}`)")
    print(f"report:  {workspace.root / REPORT}")
    return ExitCode.OK


def truth_clip(folder: Path, voice: PlainReporter) -> Path:
    """clip.mp4 in the folder; made if it is not there yet, whole or not at all."""
    if (folder / CLIP_FILE).is_file():
        return folder / CLIP_FILE
    from gsac.turntable.clip import make_clip

    voice.starts("truth", f"a clip is made in {folder}")
    began = time.monotonic()
    part = folder.with_name(f"{folder.name}.part")
    made = make_clip(part, seed=1, progress=lambda done, total, unit: voice.progress("truth", done, total, unit))
    if folder.exists():
        shutil.rmtree(folder)
    part.rename(folder)
    voice.ends("truth", Outcome.RAN, time.monotonic() - began)
    return folder / made.name
