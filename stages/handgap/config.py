"""Parameters of handgap."""

from __future__ import annotations

from dataclasses import dataclass

from gsac.stages.contract import BadInput

METHODS = ("turning", "gp", "hermite", "paper", "paper-literal")


@dataclass
class HandgapConfig:
    method: str = "turning"
    """How the arm moves through a gap: turning (small rotations of the arm's joints, one Gaussian process in the frame of the
    turning body), gp (Gaussian process in the image), hermite (cubic with the speeds at both ends), paper (constant rate of
    each segment's angle), paper-literal (the same as printed)."""
    seen_score: float = 0.5
    """A hand counts as seen again from this score on."""
    lost_score: float = 0.3
    """A hand that was seen counts as lost below this score."""
    min_seen: int = 3
    """Frames that a hand must be seen in a row inside a longer gap to be believed."""
    max_gap_s: float = 5.0
    """Longer gaps stay missing."""
    max_hold_s: float = 4.5
    """At the clip's start and end, how far from the nearest seen arm one is still put: carried on by the turning body, or
    held, by the other methods; what is further away stays missing."""

    def check(self) -> None:
        if self.method not in METHODS:
            raise BadInput(f"handgap.method is {self.method!r}; expected one of {', '.join(METHODS)}")
        if not 0 <= self.lost_score <= self.seen_score <= 1:
            raise BadInput(f"handgap.lost_score is {self.lost_score} and handgap.seen_score is {self.seen_score}; "
                           "expected 0 <= lost_score <= seen_score <= 1")
        if self.min_seen < 1:
            raise BadInput(f"handgap.min_seen is {self.min_seen}; expected at least 1 frame")
        for name in ("max_gap_s", "max_hold_s"):
            if not getattr(self, name) >= 0:
                raise BadInput(f"handgap.{name} is {getattr(self, name)}; expected seconds, 0 or more")
