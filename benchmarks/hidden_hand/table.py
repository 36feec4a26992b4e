"""The table of arms whose hand is hidden."""

from __future__ import annotations

from gsac.benchmarks.hidden_hand.score import BARS, Row

HEAD = (f"{'clip':<14} wrist mm  elbow mm  skin inside  seen: wrist  elbow  joints mm  "
        "cpu s  misses; said")


def text(rows: list[Row]) -> str:
    """A line for each clip, and the bars."""
    lines = [f"{r.name:<14} {r.wrist_mm:8.1f} {r.elbow_mm:9.1f} {r.skin_inside:12.3f} {r.wrist_seen_mm:12.1f} "
             f"{r.elbow_seen_mm:6.1f} {r.joints_mm:10.2f} {r.cpu_s:6.1f}  {', '.join(r.misses) or '-'}; {r.said or '-'}"
             for r in rows]
    bars = f"{'bar':<14} {BARS['wrist_mm']:8.1f} {BARS['elbow_mm']:9.1f} {BARS['skin_inside']:12.3f}"
    return "\n".join([HEAD, *lines, bars])
