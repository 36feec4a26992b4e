"""The verdict: likeness of body, face and hands, how much was seen, how it holds in new poses. Each a grade and a sentence.

Bounds were fitted to judged avatars: docs/lab/verdict.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

from gsac.pipeline.report.advice import BLURRED, DARK, TURN
from gsac.pipeline.report.results import number


class Grade(Enum):
    """word, sign beside the colour, and rank."""

    GOOD = ("good", "✓", 2)
    FAIR = ("fair", "~", 1)
    POOR = ("poor", "✕", 0)
    UNKNOWN = ("not measured", "–", -1)

    def __init__(self, word: str, sign: str, rank: int):
        self.word, self.sign, self.rank = word, sign, rank

    @property
    def title(self) -> str:
        return self.word.capitalize()


SENTENCES = {
    "body": {Grade.GOOD: "Figure and clothes look like the person's.",
             Grade.FAIR: "The person is plainly recognised; patterns and edges of the clothes are soft or a little off.",
             Grade.POOR: "Clothes and outline are blurred or in the wrong place.",
             Grade.UNKNOWN: "No frame was held out to judge by, or an older version made this avatar."},
    "face": {Grade.GOOD: "Eyes, mouth and hair are the person's.",
             Grade.FAIR: "Recognised from a few steps away; close up eyes and mouth are soft.",
             Grade.POOR: "Close up it is smeared: eyes or mouth are not where they belong.",
             Grade.UNKNOWN: "No frame that was held out shows it well enough to judge."},
    "hands": {Grade.GOOD: "Fingers can be told apart.",
              Grade.FAIR: "In the right place; the fingers run together.",
              Grade.POOR: "Smeared, or not where the person's are.",
              Grade.UNKNOWN: "No frame that was held out shows them well enough to judge."},
    "moves": {Grade.GOOD: "Arms up, a squat and a stride leave it whole but for a little fur where cloth folds.",
              Grade.FAIR: "With arms up, in a squat or a stride some gaps or fur show.",
              Grade.POOR: "It tears or grows fur with arms up, in a squat or a stride.",
              Grade.UNKNOWN: "No other pose was tried."},
}
"""What a grade of a part means."""
NAMES = {"body": "Body and clothes", "face": "Face", "hands": "Hands", "seen": "Seen from all sides", "moves": "In new poses"}
LIKENESS = {"body": ("structure", 0.9, 0.8), "face": ("worst", 0.95, 0.86), "hands": ("structure", 0.93, 0.83)}
"""Figure of `judge_likeness`, and the least of it for good and for fair. Of a face its worst frame counts: profiles are easy."""
COLOUR = {"body": (25.0, 20.0), "face": (25.0, 20.0), "hands": (25.0, 25.0)}
"""Least psnr inside, dB, for good and for fair: `structure` is blind to colour."""
LEAST_PX = {"body": 160, "face": 20, "hands": 12}
"""px of person, face and hand in the frames below which nothing better than fair can be told."""
SEEN = (0.9, 0.65)
"""Least share of the surface in view, for good and for fair."""
FACELESS = {"head", "face"}
"""Parts, of `unseen_parts`, without which nothing is like the person."""
TORN = (0.004, 0.012)
"""Most alpha off the body, or missing on it, in poses never seen, over the body's area, for good and for fair."""


@dataclass(frozen=True)
class Part:
    """One line of the verdict."""

    name: str
    grade: Grade
    sentence: str


@dataclass(frozen=True)
class Verdict:
    """The whole: its grade, one line, and its parts."""

    grade: Grade
    line: str
    parts: tuple[Part, ...]


def give_verdict(metrics: dict[str, Any], facts: dict[str, float]) -> Verdict:
    """metrics: train's metrics.json, {} without one; facts: figures of the sheets, as far as measured."""
    grades = {part: grade_likeness(part, metrics, facts) for part in LIKENESS}
    grades |= {"seen": grade_seen(metrics, facts), "moves": grade_moves(metrics)}
    whole = grade_whole(grades, faceless=not FACELESS.isdisjoint(unseen_parts(metrics)))
    parts = tuple(Part(NAMES[part], grade, say_seen(metrics, facts) if part == "seen" else say_part(part, grade, metrics))
                  for part, grade in grades.items())
    return Verdict(whole, say_in_one_line(grades), parts)


