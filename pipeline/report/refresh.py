"""When report.html is written: where what lies in the folder is not what it was drawn from."""

from __future__ import annotations

import contextlib
from threading import Thread
from typing import Any

from gsac.pipeline.report.origin import drawn_from, read_origin
from gsac.pipeline.report.results import Results
from gsac.pipeline.run_folder import REPORT, RunFolder


class EarlySections:
    """Sections of the report that are drawn while the last stages are at work. An interrupted run does not wait for them."""

    def __init__(self, folder: RunFolder):
        self.folder = folder
        self._drawn: dict[str, Any] = {}
        self._drawing: Thread | None = None

    def start(self, coming: list[str]) -> None:
        """Draws what is not drawn yet. coming: the stages whose results are not there yet."""
        self._drawing = Thread(target=self._draw, args=(coming, self._drawing), daemon=True)
        self._drawing.start()

    def _draw(self, coming: list[str], before: Thread | None) -> None:
        """before: what draws already."""
        if before is not None:
            before.join()
        with contextlib.suppress(Exception):  # it is drawn at the end, which tells why it cannot be
            from gsac.pipeline.report.page import draw_sections

            self._drawn = draw_sections(self.folder.root, coming, self._drawn)

    def sections(self) -> dict[str, Any]:
        """Sections by name; those that are missing are still to be drawn."""
        if self._drawing is not None:
            self._drawing.join()
        return self._drawn


def is_outdated(folder: RunFolder) -> bool:
    """Whether the report was drawn from other results than lie in the folder."""
    shown = read_origin(folder.root / REPORT)
    return shown is not None and shown.digest != drawn_from(Results(folder.root))


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
