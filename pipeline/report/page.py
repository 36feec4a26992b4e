"""Puts the page together. A section whose result is absent or unreadable says so; the others are shown."""

from __future__ import annotations

import datetime
import functools
from collections.abc import Callable, Collection
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import zip_longest
from pathlib import Path
from threading import Lock
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import quote

from gsac.pipeline.quality import describe_quality
from gsac.pipeline.report.frame_links import FrameLinks
from gsac.pipeline.report.origin import drawn_from, read_origin, shown_stages
from gsac.pipeline.report.results import AbsentError, Results, number, tree_size
from gsac.pipeline.report.tables import parameters, provenance, stage_rows, totals
from gsac.pipeline.rows import read_json
from gsac.pipeline.run_folder import REPORT, RUN, RunFolder
from gsac.stages.counting import counted
from gsac.stages.severity import Severity

if TYPE_CHECKING:
    from jinja2 import Template

TEMPLATE = "report.html.jinja"
AVATAR = "avatar"
"""The section that stands at the top of the page, without a heading."""
TRAINING = "training"
"""The section of the curves over seconds."""
GRAVEST = [severity.value for severity in reversed(Severity)]


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
    stage: str = ""
    """Whose result it shows."""


def draw_sections(out_dir: Path, coming: Collection[str], drawn: dict[str, Section] | None = None) -> dict[str, Section]:
    """By name, the sections that can be drawn while stages are still to come: those of the others. Reads the template as well.

    Not the curves over seconds: those are in run.json, which is written at the run's end. drawn: those that are made already.
    """
    read_template()
    made = make_sections(Results(out_dir), drawn, coming)
    return {section.ident: section for section in made if not section.absent and section.ident != TRAINING}


def write_report(out_dir: Path, drawn: dict[str, Section] | None = None) -> Path:
    """Writes `report.html` into a run's folder, and returns its path. drawn: of this run, by `draw_sections`.

    Needs neither run.json nor any artifact: the page says what is missing. Raises OSError only.
    """
    results = Results(out_dir)
    RunFolder(results.root).write(REPORT, render(results, drawn or {}), lambda page: read_origin(page) is not None)
    return results.root / REPORT


def render(results: Results, drawn: dict[str, Section]) -> str:
    """The page's HTML. drawn: as for `make_sections`."""
    made = make_sections(results, drawn)
    avatar = next(section for section in made if section.ident == AVATAR)
    sections = [section for section in made if section is not avatar]
    shown = [section for section in sections if section.sheet]
    frames = {section.ident: [p.frame for p in section.sheet.pictures if p.frame is not None] for section in shown}
    facts = {name: value for section in shown for name, value in section.sheet.facts.items()}
    return read_template().render(
        clip=results.clip_name, when=run_date(results), headline=headline(results, facts), sections=sections,
        avatar=avatar.sheet, warnings=list_warnings(results), links=FrameLinks(frames),
        failed=results.failed, reached=explain_partial_run(results), stages=stage_rows(results),
        totals=totals(results), parameters=parameters(results), files=list_exports(results), foot=provenance(results),
        viewer="export/viewer.html" if has_viewer(results) else "", caveat=results.caveat,
        drawn_from=drawn_from(results), shows=" ".join(shown_stages(results)), quality=describe_quality(results.run.get("quality")),
    )


@functools.cache
def read_template() -> Template:
    """The page's jinja2 template."""
    return make_template(TEMPLATE)


def make_template(name: str) -> Template:
    """A jinja2 template of this package."""
    import jinja2

    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(Path(__file__).parent), autoescape=True, trim_blocks=True,
                                     lstrip_blocks=True, undefined=jinja2.StrictUndefined, finalize=_as_utf8)
    environment.filters |= {"seconds": seconds, "bytes": size, "counted": counted}
    return environment.get_template(name)


def _as_utf8(value: Any) -> Any:
    """What a template shows; of a name that is not UTF-8 with ? for each letter that no page can hold."""
    if not isinstance(value, str) or value.isascii():
        return value
    return type(value)(value.encode(errors="replace").decode())


def make_sections(results: Results, drawn: dict[str, Section] | None = None, without: Collection[str] = ()) -> list[Section]:
    """All sections, made in parallel, since most of the time goes into reading and writing pictures.

    drawn: by name, those that are made already; without: stages whose results are left out.
    """
    draw, one_at_a_time = functools.cache(lambda: Painter(results)), Lock()

    def drawing() -> Painter:
        with one_at_a_time:
            return draw()

    def section(ident: str, title: str, lead: str, port: str, *how: Callable | None) -> Section:
        known = (drawn or {}).get(ident) if results.done(port.partition("/")[0]) else None
        return known or make_section(results, drawing, ident, title, lead, port, *how)

    with ThreadPoolExecutor() as pool:
        return list(pool.map(lambda parts: section(*parts), [parts for parts in SECTIONS if parts[3].split("/")[0] not in without]))