def grade_likeness(part: str, metrics: dict[str, Any], facts: dict[str, float]) -> Grade:
    """Of body, face or hands. Blur costs a grade; in dark or too small footage nothing better than fair can be told."""
    figures = (metrics.get("likeness") or {}).get(part) or {}
    name, *bounds = LIKENESS[part]
    value, psnr, size = (number(figures.get(key)) for key in (name, "psnr", "px"))
    if value is None or psnr is None:
        return Grade.UNKNOWN
    rank = sum(value >= least and psnr >= colour for least, colour in zip(bounds, COLOUR[part], strict=True))
    if facts.get("sharpness", BLURRED) < BLURRED:
        rank -= 1
    if (size or 0) < LEAST_PX[part] or facts.get("brightness", DARK) < DARK:
        rank = min(rank, Grade.FAIR.rank)
    return next(grade for grade in (Grade.GOOD, Grade.FAIR, Grade.POOR) if grade.rank <= max(rank, 0))


def grade_seen(metrics: dict[str, Any], facts: dict[str, float]) -> Grade:
    """How much of the body's surface the frames show.

    Fair at best of a part of a turn, which shows much of it from aside, and of a body of which a part is missing.
    """
    share = number(metrics.get("seen_area"))
    if share is None:
        return Grade.UNKNOWN
    whole = facts.get("turn_degrees", TURN) >= TURN and not unseen_parts(metrics)
    return Grade.GOOD if share >= SEEN[0] and whole else Grade.FAIR if share >= SEEN[1] else Grade.POOR


def grade_moves(metrics: dict[str, Any]) -> Grade:
    """How the avatar holds in poses that no frame shows."""
    found = [number(metrics.get(name)) for name in ("stray_alpha", "torn_alpha")]
    worst = max((value for value in found if value is not None), default=None)
    if worst is None:
        return Grade.UNKNOWN
    return Grade.GOOD if worst <= TORN[0] else Grade.FAIR if worst <= TORN[1] else Grade.POOR


def grade_whole(grades: dict[str, Grade], faceless: bool) -> Grade:
    """That of the body; with a face that is not good it is fair at best, as with what is poor elsewhere.

    faceless: no frame shows the face.
    """
    body, face, poor = grades["body"], grades["face"], Grade.POOR
    if body is Grade.UNKNOWN or body is poor:
        return body
    if face is poor and body is Grade.FAIR:
        return poor
    return Grade.FAIR if faceless or face is Grade.FAIR or poor in grades.values() else body


def unseen_parts(metrics: dict[str, Any]) -> list[str]:
    """Names of the parts of the body that no frame shows; none of an avatar of before they were written down."""
    return metrics.get("unseen_parts") or []


def say_part(part: str, grade: Grade, metrics: dict[str, Any]) -> str:
    """What the grade of a part means, and from where it is least alike if it is not good."""
    view = ((metrics.get("likeness") or {}).get(part) or {}).get("worst_view")
    where = f" Least alike where the {view} is seen." if isinstance(view, str) and grade in (Grade.FAIR, Grade.POOR) else ""
    return SENTENCES[part][grade] + where


def say_seen(metrics: dict[str, Any], facts: dict[str, float]) -> str:
    """How much of the surface the frames show, and of a part of a turn from how many degrees."""
    share = number(metrics.get("seen_area"))
    if share is None:
        return "How much of the body the frames show is not known."
    rest = "" if share >= SEEN[0] and not unseen_parts(metrics) else " The rest has the colours of what lies around it."
    turn = facts.get("turn_degrees", TURN)
    from_part = f", from {turn:.0f} of 360 degrees" if turn < TURN else ""
    missing = ", but not " + ", ".join(f"the {part}" for part in unseen_parts(metrics)) if unseen_parts(metrics) else ""
    return f"The frames show {share:.0%} of the body's surface{from_part}{missing}.{rest}"


def say_in_one_line(grades: dict[str, Grade]) -> str:
    """`Body good, face fair, hands poor.`"""
    words = [f"{name} {grades[part].word}" for part, name in
             (("body", "body"), ("face", "face"), ("hands", "hands"), ("seen", "seen from all sides"), ("moves", "in new poses"))
             if grades[part] is not Grade.UNKNOWN]
    line = ", ".join(words)
    return line[:1].upper() + line[1:]
