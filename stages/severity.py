"""How grave a finding is; a module of its own, which loads nothing, for the engine reads it."""

from __future__ import annotations

from enum import StrEnum


class Severity(StrEnum):
    """How much a finding takes from the avatar."""

    NEWS = "news"
    """Nothing that is seen, or a figure that is not measured."""
    POORER = "poorer"
    """Detail, or a part that the clip does not show: it is made up."""
    WRONG = "wrong"
    """The frames contradict each other or the body: without them, or filmed again, the avatar is better."""
    HOPELESS = "hopeless"
    """Nothing can come of the clip: a run stops here, unless it is told to go on."""