class Painter:
    """The modules that draw, imported once there is something to draw, and the frames they draw on."""

    def __init__(self, results: Results):
        from gsac.pipeline.report import charts, sheets, turn
        from gsac.pipeline.report.pictures import RunPictures

        self.results, self.run = results, RunPictures(results)
        self.charts, self.sheets, self.turn = charts, sheets, turn


def make_section(results: Results, drawing: Callable[[], Painter], ident: str, title: str, lead: str, port: str,
                 sheet: Callable | None, charts: Callable | None = None) -> Section:
    """Draws the result at a port; where that fails, the section holds the reason."""
    made = Section(ident, title, lead, stage=port.partition("/")[0])
    try:
        results.path(port)
        made.sheet = sheet(drawing()) if sheet else None
        made.charts = charts(drawing()) if charts else []
    except AbsentError as reason:
        made.absent = str(reason)
    except Exception as error:  # a torn or foreign artifact must not cost the other sections
        made.absent = f"This could not be drawn: {type(error).__name__}: {error}"
    return made


def training_charts(results: Results, charts: ModuleType) -> list:
    """Held-out quality and loss over the seconds of training. charts: the module, imported late."""
    curve = results.metrics.get("curve") or []
    drawn = [charts.curve_chart(curve, "psnr_fg", "Held-out PSNR on the person", "dB"),  # only where train.curve asks for it
             charts.curve_chart(curve, "loss", "Loss", "log scale", log=True)]
    if not any(drawn):
        raise AbsentError("train/metrics.json holds no training curve.")
    return [chart for chart in drawn if chart]


def headline(results: Results, facts: dict[str, float]) -> dict[str, Any]:
    """The verdict, what to film differently, and the details behind them."""
    from gsac.pipeline.report.advice import give_advice
    from gsac.pipeline.report.quality import weaknesses
    from gsac.pipeline.report.verdict import give_verdict

    try:
        metrics, absent = results.metrics, ""
    except AbsentError as reason:
        metrics, absent = {}, str(reason)
    if (turn := number(metrics.get("turn_degrees"))) is not None:
        facts = facts | {"turn_degrees": turn}  # of the frames that have a mask as well
    return {"verdict": give_verdict(metrics, facts) if metrics else None, "advice": give_advice(metrics, facts), "absent": absent,
            "person": describe_person(results, facts), "weak": weaknesses(metrics, facts),
            "figures": list_figures(results, metrics)}


def list_figures(results: Results, metrics: dict[str, Any]) -> list[tuple[str, str, str]]:
    """Name, value and meaning of the figures behind the verdict. metrics: train's metrics.json, {} without one."""
    width, height = metrics.get("image_size") or (None, None)
    at = f", at {width} x {height} px" if width else ""
    names = (("psnr_fg", "{:.2f} dB", "Held-out PSNR, person only", f"poses carried from neighbouring frames{at}"),
             ("psnr_fg_ttpo", "{:.2f} dB", "Held-out PSNR, pose aligned", f"on the held-out frame, avatar frozen{at}"),
             ("psnr_fg_fit", "{:.2f} dB", "Held-out PSNR, pose of the fit", f"as stage smplx left it{at}"),
             ("psnr_fg_ttpo_540", "{:.2f} dB", "Held-out PSNR at 540 px", "pose aligned, drawn small, as older versions judged"),
             ("psnr_edge_ttpo", "{:.2f} dB", "PSNR at the outline", f"in a narrow band along the cut-out, pose aligned{at}"),
             ("psnr_inside_ttpo", "{:.2f} dB", "PSNR inside of it", f"pose aligned{at}"),
             ("psnr_face_ttpo", "{:.2f} dB", "PSNR of the face", f"pose aligned{at}"),
             ("psnr_hands_ttpo", "{:.2f} dB", "PSNR of the hands", f"pose aligned{at}"),
             ("ssim", "{:.3f}", "SSIM", f"whole frame, on white{at}"),
             ("alpha_iou_ttpo", "{:.3f}", "IoU of the outline", "pose aligned"),
             ("n_gaussians", "{:,.0f}", "Gaussians", "bound to faces of the body"))
    small = metrics.get("at_540")
    known = metrics | {f"{key}_540": value for key, value in (small if isinstance(small, dict) else {}).items()}
    figures = [(name, form.format(value), meaning) for key, form, name, meaning in names
               if (value := number(known.get(key))) is not None]
    total = totals(results)
    if total["seconds"]:
        figures.append(("Total time", seconds(total["seconds"]),
                        f"of it in this run {seconds(total['ran'])}" if total["cached"] else "all in this run"))
    return figures


