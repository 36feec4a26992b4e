"""Puts the page together. A section whose result is absent or unreadable says so; nothing else stops."""

from __future__ import annotations

import datetime
import functools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock
from typing import Any
from urllib.parse import quote

from gsac.pipeline.report.results import AbsentError, Results, number, read_json, tree_size
from gsac.pipeline.report.tables import foot, parameters, stage_rows, totals
from gsac.pipeline.run_folder import REPORT, RUN

TEMPLATE = "report.html.jinja"


@dataclass
class Section:
    """One picture section."""

    ident: str
    title: str
    lead: str
    sheet: Any = None
    charts: list = field(default_factory=list)
    absent: str = ""
    """Why there is nothing to see."""


def draw_sections(out_dir: Path, running: str) -> dict[str, Section]:
    """By name, those sections that can be drawn while a stage still runs: of what the stages before it made. The template is
    read as well."""
    template()
    drawn = sections_of(Results(out_dir), without=running)
    return {section.ident: section for section in drawn if not section.absent}


def write_report(out_dir: Path, drawn: dict[str, Section] | None = None) -> Path:
    """Writes `report.html` into a run's folder and returns its path; whole or not at all. drawn: as `draw_sections`, of this run.

    Needs neither run.json nor any one artifact: what is missing is said on the page. Raises OSError only.
    """
    results = Results(out_dir)
    page = results.root / REPORT
    text = render(results, drawn or {})
    temp = page.with_name(f".{REPORT}-{os.getpid()}")
    temp.write_text(text, encoding="utf-8")
    os.replace(temp, page)
    return page


def render(results: Results, drawn: dict[str, Section]) -> str:
    sections = sections_of(results, drawn)
    shown = [section for section in sections if section.sheet]
    facts = {name: value for section in shown for name, value in section.sheet.facts.items()}
    return template().render(
        clip=results.clip_name, when=when(results), headline=headline(results, facts), sections=sections,
        warnings=warnings(results), failed=results.failed, reached=reached(results), stages=stage_rows(results),
        totals=totals(results), parameters=parameters(results), files=exported(results), foot=foot(results),
        viewer="export/viewer.html" if exported_viewer(results) else "",
    )


@functools.cache
def template():
    """The page's jinja2 template."""
    import jinja2

    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True,
                                     undefined=jinja2.StrictUndefined)
    environment.filters |= {"seconds": seconds, "bytes": size}
    return environment.from_string(Path(__file__).with_name(TEMPLATE).read_text(encoding="utf-8"))


def sections_of(results: Results, drawn: dict[str, Section] | None = None, without: str = "") -> list[Section]:
    """Drawn side by side: most of it is reading and writing pictures. drawn: by name, those that are; without: a stage whose
    results are left out."""
    draw, one_at_a_time = functools.cache(lambda: Draw(results)), Lock()

    def drawing() -> Draw:
        with one_at_a_time:
            return draw()

    def section(ident: str, title: str, lead: str, port: str, *how: Callable | None) -> Section:
        return (drawn or {}).get(ident) or make_section(results, drawing, ident, title, lead, port, *how)

    with ThreadPoolExecutor() as pool:
        return list(pool.map(lambda parts: section(*parts), [parts for parts in SECTIONS if parts[3].split("/")[0] != without]))


class Draw:
    """What draws, imported when there is something to draw."""

    def __init__(self, results: Results):
        from gsac.pipeline.report import charts, sheets
        from gsac.pipeline.report.pictures import Footage

        self.results, self.charts, self.sheets, self.footage = results, charts, sheets, Footage(results)


def make_section(results: Results, drawing: Callable[[], Draw], ident: str, title: str, lead: str, port: str,
                 sheet: Callable | None, charts: Callable | None = None) -> Section:
    """Draws what lies at a port; whatever keeps it from being drawn becomes the sentence in its place."""
    made = Section(ident, title, lead)
    try:
        results.path(port)
        made.sheet = sheet(drawing()) if sheet else None
        made.charts = charts(drawing()) if charts else []
    except AbsentError as reason:
        made.absent = str(reason)
    except Exception as error:  # a torn or foreign artifact must not cost the other sections
        made.absent = f"This could not be drawn: {type(error).__name__}: {error}"
    return made


def curves(results: Results, draw) -> list:
    curve = results.metrics.get("curve") or []
    charts = [draw.curve_chart(curve, "psnr_fg", "Held-out PSNR on the person", "dB"),
              draw.curve_chart(curve, "loss", "Loss", "log scale", log=True)]
    if not any(charts):
        raise AbsentError("train/metrics.json holds no training curve.")
    return [chart for chart in charts if chart]


def headline(results: Results, facts: dict[str, float]) -> dict[str, Any]:
    """The figures that matter, the verdict and the weak points."""
    from gsac.pipeline.report.verdict import grade, weaknesses

    try:
        metrics, absent = results.metrics, ""
    except AbsentError as reason:
        metrics, absent = {}, str(reason)
    figures = []
    psnr, aligned, fit = (number(metrics.get(k)) for k in ("psnr_fg", "psnr_fg_ttpo", "psnr_fg_fit"))
    if psnr is not None:
        figures.append(("Held-out PSNR, person only", f"{psnr:.2f} dB", "poses carried from neighbouring frames"))
    if aligned is not None:
        figures.append(("… pose aligned at test time", f"{aligned:.2f} dB", "on the held-out frame, avatar frozen"))
    if fit is not None:
        figures.append(("… with the fit's pose", f"{fit:.2f} dB", "as stage smplx left it"))
    if (ssim := number(metrics.get("ssim"))) is not None:
        figures.append(("SSIM", f"{ssim:.3f}", "whole frame, on white"))
    if (count := number(metrics.get("n_gaussians"))) is not None:
        figures.append(("Gaussians", f"{count:,.0f}", "bound to faces of the body"))
    total = totals(results)
    if total["seconds"]:
        figures.append(("Total time", seconds(total["seconds"]),
                        f"of it in this run {seconds(total['ran'])}" if total["cached"] else "all in this run"))
    return {"figures": figures, "person": person(results, facts), "weak": weaknesses(metrics, facts),
            "grade": grade(metrics) if metrics else "No avatar in this run", "absent": absent}


