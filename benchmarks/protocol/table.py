"""Our row and the published ones, by one protocol."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from gsac.benchmarks.protocol.protocols import Protocol, Row

COLUMNS = {"PSNR": ".3f", "SSIM": ".4f", "LPIPS": ".4f"}
"""Heading -> format."""


def figures(metrics: dict, protocol: Protocol) -> tuple[float | None, float | None, float | None]:
    """PSNR, SSIM and LPIPS of a training as the protocol defines them; None for what was not measured. metrics: metrics.json."""
    end = "_ttpo" if protocol.aligned else ""
    ground = "_black" if protocol.black else ""
    shown = metrics["heldout"]

    def values(name: str) -> list[float] | None:
        found = [row.get(f"{name}{end}") for row in shown]
        return None if not found or any(value is None for value in found) else found

    def mean(name: str) -> float | None:
        found = values(name)
        return None if found is None else float(np.mean(found))

    return mean_of_batches(values(f"psnr_full{ground}"), protocol.batch), mean(f"ssim{ground}"), mean(protocol.lpips)


def mean_of_batches(psnr: list[float] | None, batch: int | None) -> float | None:
    """dB: images' PSNR, whose errors are pooled within each batch (None: all) before the mean over batches is taken."""
    if not psnr:
        return None
    error = 10 ** (-np.array(psnr) / 10)
    size = batch or len(error)
    return float(np.mean([-10 * np.log10(error[at:at + size].mean()) for at in range(0, len(error), size)]))


def cells(metrics: Iterable[dict], protocol: Protocol) -> list[str]:
    """Mean and spread over trainings for each column; a dash where one was not measured."""
    out = []
    for found, form in zip(zip(*(figures(one, protocol) for one in metrics), strict=True), COLUMNS.values(), strict=True):
        values = [value for value in found if value is not None]
        if len(values) < len(found):
            out.append("-")
            continue
        spread = f" +- {np.std(values, ddof=1):{form}}" if len(values) > 1 else ""
        out.append(f"{np.mean(values):{form}}{spread}")
    return out


def published(row: Row) -> list[str]:
    """The columns of a published row."""
    return ["-" if value is None else f"{value:{form}}"
            for value, form in zip((row.psnr, row.ssim, row.lpips), COLUMNS.values(), strict=True)]


def text(rows: dict[str, list[dict]], protocol: Protocol) -> str:
    """The table. rows: subject -> metrics.json of each training."""
    lines = [("subject", "system", *COLUMNS, "source")]
    for subject, metrics in rows.items():
        recipe, frames = metrics[0]["recipe"], len(metrics[0]["heldout_frames"])
        lines.append((subject, f"ours, recipe {recipe}", *cells(metrics, protocol),
                      f"this run: {len(metrics)} seeds, {frames} test frames at {metrics[0]['image_size'][1]} px"))
        lines += [(subject, row.system, *published(row), row.source) for row in protocol.rows.get(subject, ())]
    if len(rows) > 1 and "mean" in protocol.rows:
        every = [metrics for found in zip(*rows.values(), strict=True) for metrics in found]
        lines.append(("mean", "ours", *(cell.partition(" ")[0] for cell in cells(every, protocol)), "this run"))
    if "mean" in protocol.rows:
        lines += [("mean", row.system, *published(row), row.source) for row in protocol.rows["mean"]]
    unknown = [subject for subject in rows if subject not in protocol.rows and "mean" not in protocol.rows]
    widths = [max(len(line[c]) for line in lines) for c in range(len(lines[0]))]
    out = ["  ".join(cell.ljust(w) for cell, w in zip(line, widths, strict=True)).rstrip() for line in lines]
    notes = [protocol.describe() + "."] + [f"Nothing was published of {subject} by this protocol." for subject in unknown]
    return "\n".join([notes[0], "", out[0], "-" * len(out[0]), *out[1:], *notes[1:]])
