"""Two runs on one page: verdicts, figures and pictures side by side, and the parameters that differ."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

from gsac.pipeline.report.page import AVATAR, Section, headline, make_sections, make_template
from gsac.pipeline.report.results import Results
from gsac.pipeline.report.tables import format_value
from gsac.pipeline.run_folder import write_text

TEMPLATE = "compare.html.jinja"
PICTURES = ("heldout", "views")
"""The sections whose pictures are compared."""


def write_comparison(first: Path, second: Path, page: Path) -> None:
    """Writes the page that compares two runs' folders, whole or not at all."""
    runs = [Results(first), Results(second)]
    drawn = [{section.ident: section for section in make_sections(results)} for results in runs]
    heads = [headline(results, facts_of(sections)) for results, sections in zip(runs, drawn, strict=True)]
    names = [folder.resolve().name for folder in (first, second)]
    text = read_template().render(names=names, clips=[results.clip_name for results in runs], heads=heads,
                                  avatars=[sections[AVATAR].sheet for sections in drawn],
                                  figures=pair_figures(*(head["figures"] for head in heads)),
                                  parameters=differing_parameters(*runs), pictures=pair_pictures(*drawn))
    write_text(page, text)


@functools.cache
def read_template() -> Any:
    """The page's jinja2 template."""
    return make_template(TEMPLATE)


def facts_of(sections: dict[str, Section]) -> dict[str, float]:
    """The figures of all sheets together."""
    return {name: value for section in sections.values() if section.sheet for name, value in section.sheet.facts.items()}


def pair_figures(*figures: list[tuple[str, str, str]]) -> list[tuple[str, ...]]:
    """Name and both values, in the order of the first run; a dash where a run has none."""
    values = [{name: value for name, value, _ in rows} for rows in figures]
    return [(name, *(known.get(name, "–") for known in values)) for name in dict.fromkeys(name for rows in values for name in rows)]


def differing_parameters(*runs: Results) -> list[tuple[str, ...]]:
    """`stage.name` and both values, of the parameters that are not the same."""
    known = [{f"{stage}.{key}": format_value(value) for stage, row in results.rows.items()
              for key, value in (row.get("params") or {}).items()} for results in runs]
    names = dict.fromkeys(name for values in known for name in values)
    rows = [(name, *(values.get(name, "–") for values in known)) for name in names]
    return [row for row in rows if row[1] != row[2]]


def pair_pictures(*drawn: dict[str, Section]) -> list[tuple[str, list]]:
    """Caption and both pictures (or None): held-out frames that either run shows, then the avatar from all sides."""
    pairs = []
    for ident in PICTURES:
        shown = [{p.frame: p for p in sections[ident].sheet.pictures} if sections[ident].sheet else {} for sections in drawn]
        for frame in sorted({*shown[0], *shown[1]}, key=lambda frame: -1 if frame is None else frame):
            words = drawn[0][ident].title if frame is None else f"Held-out frame {frame}: truth, render, error"
            pairs.append((words, [known.get(frame) for known in shown]))
    return pairs
