"""A clip's run in its folder: from the first look at the folder to the report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gsac.cache.store import Store
from gsac.pipeline.clip_end import told_clip
from gsac.pipeline.errors import attach_summary, exit_code
from gsac.pipeline.event_file import kept_events
from gsac.pipeline.journal import Journal
from gsac.pipeline.keys import Keys
from gsac.pipeline.other_clip import forget_results, make_way
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.own_store import writable_store
from gsac.pipeline.project import Project
from gsac.pipeline.report.refresh import EarlySections, is_outdated, refresh_report
from gsac.pipeline.run import ClipRun, Options
from gsac.pipeline.run_folder import OWN_STORE, REPORT, RunFolder

MISTAKES = (ExitCode.USAGE, ExitCode.STALE)
"""Ends of a run that are the command line's or the clip's fault."""


@dataclass(frozen=True)
class ClipWork:
    """What runs of clips need and share."""

    project: Project
    configs: dict[str, Any]
    store: Store
    options: Options
    journal: Journal
    replace: bool = False
    """Whether another clip's avatar in the folder gives way."""

    def do(self, clip: Path, folder: RunFolder, keys: Keys | None = None) -> ClipRun:
        """Runs the clip; its results, run.json and the report lie in the folder however it ends.

        clip: absolute path. keys: of this project, these configs and this store, where they are known already. Raises BadInput
        where the folder is another's, and what ClipRun.run raises, with the summary of what was done attached.
        """
        folder.say, self.journal.clip = self.journal.note, self.journal.clip or clip.name
        folder.refuse_foreign(clip, self.project)
        with folder.hold():
            replaced = make_way(folder, clip, self.store, self.replace)
            folder.prepare(clip, self.project, self.configs, self.store)
            if replaced:
                forget_results(folder)
            store = writable_store(self.store, folder.root / OWN_STORE, self.journal)
            clip_run = ClipRun(self.project, self.configs, store, folder, self.journal, keys if store is self.store else None)
            with kept_events(folder, self.journal), told_clip(self.journal, clip_run.summary):
                self._carry_out(clip_run, clip)
        return clip_run

    def _carry_out(self, clip_run: ClipRun, clip: Path) -> None:
        early = EarlySections(clip_run.folder)
        try:
            clip_run.pull_models(clip, self.options)
            clip_run.run(clip, self.options, early.start)
            self._write_report(clip_run, early)
        except BaseException as error:
            attach_summary(error, clip_run.summary())
            if exit_code(error) in MISTAKES and not clip_run.finished:
                clip_run.folder.discard()
            elif isinstance(error, Exception):
                self._write_report(clip_run)
            elif is_outdated(clip_run.folder):  # who interrupts a run does not wait for a drawing
                self.journal.note(f"{REPORT} is of an earlier run; `gsac report {clip_run.folder.root}` draws it anew")
            raise

    def _write_report(self, clip_run: ClipRun, early: EarlySections | None = None) -> None:
        """Writes report.html if it is due; a failure is only a warning."""
        if (warning := refresh_report(clip_run.folder, early)) is not None:
            self.journal.note(f"gsac: warning: {warning}")
