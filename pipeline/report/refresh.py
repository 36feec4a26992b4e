"""When report.html is written: where what lies in the folder is not what it was drawn from."""

from __future__ import annotations

import contextlib
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from gsac.pipeline.report.origin import drawn_from, read_origin
from gsac.pipeline.report.results import Results
from gsac.pipeline.run_folder import REPORT, RunFolder


class EarlySections:
    """Sections of the report that are drawn while the last stage is at work."""

    def __init__(self, folder: RunFolder):
        self.folder, self._pool, self._drawn = folder, ThreadPoolExecutor(1), None

    def start(self, running: str) -> None:
        """running: the stage at work, whose results are not there yet."""
        self._drawn = self._pool.submit(self._draw, running)

    def _draw(self, running: str) -> dict[str, Any]:
        from gsac.pipeline.report.page import draw_sections

        return draw_sections(self.folder.root, running)

    def sections(self) -> dict[str, Any]:
        """Sections by name; those that are missing are still to be drawn."""
        with contextlib.suppress(Exception):
            return self._drawn.result() if self._drawn else {}
        return {}


def refresh_report(folder: RunFolder, early: EarlySections | None = None) -> str | None:
    """Draws the report anew if it is due. Returns a warning where that failed or would have cost parts of the page: neither
    fails the run."""
    page = folder.root / REPORT
    try:
        results, shown = Results(folder.root), read_origin(page)
        if shown is not None:
            if shown.digest == drawn_from(results):
                return None
            if lost := [stage for stage in shown.stages if not results.holds(stage)]:
                return (f"{page} stays as it is: it shows results of {', '.join(lost)}, which are no longer in the folder; "
                        f"`gsac report {folder.root}` draws what is left")
        from gsac.pipeline.report.page import write_report

        write_report(folder.root, early.sections() if early else None)
    except Exception as error:
        why = f"{type(error).__name__}: {error}"
        return f"{page} could not be written ({why}); `gsac report {folder.root}` tries again"
    return None