def describe_person(results: Results, facts: dict[str, float]) -> str:
    """Clip and person in one line, as far as known."""
    words = []
    try:
        clip = read_json(results.path("split/clip.json")) or {}
        count = sum(1 for p in results.path("split/frames").iterdir() if p.stem.isdigit())
        words.append(f"{counted(count, 'frame')} of {clip.get('width')} x {clip.get('height')} px")
        times = clip.get("timestamps_s") or []
        words.append(f"{times[-1] - times[0]:.1f} s" if len(times) > 1 else "photos" if not times else "one moment")
    except (AbsentError, AttributeError, TypeError, OSError):
        pass
    if "height_m" in facts:
        words.append(f"person {facts['height_m']:.2f} m tall by the fit")
    if "turn_degrees" in facts:
        words.append(f"seen over {facts['turn_degrees']:.0f} of 360 degrees")
    return ", ".join(words)


class Warned(NamedTuple):
    """A warning or note on the page."""

    stage: str
    text: str
    severity: str = ""
    """Of the finding; empty for notes, and for warnings of runs that knew no codes."""


def list_warnings(results: Results) -> dict[str, list[Warned]]:
    """Heading -> all warnings, the gravest first, and the notes, which a person has nothing to mend about."""
    rows = {name: results.result(name) or row for name, row in results.rows.items()}
    warnings = [Warned(name, str(text).removeprefix(f"{name}: "), str(finding.get("severity", "")))
                for name, row in rows.items()
                for text, finding in zip_longest(row.get("warnings") or [], row.get("findings") or [], fillvalue={}) if text]
    notes = [Warned(name, str(text).removeprefix(f"{name}: ")) for name, row in rows.items() for text in row.get("notes") or []]
    return {"Warnings": sorted(warnings, key=lambda one: GRAVEST.index(one.severity) if one.severity in GRAVEST else len(GRAVEST)),
            "Notes": notes}


def explain_partial_run(results: Results) -> str:
    """A sentence on a run that ended early without failing, and on results that it has left behind; empty otherwise."""
    if not results.has_run:
        return f"There is no readable {RUN} here: times, warnings and parameters of the run are unknown."
    words = []
    left = [name for name in results.order if name not in results.rows]
    if left and not results.failed:
        words.append(f"This run ended before {', '.join(left)}, as it was told to or because it was interrupted.")
    if stale := [name for name in results.order if (results.result(name) or {}).get("stale")]:
        words.append(f"Not of the last run's inputs: {', '.join(stale)}. Run again without --until to bring all up to date.")
    return " ".join(words)


def has_viewer(results: Results) -> bool:
    """Whether export made the viewer page."""
    return any(file["name"] == "viewer.html" for file in list_exports(results)["files"])


def list_exports(results: Results) -> dict[str, Any]:
    """Files of export: name, bytes, relative address; or why there are none."""
    words = {"viewer.html": "the avatar in a page: opens from disk, turns and moves",
             "avatar.gsac": "the avatar: body, gaussians, skinning, motions",
             "avatar.ply": "gaussians in one pose, for 3DGS viewers",
             "avatar.glb": "skinned mesh with expressions, and the gaussians", "avatar.spz": "gaussians in one pose, packed",
             "avatar.fbx": "skinned mesh with expressions", "unity": "Unity package"}
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


def run_date(results: Results) -> str:
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
    (AVATAR, "The avatar", "", "train/heldout/views.png", lambda paint: paint.turn.turn_sheet(paint.results)),
    ("clip", "The clip", "Frames that the stages read, evenly through the clip.", "split/frames",
     lambda paint: paint.sheets.contact_sheet(paint.run)),
    ("keypoints", "Keypoints", "What the detector saw. A ring is a point filled by its neighbours in time; "
     "a cross marks the wrist of a hand that is missing.", "keypoints/keypoints.npz",
     lambda paint: paint.sheets.keypoint_sheet(paint.run),
     lambda paint: [paint.charts.strip_chart(paint.run.keypoints, paint.run.face_valid)]),
    ("alpha", "Cut-out", "The person over magenta: what is pink inside the person, or not pink outside, is "
     "wrong.", "segment/alpha", lambda paint: paint.sheets.alpha_sheet(paint.run)),
    ("body", "Fitted body", "The body model over the frames, half transparent. Dots are detected points, "
     "white rings the body's own, lines their distance.", "smplx/body.npz",
     lambda paint: paint.sheets.body_sheet(paint.run)),
    ("heldout", "Held-out frames", "Truth, render and error (black none, yellow half of the full range) of "
     "frames that training never saw.", "train/heldout", lambda paint: paint.sheets.heldout_sheet(paint.results)),
    ("faces", "Faces", "Truth on the left, render on the right, of held-out frames, a pixel of the picture for each pixel of the "
     "frame.", "train/heldout", lambda paint: paint.sheets.face_sheet(paint.results)),
    ("views", "From all sides", "The avatar in its T-pose, from directions that the camera may never have "
     "had.", "train/heldout/views.png", lambda paint: paint.sheets.views_sheet(paint.results)),
    (TRAINING, "Training", "How training went, over its seconds, without the time for judging.", "train/metrics.json", None,
     lambda paint: training_charts(paint.results, paint.charts)),
)
"""Name, title, lead, port, function that draws the pictures, and function that draws the charts."""