def person(results: Results, facts: dict[str, float]) -> str:
    """Clip and person in one line, as far as known."""
    words = []
    try:
        clip = read_json(results.path("split/clip.json")) or {}
        count = sum(1 for p in results.path("split/frames").iterdir() if p.stem.isdigit())
        words.append(f"{count} frames of {clip.get('width')} x {clip.get('height')} px")
        times = clip.get("timestamps_s") or []
        words.append(f"{times[-1] - times[0]:.1f} s" if len(times) > 1 else "photos" if not times else "one moment")
    except (AbsentError, AttributeError, TypeError, OSError):
        pass
    if "height_m" in facts:
        words.append(f"person {facts['height_m']:.2f} m tall by the fit")
    if "turn_degrees" in facts:
        words.append(f"seen over {facts['turn_degrees']:.0f} of 360 degrees")
    return ", ".join(words)


def warnings(results: Results) -> list[tuple[str, str]]:
    """Stage and sentence, all of them."""
    return [(name, str(text).removeprefix(f"{name}: ")) for name, row in results.rows.items() for text in row.get("warnings") or []]


def reached(results: Results) -> str:
    """A sentence on a run that was not whole and did not fail; empty otherwise."""
    if not results.has_run:
        return f"There is no readable {RUN} here: times, warnings and parameters of the run are unknown."
    left = [name for name in results.order if name not in results.rows]
    if left and not results.failed:
        return f"This run ended before {', '.join(left)}, as it was told to or because it was interrupted."
    return ""


def exported_viewer(results: Results) -> bool:
    return any(file["name"] == "viewer.html" for file in exported(results)["files"])


def exported(results: Results) -> dict[str, Any]:
    """Files of export: name, bytes, relative address; or why there are none."""
    words = {"viewer.html": "the avatar in a page: opens from disk, turns and moves",
             "avatar.gsac": "the avatar: body, gaussians, skinning, motions",
             "avatar.ply": "gaussians in one pose, for 3DGS viewers", "avatar.glb": "skinned mesh, with the gaussians",
             "avatar.spz": "gaussians in one pose, packed", "avatar.fbx": "skinned mesh with expressions", "unity": "Unity package"}
    files = []
    for name, what in words.items():
        try:
            path = results.path(f"export/{name}")
        except AbsentError:
            continue
        files.append({"name": name, "what": what, "bytes": tree_size(path), "href": quote(f"export/{name}")})
    absent = ""
    if not files:
        try:
            results.path("export")
            absent = "export holds no file."
        except AbsentError as reason:
            absent = str(reason)
    return {"files": files, "absent": absent}


def when(results: Results) -> str:
    """Day and time at which run.json was last changed, UTC."""
    path = results.root / RUN
    if not path.is_file():
        return ""
    moment = datetime.datetime.fromtimestamp(path.stat().st_mtime, datetime.UTC)
    return moment.strftime("%Y-%m-%d %H:%M UTC")


def seconds(value: Any) -> str:
    """`4.2 s`, `3 min 05 s`"""
    value = number(value)
    if value is None:
        return "–"
    if value < 60:
        return f"{value:.1f} s" if value < 59.95 else "1 min 00 s"
    minutes, rest = divmod(round(value), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s"


def size(value: Any) -> str:
    """`1.2 MB`"""
    value = number(value)
    if value is None:
        return "–"
    for unit in ("B", "kB", "MB"):
        if value < 1000:
            return f"{value:.0f} {unit}" if unit == "B" or value >= 100 else f"{value:.1f} {unit}"
        value /= 1000
    return f"{value:.1f} GB"


SECTIONS = (
    ("clip", "The clip", "Frames that the stages read, evenly through the clip.", "split/frames",
     lambda draw: draw.sheets.contact_sheet(draw.footage)),
    ("keypoints", "Keypoints", "What the detector saw. A ring is a point filled by its neighbours in time; "
     "a cross marks the wrist of a hand that is missing.", "keypoints/keypoints.npz",
     lambda draw: draw.sheets.keypoint_sheet(draw.footage),
     lambda draw: [draw.charts.strip_chart(draw.footage.keypoints, draw.footage.face_valid)]),
    ("alpha", "Cut-out", "The person over magenta: what is pink inside the person, or not pink outside, is "
     "wrong.", "segment/alpha", lambda draw: draw.sheets.alpha_sheet(draw.footage)),
    ("body", "Fitted body", "The body model over the frames, half transparent. Dots are detected points, "
     "white rings the body's own, lines their distance.", "smplx/body.npz",
     lambda draw: draw.sheets.body_sheet(draw.footage)),
    ("heldout", "Held-out frames", "Truth, render and error (black none, yellow half of the full range) of "
     "frames that training never saw.", "train/heldout", lambda draw: draw.sheets.heldout_sheet(draw.results)),
    ("views", "From all sides", "The avatar in its T-pose, from directions that the camera may never have "
     "had.", "train/heldout/views.png", lambda draw: draw.sheets.views_sheet(draw.results)),
    ("training", "Training", "Loss and held-out quality over the seconds of training, without the time for "
     "judging.", "train/metrics.json", None, lambda draw: curves(draw.results, draw.charts)),
)
"""Name, title, what it shows, port, what draws pictures, and charts."""
