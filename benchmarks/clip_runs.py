"""Truth clips of the turntable, and runs of the pipeline on them; both are made once and kept."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from gsac.cache.store import Store
from gsac.pipeline.journal import Journal
from gsac.pipeline.params import resolve
from gsac.pipeline.project import Project
from gsac.pipeline.run import ClipRun, Options
from gsac.pipeline.run_folder import RunFolder

HEIGHT = 1280
"""Height of rendered clips, px."""


def render_clip(folder: Path, say: Journal, **options: Any) -> Path:
    """Renders a truth clip into the folder unless it is there. options: of the turntable. Returns the folder."""
    if not (folder / "truth.npz").is_file():
        from gsac.turntable.clip import make_clip

        make_clip(folder, progress=lambda done, total, unit: say.progress(folder.name, done, total, unit),
                  **{"height": HEIGHT, **options})
    return folder


def run_clip(folder: Path, out: Path, stages: Iterable[str], store: Store, say: Journal,
             settings: tuple[str, ...] = ()) -> RunFolder:
    """Runs the folder's clip.mp4, or the folder itself where it holds photos, up to each of the stages, with results from the
    store where it has them.

    settings: `stage.key=value` that differ from the defaults. Returns the run's folder, `out`.
    """
    film = folder / "clip.mp4"
    project, clip, run = Project.at_hand(), (film if film.is_file() else folder).resolve(), RunFolder(out)
    configs = resolve(project, sets=settings)
    run.prepare(clip, project, configs, store)
    for last in stages:
        ClipRun(project, configs, store, run, say).run(clip, Options(until=last))
    return run
