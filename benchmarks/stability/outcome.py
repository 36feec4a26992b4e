"""What trials come to: retained quality, silent failures, and a fault's area under its curve."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from gsac.benchmarks.stability.fault import SEVERITIES
from gsac.benchmarks.stability.trial import CLEAN, WORST, End, Trial
from gsac.stages.severity import Severity

BREAKDOWN = 0.8
"""Retained quality below which a clip has failed: over a fifth is lost."""
NO_RESULT = (End.CRASHED, End.HUNG)
TWICE = 2.0
"""Times the clean clip's error from which on a fault breaks the fit, whatever is retained."""


@dataclass(frozen=True)
class Outcome:
    """A trial beside the clean clip's of the same method."""

    trial: Trial
    error_ratio: float | None
    """Mean joint error over the clean clip's; None without a fit."""
    retained: float
    """1: as the clean clip; 0: a body that stands still, a person in one colour, or no result."""
    failed: bool
    """Over a fifth of the quality is lost, or a joint is off in five frames in which it is not in the clean clip."""
    said: tuple[str, ...]
    """Codes that the clean clip does not have in those frames, whose frames overlap with what went wrong."""

    warned: bool | None
    """Whether `gsac check` has a code for the clip that it does not have for the clean one; None for faults of artifacts."""

    @property
    def foretold(self) -> bool | None:
        """Whether the check agrees with the run: both find something, or neither does."""
        return None if self.warned is None else self.warned == (self.failed or bool(self.said))

    @property
    def silent(self) -> bool:
        """It failed, and nobody said so."""
        return self.failed and not self.said and self.trial.end is End.DONE


def find_outcomes(trials: Iterable[Trial]) -> list[Outcome]:
    """Outcomes of all trials with a fault whose clean clip was tried, too."""
    trials = list(trials)
    clean = {(t.clip, t.method): t for t in trials if t.fault == CLEAN and t.end is End.DONE}
    return [find_outcome(t, clean[t.clip, t.method]) for t in trials if t.fault != CLEAN and (t.clip, t.method) in clean]


def find_outcome(trial: Trial, clean: Trial) -> Outcome:
    """A trial beside the same clip and method without a fault."""
    share = retain(trial, clean)
    off = {n for name, frames in trial.off.items() if len(own := {*frames} - {*clean.off.get(name, ())}) >= WORST for n in own}
    ratio = trial.mean_mm / clean.mean_mm if trial.mean_mm and clean.mean_mm else None
    warned = None if trial.checked is None or trial.end in NO_RESULT else bool({*trial.checked} - {*(clean.checked or ())})
    return Outcome(trial, ratio, share, share < BREAKDOWN or bool(off), find_codes(trial, clean, off), warned)


def retain(trial: Trial, clean: Trial) -> float:
    """Retained quality, 0 to 1: of held-out dB where both were trained, else of the mean joint error.

    A fault after which no frame is judged retains nothing.
    """
    if trial.end is not End.DONE:
        return 0.0
    if trial.psnr is not None and clean.psnr is not None and clean.flat_psnr is not None:
        value, best, worst = trial.psnr, clean.psnr, clean.flat_psnr
    elif trial.mean_mm is not None and clean.mean_mm is not None and clean.still_mm is not None:
        value, best, worst = trial.mean_mm, clean.mean_mm, clean.still_mm
    else:
        return 0.0
    return float(np.clip((value - worst) / (best - worst), 0, 1))


def find_codes(trial: Trial, clean: Trial, off: set[int]) -> tuple[str, ...]:
    """Codes, beyond those of the clean clip and mere news, that name the whole clip or a frame that is off or touched by the fault.

    off: frames in which a joint is off.
    """
    wrong = off | set(trial.touched)
    known: dict[str, set[int]] = {}
    for finding in clean.findings:
        known.setdefault(finding["code"], set()).update(finding["frames"])
    out = []
    for finding in trial.findings:
        fresh = {*finding["frames"]} - known.get(finding["code"], set())
        new = bool(fresh & wrong) or (bool(fresh) and not wrong) if finding["frames"] else finding["code"] not in known
        if new and finding["severity"] != Severity.NEWS:
            out.append(finding["code"])
    return tuple(dict.fromkeys(out))


@dataclass(frozen=True)
class Curve:
    """Retained quality of one fault and method over severities."""

    fault: str
    method: str
    severities: tuple[int, ...]
    retained: tuple[float, ...]
    """Mean of all clips and seeds at each of severities; 1 at severity 0."""
    errors: tuple[float, ...]
    """Likewise the joint error over the clean clip's, of trials that gave a fit; infinite without one."""
    silent: int
    """Trials."""
    crashed: int
    refused: int
    trials: int
    checked: int
    """Trials of which `gsac check` has a say."""
    foretold: int
    """Those in which it agrees with the run."""

    @property
    def area(self) -> float:
        """Under the curve, 0 to 1; between severities that were tried it runs straight."""
        return float(np.trapezoid(np.interp(SEVERITIES, self.severities, self.retained), SEVERITIES) / SEVERITIES[-1])

    @property
    def breakdown(self) -> int | None:
        """The first severity at which over a fifth is lost or the joint error is over twice the clean clip's."""
        rows = zip(self.severities, self.retained, self.errors, strict=True)
        return next((s for s, share, error in rows if share < BREAKDOWN or error > TWICE), None)


def draw_curves(outcomes: list[Outcome]) -> list[Curve]:
    """A curve for each fault and method, in the order of the outcomes."""
    groups: dict[tuple[str, str], list[Outcome]] = {}
    for outcome in outcomes:
        groups.setdefault((outcome.trial.fault, outcome.trial.method), []).append(outcome)
    return [_curve(fault, method, some) for (fault, method), some in groups.items()]


def _curve(fault: str, method: str, some: list[Outcome]) -> Curve:
    tried = sorted({o.trial.severity for o in some})
    means = [float(np.mean([o.retained for o in some if o.trial.severity == severity])) for severity in tried]
    errors = [_mean_ratio([o for o in some if o.trial.severity == severity]) for severity in tried]
    crashes = sum(o.trial.end in NO_RESULT for o in some)
    return Curve(fault, method, (0, *tried), (1.0, *means), (1.0, *errors), sum(o.silent for o in some), crashes,
                 sum(o.trial.end is End.REFUSED for o in some), len(some), sum(o.foretold is not None for o in some),
                 sum(bool(o.foretold) for o in some))


def _mean_ratio(some: list[Outcome]) -> float:
    known = [o.error_ratio for o in some if o.error_ratio is not None]
    return float(np.mean(known)) if known else np.inf
