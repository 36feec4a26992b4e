"""python -m gsac.benchmarks.unity.checks: fills the table in unity/README.md from the self-checks' JSON files in `checked/`."""

from __future__ import annotations

import json
from pathlib import Path

HERE = Path(__file__).parent
CHECKED = HERE / "checked"
README = HERE.parents[1] / "unity" / "README.md"
BEGIN, END = "<!-- self-checks -->\n", "<!-- end -->"
NOBODY = "Nobody has sent one yet: this package has not been seen in Unity.\n"
HEAD = ("| Unity | pipeline | device | graphics | colours | Humanoid | by hand | in a headset |\n"
        "| --- | --- | --- | --- | --- | --- | --- | --- |\n")
UNSEEN = 0.5
"""Share of the person's pixels below which she counts as not drawn."""


def table(reports: list[dict]) -> str:
    """The table's text; a row a report, the worst view's decibels in a cell. reports: as the self-check writes them."""
    if not reports:
        return NOBODY
    return HEAD + "".join(sorted({_row(report) for report in reports}))


def _row(report: dict) -> str:
    cells = (report["unity"], report["pipeline"], f"{report['device']}, {report['system']}", f"{report['gpu']}, {report['api']}",
             report["colours"], "yes" if report["humanoid"] else "**no**",
             _cell([view for view in report["views"] if view["mode"] == "mono"]),
             _cell([view for view in report["views"] if view["mode"] != "mono"]))
    return "| " + " | ".join(str(cell).replace("|", "/") for cell in cells) + " |\n"


def _cell(views: list[dict]) -> str:
    if not views:
        return "not tried"
    modes = ", ".join(sorted({view["mode"] for view in views} - {"mono"}))
    unseen = [view["view"] for view in views if view["drawn_share"] < UNSEEN * view["person_share"]]
    seen = f"**nobody: {', '.join(unseen)}**" if unseen else f"{min(view['decibels'] for view in views):.1f} dB"
    return f"{seen} ({modes})" if modes else seen


def read_reports(folder: Path) -> list[dict]:
    """The self-checks in a folder; other reports there are passed over."""
    found = [json.loads(path.read_text()) for path in sorted(folder.glob("*.json"))]
    return [report for report in found if report.get("report") == "gsac-self-check"]


def fill(text: str, reports: list[dict]) -> str:
    """A README's text with the table in its place."""
    before, rest = text.split(BEGIN)
    return before + BEGIN + table(reports) + END + rest.split(END, 1)[1]


if __name__ == "__main__":
    README.write_text(fill(README.read_text(), read_reports(CHECKED)))
