"""Parameters of handgap."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from gsac.stages.contract import BadInput

Method = Literal["turning", "gp", "hermite", "paper", "paper-literal", "none"]
Rule = Literal["places", "paper"]


@dataclass
class HandgapConfig:
    method: Method = "turning"
    """How the arm moves through a gap. turning: one Gaussian process of the arm's joint rotations in the frame of the turning body;
    gp: a Gaussian process of each segment in the image; hermite: a cubic with the speeds at both ends; paper: each segment turns at
    a constant rate; paper-literal: the paper's equations exactly as printed; none: no hand is taken for missing, and detections
    stay as they are."""
    rule: Rule = "places"
    """Which hands are missing. places: those with low scores, and those detected in a wrong place; paper: those whose wrist and
    palm both score below lost_score, with wrist and elbow."""
    seen_score: float = 0.5
    """Score from which on a lost hand counts as seen again."""
    lost_score: float = 0.3
    """Score below which a seen hand counts as lost."""
    min_seen: int = 3
    """Fewest frames in a row that a hand must be seen inside a longer gap; shorter runs are false detections."""
    max_gap_s: float = 5.0
    """Longest gap, s, that is filled; longer ones stay missing."""
    max_hold_s: float = 4.5
    """Longest time, s, from the nearest seen arm that is filled at the clip's start and end: method turning carries the arm on with
    the body, the others hold it still; beyond it the hand stays missing."""

    def check(self) -> None:
        if not 0 <= self.lost_score <= self.seen_score <= 1:
            raise BadInput(f"handgap.lost_score is {self.lost_score} and handgap.seen_score is {self.seen_score}; "
                           "expected 0 <= lost_score <= seen_score <= 1")
        if self.min_seen < 1:
            raise BadInput(f"handgap.min_seen is {self.min_seen}; expected at least 1 frame")
        for name in ("max_gap_s", "max_hold_s"):
            if not getattr(self, name) >= 0:
                raise BadInput(f"handgap.{name} is {getattr(self, name)}; expected seconds, 0 or more")
