"""Figures of a run beside its outputs: seconds, and the step it went on from. Another run of the key would not repeat them."""

from __future__ import annotations

from typing import Any


def add_timings(metrics: dict[str, Any], timings: dict[str, Any]) -> dict[str, Any]:
    """The metrics with the timings among them; a list of rows that both have is joined row by row."""
    return metrics | {name: _join(metrics.get(name), value) for name, value in timings.items()}


def _join(ours: Any, added: Any) -> Any:
    if not (isinstance(ours, list) and isinstance(added, list) and len(ours) == len(added)):
        return added if ours is None else ours
    return [row | more if isinstance(row, dict) and isinstance(more, dict) else row for row, more in zip(ours, added, strict=True)]
