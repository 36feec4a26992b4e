"""The metrics as a table, mean and spread over the repeats, and as CSV."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from gsac.stages.contract import BadInput

COLUMNS = {"time, s": ("seconds", ".0f"), "gaussians": ("n_gaussians", ".0f"), "PSNR": ("psnr_full_black", ".3f"),
           "SSIM": ("ssim_black", ".4f"), "LPIPS": ("lpips_black", ".4f"), "PSNR person": ("psnr_fg", ".2f"),
           "PSNR hands": ("psnr_hands", ".2f"), "pose aligned": ("psnr_fg_ttpo", ".2f")}
"""Heading -> name in metrics.json, and format."""
NAMES = tuple(name for name, _ in COLUMNS.values())
HEAD = ("clip", "fill", "seed", *NAMES)
"""Columns of the CSV."""
Rows = dict[tuple[str, str], list[dict]]
"""(clip, fill) -> metrics.json of each repeat."""


def spread(metrics: list[dict], name: str) -> tuple[float, float] | None:
    """Mean and standard deviation over repeats; None if a repeat lacks the metric."""
    values = [m.get(name) for m in metrics]
    if any(value is None for value in values):
        return None
    return float(np.mean(values)), float(np.std(values, ddof=1)) if len(values) > 1 else 0.0


def cells(metrics: list[dict]) -> list[str]:
    """Mean and spread for each column; a dash if it was not measured."""
    out = []
    for name, form in COLUMNS.values():
        found = spread(metrics, name)
        out.append("-" if found is None else f"{found[0]:{form}} +- {found[1]:{form}}")
    return out


def text(rows: Rows) -> str:
    """The table."""
    table = [("clip", "hands", *COLUMNS)] + [(clip, fill, *cells(metrics)) for (clip, fill), metrics in rows.items()]
    widths = [max(len(row[c]) for row in table) for c in range(len(table[0]))]
    lines = ["  ".join(cell.rjust(w) for cell, w in zip(row, widths, strict=True)) for row in table]
    return "\n".join([lines[0], "-" * len(lines[0]), *lines[1:]])


def join(*sheets: Rows, order: list[str]) -> Rows:
    """The rows of several sheets by clip and, as in `order`, fill; of a row that is in several, that of the last."""
    found = {key: metrics for sheet in sheets for key, metrics in sheet.items()}
    return {key: found[key] for key in sorted(found, key=lambda key: (key[0], order.index(key[1])))}


def write_csv(rows: Rows, path: Path) -> None:
    """Writes a row for each repeat."""
    with open(path, "w", newline="") as f:
        sheet = csv.writer(f)
        sheet.writerow(HEAD)
        for (clip, fill), metrics in rows.items():
            sheet.writerows([clip, fill, seed, *(m.get(name) for name in NAMES)] for seed, m in enumerate(metrics))


def read_csv(path: Path) -> Rows:
    """Reads what `write_csv` wrote. Raises BadInput with the names of missing columns."""
    with open(path, newline="") as f:
        lines = list(csv.DictReader(f))
    if not lines or (missing := set(HEAD) - set(lines[0])):
        raise BadInput(f"{path}: " + (f"there is no column {', '.join(sorted(missing))}" if lines else "there is no row")
                       + "; give the paper_table.csv of another `gsac bench paper-table`")
    out: Rows = {}
    for line in lines:
        out.setdefault((line["clip"], line["fill"]), []).append({name: float(line[name]) if line[name] else None for name in NAMES})
    return out
