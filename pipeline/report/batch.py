"""batch.html: a card for each clip of a batch, and for each other run that lies in its folder."""

from __future__ import annotations

import base64
import functools
import os
import re
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import zip_longest
from pathlib import Path
from typing import Any
from urllib.parse import quote

from gsac.pipeline.closing import RESULTS
from gsac.pipeline.executors.executor import ClipJob, ClipResult
from gsac.pipeline.outcomes import ExitCode, Outcome
from gsac.pipeline.report.batch_figures import FIGURES, find_outliers, list_changes, list_words, read_figures
from gsac.pipeline.report.origin import HEAD_BYTES, read_origin
from gsac.pipeline.report.page import make_template
from gsac.pipeline.report.results import Results
from gsac.pipeline.report.verdict import Grade
from gsac.pipeline.run import first_sentence
from gsac.pipeline.run_folder import LOGS, REPORT, RUN, write_text
from gsac.stages.contract import BadInput
from gsac.stages.severity import Severity

PAGE, TEMPLATE = "batch.html", "batch.html.jinja"
MARK = '<meta name="gsac-page" content="batch">'
"""Tells the page from a file of the user's by the same name."""
STRIP = re.compile(r'<div class="turning" style="--views:(\d+)[^<]*<div class="turn"><img src="data:image/webp;base64,([^"]+)"')
"""The turning avatar in report.html: how many views stand side by side, and the picture."""
KEPT = re.compile(r'<a class="turn" data-drawn="(\w+)" style="--views:(\d+);[^>]*><img src="([^"]+)" width="(\d+)" height="(\d+)"')
"""A card's picture in the page: the digest of what its report was drawn from, its views, the picture."""
GAP_S = 5.0
"""s between two writings of the page while clips end."""
VIEW_HEIGHT = 264
"""px of a view on a card."""
IN_PICTURE = ("cut_off", "part_hidden", "second_person")
"""Codes of findings that a card tells in words: what of the person the pictures lack, and who else is in them."""


@dataclass(frozen=True)
class Strip:
    """Views of an avatar's turn side by side."""

    uri: str
    width: int
    height: int
    views: int
    drawn: str
    """Digest of what the report was drawn from, out of which it was cut."""


@dataclass(frozen=True)
class Card:
    """One clip: what became of it, and where to look further."""

    clip: str
    folder: str
    """Name of the run's folder."""
    outcome: Outcome
    words: str = ""
    """The verdict in one line, or why there is none."""
    grade: Grade | None = None
    strip: Strip | None = None
    links: tuple[tuple[str, str], ...] = ()
    """Name and address, relative to the page, of what there is to open."""
    found: tuple[str, ...] = ()
    """What contradicts itself in the clip: codes of findings, as words."""
    in_picture: tuple[str, ...] = ()
    """Sentences on what of the person the pictures lack, and on who else is in them."""
    figures: Mapping[str, float] = field(default_factory=dict)
    """Name in metrics.json -> value."""
    changes: tuple[str, ...] = ()
    """Figures that differ from those of the batch before, in words."""
    outliers: tuple[str, ...] = ()
    """Figures that are far worse than the other clips', in words."""

    @property
    def figure_words(self) -> str:
        """The figures in one line."""
        return ", ".join(list_words(self.figures))

    @property
    def state(self) -> str:
        """The word by which the page filters."""
        if self.outcome in (Outcome.FAILED, Outcome.PLANNED):
            return self.outcome.value
        return self.grade.name.lower() if self.grade else "unknown"

    def address(self, name: str) -> str:
        """Of the link of that name; empty without it."""
        return dict(self.links).get(name, "")


class BatchPage:
    """The page of a batch in the folder `out`. Raises BadInput where a file of the user's stands in its place."""

    def __init__(self, out: Path, jobs: list[ClipJob]):
        self.path = out.absolute() / PAGE
        if self.path.exists() and not is_ours(self.path):
            raise BadInput(f"{self.path} was not written by `gsac batch`, which would write over it; move it away, or give another "
                           "--out")
        self._written = -GAP_S
        self._strips = read_strips(self.path)
        self._cards = {job: Card(job.clip.name, job.out.name, Outcome.PLANNED) for job in jobs}

    @functools.cached_property
    def _others(self) -> list[Card]:
        """Runs that lie in the folder and are not of this batch."""
        ours = {job.out for job in self._cards}
        folders = sorted(path.parent for path in self.path.parent.glob(f"*/{RUN}") if path.parent not in ours)
        return [make_card(folder, self._strips) for folder in folders]

    def add(self, result: ClipResult, before: Mapping[str, Any] | None = None) -> None:
        """Takes in the end of one clip. before: its metrics in the batch before."""
        card = end_card(result, self._strips)
        self._cards[result.job] = replace(card, changes=tuple(list_changes(card.figures, read_figures(before or {}))))

    def keep(self, job: ClipJob, error: str) -> None:
        """Takes in a clip that is left as the batch before has left it. error: why it failed there; empty where it did not."""
        self._cards[job] = failed_card(job, error) if error and Results(job.out).failed is None else \
            make_card(job.out, self._strips)

    @property
    def is_due(self) -> bool:
        """Whether the page was last written long enough ago; with many clips each writing takes a while."""
        return time.monotonic() - self._written >= GAP_S

    def write(self) -> None:
        """Writes the page as it stands. Raises OSError."""
        cards = list(self._cards.values())
        cards = [replace(card, outliers=tuple(words)) for card, words in
                 zip(cards, find_outliers([card.figures for card in cards]), strict=True)]
        cards.sort(key=lambda card: (card.outcome is not Outcome.FAILED, not card.outliers))
        self.path.parent.mkdir(parents=True, exist_ok=True)
        write_text(self.path, render(self.path.parent.name, cards, self._others))
        self._written = time.monotonic()


