"""Charts as inline SVG that takes its colours from the page."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup, escape

from gsac.avatar.wholebody import BODY, HANDS
from gsac.pipeline.report.pictures import SEEN
from gsac.pipeline.report.results import number
from gsac.pipeline.report.sheets import is_part_seen

W, H = 480, 260
LEFT, RIGHT, TOP, BOTTOM = 54, 14, 26, 40
ROW, STRIP_LEFT, STRIP_W = 20, 84, 880


@dataclass
class Axis:
    """Maps values low..high to pixels start..end."""

    low: float
    high: float
    start: float
    end: float
    log: bool = False

    def __call__(self, value: float) -> float:
        a, b, v = (math.log10(x) for x in (self.low, self.high, value)) if self.log else (self.low, self.high, value)
        return self.start + (v - a) / (b - a) * (self.end - self.start)

    def ticks(self) -> list[float]:
        """Round values between low and high."""
        if self.log:
            decades = range(math.ceil(math.log10(self.low) - 1e-9), math.floor(math.log10(self.high) + 1e-9) + 1)
            return [m * 10.0**d for d in range(min(decades, default=0) - 1, max(decades, default=0) + 1)
                    for m in (1, 2, 5) if self.low * (1 - 1e-9) <= m * 10.0**d <= self.high * (1 + 1e-9)]
        step = nice(self.high - self.low)
        first = math.ceil(self.low / step - 1e-9)
        return [step * i for i in range(first, math.floor(self.high / step + 1e-9) + 1)]


def nice(length: float) -> float:
    """A round step that divides the length into about six."""
    rough = length / 5
    decade = 10 ** math.floor(math.log10(rough))
    return next(m * decade for m in (1, 2, 5, 10) if m * decade >= rough * 0.7)


def curve_chart(curve: list, key: str, title: str, unit: str, log: bool = False) -> Markup | None:
    """One line over the seconds of training. curve: rows of metrics.json; None where fewer than two carry `key`."""
    points = [(number(row.get("seconds")), number(row.get(key))) for row in curve if isinstance(row, dict)]
    points = [(x, y) for x, y in points if x is not None and y is not None and (y > 0 or not log)]
    if len(points) < 2 or points[0][0] == points[-1][0]:
        return None
    xs, ys = zip(*points, strict=True)
    pad = (max(ys) - min(ys)) * 0.08 or abs(ys[0]) * 0.1 or 1.0
    low, high = (min(ys) / 1.15, max(ys) * 1.15) if log else (min(ys) - pad, max(ys) + pad)
    x, y = Axis(0.0, max(xs), LEFT, W - RIGHT), Axis(low, high, H - BOTTOM, TOP, log)
    out = [f'<svg class="chart" viewBox="0 0 {W} {H}" role="img" aria-label="{escape(title)} over seconds of training">',
           f'<text class="title" x="{LEFT}" y="16">{escape(title)}{f" ({escape(unit)})" if unit else ""}</text>']
    out += [f'<line class="grid" x1="{LEFT}" x2="{W - RIGHT}" y1="{y(v):.1f}" y2="{y(v):.1f}"/>'
            f'<text class="end" x="{LEFT - 6}" y="{y(v) + 4:.1f}">{v:.3g}</text>' for v in y.ticks()]
    out += [f'<text class="mid" x="{x(v):.1f}" y="{H - BOTTOM + 18}">{v:.3g}</text>' for v in x.ticks()]
    out.append(f'<text class="mid" x="{(LEFT + W - RIGHT) / 2}" y="{H - 6}">seconds of training</text>')
    path = " ".join(f"{x(a):.1f},{y(b):.1f}" for a, b in points)
    out.append(f'<polyline class="line" points="{path}"/>')
    out += [f'<circle class="dot" cx="{x(a):.1f}" cy="{y(b):.1f}" r="2.6"><title>{a:.0f} s: {b:.4g}</title></circle>'
            for a, b in points]
    return Markup("".join(out) + "</svg>")


def strip_chart(k: dict[str, np.ndarray], face_valid: np.ndarray | None) -> Markup:
    """Frame by frame: body, hands and face found, filled, missing.

    k: arrays of keypoints.npz, (T, 133, ...); face_valid: (T,) bool, None where the face's stage left nothing.
    """
    body = np.where((k["score"][:, BODY] >= SEEN).mean(1) >= 0.5, "found", "missing")
    rows = [("body", body)]
    for side, part in HANDS.items():
        words = np.where(is_part_seen(k, part), "found", "missing")
        if "filled" in k:
            words = np.where(k["filled"][:, part].any(1), "filled", words)
        rows.append((f"{side} hand", words))
    if face_valid is not None:
        rows.append(("face used", np.where(face_valid.astype(bool), "found", "missing")))
    count = len(body)
    x = Axis(0, max(count, 1), STRIP_LEFT, STRIP_W)
    high = ROW * len(rows) + 26
    out = [f'<svg class="strip" viewBox="0 0 {STRIP_W + 12} {high}" role="img" aria-label="What was found in which frame">']
    for i, (name, words) in enumerate(rows):
        out.append(f'<text class="end" x="{STRIP_LEFT - 8}" y="{i * ROW + 14}">{name}</text>')
        starts = [0, *(np.flatnonzero(words[1:] != words[:-1]) + 1).tolist(), count]
        for a, b in zip(starts, starts[1:], strict=False):
            if b > a:
                span = f"frame {a}" if b == a + 1 else f"frames {a} to {b - 1}"
                out.append(f'<rect class="{words[a]}" x="{x(a):.1f}" y="{i * ROW + 2}" width="{x(b) - x(a):.1f}" '
                           f'height="{ROW - 5}"><title>{name} {words[a]}, {span}</title></rect>')
    ticks = sorted({0, *(int(t) for t in Axis(0, max(count - 1, 1), 0, 1).ticks()), count - 1})
    out += [f'<text class="mid" x="{x(v + 0.5):.1f}" y="{high - 6}">{v}</text>'
            for v in ticks if v == count - 1 or v <= (count - 1) * 0.94]
    return Markup("".join(out) + "</svg>")
