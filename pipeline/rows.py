"""Rows of run.json: one a stage whose result lies in the folder of a run, whichever command put it there.

A command brings rows of the stages that it judged. The row of another stage stays while its outputs are in the folder; where
what it was made from is no longer what lies there, it says so: `stale`, and `stale_reason`.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gsac.cache.digest import tree_digest
from gsac.cache.errors import CacheError
from gsac.cache.store import Store
from gsac.pipeline.graph import CLIP, Graph
from gsac.pipeline.outcomes import Outcome
from gsac.pipeline.run_folder import METRICS, RUN, RunFolder
from gsac.pipeline.timings import add_timings

Row = dict[str, Any]

LASTING = ("quality", "forecast")
"""Entries of run.json that stay until a command gives others: the preset of the last run, and the last forecast beside what its
stages took."""
DONE = (Outcome.RAN.value, Outcome.CACHED.value)


def read_json(path: Path) -> Any:
    """None where it cannot be read."""
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError):
        return None


def rows_of(run: Any) -> dict[str, Row]:
    """Stage -> row of the object of run.json, in running order; what is not a row is left out."""
    rows = run.get("stages") if isinstance(run, dict) else None
    return {str(row["name"]): row for row in (rows if isinstance(rows, list) else []) if isinstance(row, dict) and "name" in row}


def result_row(row: Row | None) -> Row | None:
    """The row of the result that lies in the folder: the stage's own, or, where the stage failed, the earlier one."""
    found = [row, (row or {}).get("earlier")]
    return next((row for row in found if isinstance(row, dict) and row.get("status") in DONE), None)


def write_rows(folder: RunFolder, graph: Graph, store: Store, fresh: list[Row], entries: Row) -> None:
    """Writes run.json and metrics.json of what lies in the folder. fresh: rows of this command; entries: `clip` and `clip_digest`
    of run.json, and those of `LASTING` that this command gives."""
    before = read_json(folder.root / RUN)
    lasting = {name: before[name] for name in LASTING if name in before} if isinstance(before, dict) else {}
    rows = merge_rows(folder, graph, store, fresh, rows_of(before))
    ports = [port for row in rows if result_row(row) is not None for port in graph.step(row["name"]).outs]
    metrics = folder_metrics(folder, ports, {row["name"]: timings_of(row) for row in rows})
    folder.write_json(RUN, {**lasting, **entries, "stages": rows, "outputs": folder.outputs(ports), "metrics": metrics})
    folder.write_json(METRICS, metrics)


def clip_entries(folder: RunFolder, store: Store) -> Row:
    """Entries of run.json on the folder's clip: `clip`, its path, and `clip_digest`, kept where the clip itself is gone."""
    before = read_json(folder.root / RUN)
    known = before.get("clip_digest") if isinstance(before, dict) else None
    return {"clip": str(folder.clip.resolve()), "clip_digest": port_digest(folder, CLIP, store) or known}


def folder_metrics(folder: RunFolder, ports: list[str], timings: dict[str, Row]) -> Row:
    """Metrics of the results at these ports, all stages' in one object, with the timings of the runs that made them.

    timings: by stage.
    """
    metrics: Row = {}
    for port in ports:
        stage, _, output = port.partition("/")
        content = read_json(folder.path(port)) if output == METRICS else None
        if isinstance(content, dict):
            metrics |= add_timings(content, timings.get(stage, {}))
    return metrics


def timings_of(row: Row | None) -> Row:
    """The timings of the result that a row speaks of; {} where it has none."""
    timings = (result_row(row) or {}).get("timings")
    return timings if isinstance(timings, dict) else {}


def merge_rows(folder: RunFolder, graph: Graph, store: Store, fresh: list[Row], before: dict[str, Row]) -> list[Row]:
    """Rows of the folder after a command, in running order. fresh: those of the stages that it judged; before: stage -> row."""
    judged = {row["name"]: row for row in fresh}
    known = {port: digest for row in fresh for port, digest in row["outputs"].items()}
    lying = functools.cache(lambda port: known.get(port) or port_digest(folder, port, store))
    rows: list[Row] = []
    causes: dict[str, list[str]] = {}
    for name, step in graph.steps.items():
        row = judged.get(name)
        failed = row is not None and row["status"] not in DONE
        result = _kept(result_row(before.get(name)), step.outs, lying) if row is None or failed else row
        if result is not None:
            above = {port for parent in graph.parents(name) for port in causes.get(parent, [])}
            causes[name] = _changed(result, "inputs", lying) or sorted(above)
            result = result | _staleness(causes[name], _changed(result, "outputs", lying))
        if row is not None and failed:
            result = row | ({"earlier": result} if result is not None else {})
        rows += [result] if result is not None else []
    return rows


def read_rows(folder: RunFolder) -> dict[str, Row]:
    """Stage -> row of the folder's run.json; {} without one."""
    return rows_of(read_json(folder.root / RUN))


def stale_reasons(folder: RunFolder) -> dict[str, str]:
    """Stage -> why, of the results in the folder that are not up to date."""
    results = {name: result_row(row) or {} for name, row in read_rows(folder).items()}
    return {name: str(row.get("stale_reason")) for name, row in results.items() if row.get("stale")}


def port_digest(folder: RunFolder, port: str, store: Store) -> str | None:
    """Tree digest of what lies at a port; None where nothing lies there that can be read."""
    path = folder.path(port)
    try:
        return tree_digest(path.resolve(), store.memo)[0] if path.exists() else None
    except (OSError, CacheError):
        return None


def _kept(row: Row | None, outs: tuple[str, ...], lying: Callable[[str], str | None]) -> Row | None:
    """The row of a stage that the command did not touch; None where an output is gone."""
    if row is None or any(lying(port) is None for port in outs):
        return None
    return {key: value for key, value in row.items() if key not in ("stale", "stale_reason")} | {"status": Outcome.CACHED.value}


def _changed(row: Row, ports: str, lying: Callable[[str], str | None]) -> list[str]:
    """Of the row's `inputs` or `outputs` those that are no longer what lies in the folder."""
    digests = row.get(ports)
    return [port for port, digest in digests.items() if lying(port) not in (None, digest)] if isinstance(digests, dict) else []


def _staleness(inputs: list[str], outputs: list[str]) -> Row:
    """What a row says whose inputs are others by now, or whose outputs were written over."""
    if inputs:
        return {"stale": True, "stale_reason": f"made from an earlier {' and '.join(inputs)}; run again"}
    if outputs:
        return {"stale": True, "stale_reason": f"{' and '.join(outputs)} was changed since the stage wrote it; run again"}
    return {}