def is_ours(page: Path) -> bool:
    """Whether a file is a page of this kind."""
    try:
        with page.open("rb") as file:
            return MARK.encode() in file.read(HEAD_BYTES)
    except OSError:
        return False


def render(name: str, cards: list[Card], others: list[Card]) -> str:
    """The page's HTML. name: of the batch's folder."""
    outcomes = [card.outcome for card in cards]
    return read_template().render(mark=MARK, name=name, cards=cards, others=others, figures=FIGURES,
                                  done=outcomes.count(Outcome.RAN), failed=outcomes.count(Outcome.FAILED), outcomes=Outcome)


@functools.cache
def read_template() -> Any:
    """The page's jinja2 template."""
    return make_template(TEMPLATE)


def read_strips(page: Path) -> dict[str, Strip]:
    """By `drawn`, the pictures of a page that was written before; none where there is no page."""
    try:
        text = page.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return {}
    return {drawn: Strip(uri, int(width), int(height), int(views), drawn)
            for drawn, views, uri, width, height in KEPT.findall(text)}


def end_card(result: ClipResult, strips: Mapping[str, Strip]) -> Card:
    """Of a clip whose run has ended. Where its failure is not recorded in the folder, that is another run's, or there is none.

    strips: as in `make_card`.
    """
    failed = [row["name"] for row in result.summary.get("stages", []) if row["status"] == Outcome.FAILED.value]
    recorded = Results(result.job.out).failed
    if result.code == ExitCode.OK or (recorded is not None and recorded[0] in failed):
        return make_card(result.job.out, strips)
    return failed_card(result.job, result.error)


def failed_card(job: ClipJob, error: str) -> Card:
    """Of a clip whose failure no folder records. error: its sentence; the page leaves out where files lie."""
    why = error.replace(str(job.clip), job.clip.name).replace(f"{job.out.parent}{os.sep}", "")
    return Card(job.clip.name, job.out.name, Outcome.FAILED, why)


def make_card(folder: Path, strips: Mapping[str, Strip]) -> Card:
    """Of what lies in the folder of a run. strips: those that were cut before, by `drawn`."""
    results, page = Results(folder), folder / REPORT
    files = {"Report": REPORT, "Viewer": str(RESULTS["viewer"])}
    if results.failed is not None:
        stage, why = results.failed
        files = {"Report": REPORT, "Log": f"{LOGS}/{stage}.log"}
    links = tuple((name, quote(f"{folder.name}/{file}")) for name, file in files.items() if (folder / file).is_file())
    if results.failed is not None:
        return Card(results.clip_name, folder.name, Outcome.FAILED, f"Stage {stage} failed: {why}", links=links)
    origin = read_origin(page)
    if origin is None or not (origin.grade or origin.verdict):
        words = "No avatar in this run." if origin else f"No report of this version; `gsac report {folder.name}` writes it."
        return Card(results.clip_name, folder.name, Outcome.RAN, words, links=links)
    strip = strips.get(origin.digest) or cut_strip(page, origin.digest)
    grade = Grade.__members__.get(origin.grade)
    return Card(results.clip_name, folder.name, Outcome.RAN, origin.verdict, grade, strip, links, name_findings(results),
                tell_picture(results), read_figures(results.run.get("metrics") or {}))


def name_findings(results: Results) -> tuple[str, ...]:
    """Codes of the findings that are wrong in the clip, each once, as words: `camera moves`."""
    codes = [str(finding.get("code")) for _, finding in list_findings(results) if finding.get("severity") == Severity.WRONG]
    return tuple(code.replace("_", " ") for code in dict.fromkeys(codes))


def tell_picture(results: Results) -> tuple[str, ...]:
    """The first sentences of the warnings whose codes are IN_PICTURE."""
    return tuple(first_sentence(message) for message, finding in list_findings(results) if finding.get("code") in IN_PICTURE)


def list_findings(results: Results) -> list[tuple[str, dict[str, Any]]]:
    """Warnings with their findings, of the results in the folder."""
    rows = [results.result(name) or row for name, row in results.rows.items()]
    return [(str(message), finding) for row in rows
            for message, finding in zip_longest(row.get("warnings") or [], row.get("findings") or [], fillvalue="")
            if isinstance(finding, dict)]


def cut_strip(page: Path, drawn: str) -> Strip | None:
    """The turning avatar of a report, made small; None where it shows none. drawn: what the report was drawn from."""
    import cv2
    import numpy as np

    from gsac.pipeline.report.pictures import make_picture, shrink_to_fit

    found = STRIP.search(page.read_text(encoding="utf-8", errors="replace"))
    strip = cv2.imdecode(np.frombuffer(base64.b64decode(found[2]), np.uint8), cv2.IMREAD_COLOR) if found is not None else None
    if found is None or strip is None:
        return None
    small = make_picture(shrink_to_fit(cv2.cvtColor(strip, cv2.COLOR_BGR2RGB), strip.shape[1], VIEW_HEIGHT), "", "")
    return Strip(small.uri, small.width, small.height, int(found[1]), drawn)
