"""When report.html is written: after a run that changed something, or where it is missing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gsac.pipeline.outcomes import Outcome

if TYPE_CHECKING:
    from gsac.pipeline.run import StageResult
    from gsac.pipeline.workspace import Workspace

REPORT = "report.html"


def refresh_report(workspace: Workspace, results: list[StageResult]) -> str | None:
    """Writes the report if it is due. A report that fails does not spoil a run: the answer is a warning then."""
    page = workspace.root / REPORT
    if page.exists() and all(result.outcome is Outcome.CACHED for result in results):
        return None
    try:
        from gsac.pipeline.report import write_report

        write_report(workspace.root)
    except Exception as error:
        why = f"{type(error).__name__}: {error}"
        return f"{page} could not be written ({why}); `gsac report {workspace.root}` tries again"
    return None
