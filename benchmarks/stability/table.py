"""Trials as lines, as a table and as CSV."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from gsac.benchmarks.stability.fault import SEVERITIES
from gsac.benchmarks.stability.outcome import Curve, Outcome
from gsac.benchmarks.stability.trial import End, Trial

HEAD = ("fault", "method", "area", "breaks at", "retained at 1 to 5", "error over clean's", "silent", "crashed", "refused",
        "trials")
SHEET = ("clip", "fault", "severity", "seed", "method", "end", "retained", "failed", "silent", "said", "warned", "mean_mm",
         "worst_mm", "kept", "frames", "psnr", "seconds", "cpu_seconds", "code", "message")
"""Columns of the CSV."""


def text(curves: list[Curve], compared: Iterable[str] = ()) -> str:
    """A row for each fault and method, the worst first, then each method's sum and the sentences that compare them."""
    table = [HEAD, *(_row(c) for c in sorted(curves, key=lambda c: (c.area, c.fault, c.method)))]
    widths = [max(len(row[c]) for row in table) for c in range(len(HEAD))]
    lines = ["  ".join(cell.ljust(w) if c < 2 else cell.rjust(w) for c, (cell, w) in enumerate(zip(row, widths, strict=True)))
             for row in table]
    return "\n".join([lines[0], "-" * len(lines[0]), *lines[1:], "", *sum_up(curves), *compared])


def sum_up(curves: list[Curve]) -> list[str]:
    """A sentence for each method."""
    out = []
    for method in dict.fromkeys(c.method for c in curves):
        some = [c for c in curves if c.method == method]
        worst = min(some, key=lambda c: c.area)
        trials, silent, crashed, refused, checked, foretold = np.sum(
            [(c.trials, c.silent, c.crashed, c.refused, c.checked, c.foretold) for c in some], axis=0)
        out.append(f"{method}: area under the curve, median fault {np.median([c.area for c in some]):.2f}, worst {worst.area:.2f} "
                   f"({worst.fault}); of {trials} trials {silent} failed silently, {crashed} crashed or hung, {refused} ended with "
                   f"a sentence; gsac check agrees on {foretold} of {checked} clips")
    return out


def markdown(curves: list[Curve], compared: Iterable[str] = ()) -> str:
    """The table of docs/lab/stability.md: a row for each fault, the worst first, three columns for each method; then the sums."""
    methods = list(dict.fromkeys(c.method for c in curves))
    by_fault: dict[str, dict[str, Curve]] = {}
    for curve in sorted(curves, key=lambda c: (methods.index(c.method), c.area)):
        by_fault.setdefault(curve.fault, {})[curve.method] = curve
    lines = [f"| fault | {' | '.join(f'{m}: area | breaks at | silent' for m in methods)} |",
             "| --- " * (1 + 3 * len(methods)) + "|"]
    lines += [f"| {fault} | {' | '.join(_brief(own.get(m)) for m in methods)} |" for fault, own in by_fault.items()]
    return "\n".join([*lines, "", *(f"- {sentence}" for sentence in (*sum_up(curves), *compared))]) + "\n"


def write_csv(outcomes: list[Outcome], path: Path) -> None:
    """Writes a row for each trial with a fault."""
    with open(path, "w", newline="") as f:
        sheet = csv.writer(f)
        sheet.writerow(SHEET)
        for o in outcomes:
            own = {"retained": f"{o.retained:.4f}", "failed": int(o.failed), "silent": int(o.silent), "said": " ".join(o.said),
                   "warned": None if o.warned is None else int(o.warned)}
            sheet.writerow([_cell(own[name] if name in own else getattr(o.trial, name)) for name in SHEET])


def add_line(trial: Trial, path: Path) -> None:
    """Appends a trial to a file of lines, so that what is finished stays."""
    with open(path, "a") as f:
        f.write(json.dumps(trial.to_json()) + "\n")


def read_lines(path: Path) -> list[Trial]:
    """The trials of such a file, of whatever code; none without one."""
    if not path.is_file():
        return []
    found = [Trial(**json.loads(line)) for line in path.read_text().splitlines() if line.endswith("}")]
    for trial in found:
        trial.end = End(trial.end)
    return found


def _row(curve: Curve) -> tuple[str, ...]:
    shares = dict(zip(curve.severities, curve.retained, strict=True))
    errors = dict(zip(curve.severities, curve.errors, strict=True))
    return (curve.fault, curve.method, f"{curve.area:.2f}", "-" if curve.breakdown is None else str(curve.breakdown),
            " ".join(f"{shares[s]:.2f}" if s in shares else "  - " for s in SEVERITIES[1:]),
            " ".join(f"{errors[s]:4.1f}" if s in errors else "  - " for s in SEVERITIES[1:]), str(curve.silent), str(curve.crashed),
            str(curve.refused), str(curve.trials))


def _brief(curve: Curve | None) -> str:
    """Area, severity of breakdown and silent failures of a curve, as three cells."""
    if curve is None:
        return " | ".join("-" * 3)
    return f"{curve.area:.2f} | {curve.breakdown or '-'} | {f'{curve.silent} of {curve.trials}' if curve.silent else '-'}"


def _cell(value: object) -> object:
    return f"{value:.2f}" if isinstance(value, float) else "" if value is None else value
