"""Both methods on the same input: by how much the default retains more, by each one's own clean clip and by one yardstick."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from gsac.benchmarks.stability.outcome import retain
from gsac.benchmarks.stability.trial import CLEAN, DEFAULT, PAPER, End, Trial

NOISE = 0.02
"""Retained quality by which a method may be behind without being worse."""


@dataclass(frozen=True)
class Pair:
    """Retained by the default less retained by the paper's method, after one fault."""

    fault: str
    severity: int
    by_own: float
    """1 is each method's own clean clip: who is worse without any fault has less to lose."""
    by_one: float
    """1 is the better of both clean clips."""


def find_pairs(trials: Iterable[Trial]) -> list[Pair]:
    """Of all inputs that both methods have tried, and whose clean clips they have."""
    trials = list(trials)
    clean = {(t.clip, t.method): t for t in trials if t.fault == CLEAN and t.end is End.DONE}
    found = {(t.clip, t.fault, t.severity, t.seed, t.method): t for t in trials if t.fault != CLEAN}
    out = []
    for (clip, fault, severity, seed, method), ours in found.items():
        theirs = found.get((clip, fault, severity, seed, PAPER))
        own, other = clean.get((clip, DEFAULT)), clean.get((clip, PAPER))
        if method != DEFAULT or theirs is None or own is None or other is None:
            continue
        best = max(own, other, key=_quality)
        out.append(Pair(fault, severity, retain(ours, own) - retain(theirs, other), retain(ours, best) - retain(theirs, best)))
    return out


def describe_pairs(pairs: list[Pair]) -> list[str]:
    """A sentence for each yardstick; none without pairs."""
    if not pairs:
        return []
    return [f"{DEFAULT} less {PAPER} on the same input, {len(pairs)} pairs, {words}: median {np.median(ahead):+.2f}, least "
            f"{min(ahead):+.2f}, behind by over {NOISE} in {sum(a < -NOISE for a in ahead)}"
            for words, ahead in (("each by its own clean clip", [p.by_own for p in pairs]),
                                 ("by the better clean clip", [p.by_one for p in pairs]))]


def _quality(clean: Trial) -> float:
    """Larger is better: held-out dB, or the mean joint error's opposite."""
    return clean.psnr if clean.psnr is not None else -(clean.mean_mm or np.inf)
