"""Counts in sentences."""

from __future__ import annotations


def counted(count: int, noun: str) -> str:
    """`1 frame`, `12 frames`. noun: of one, whose plural ends in s."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def count_of(count: int, whole: int, noun: str) -> str:
    """`12 of 60 frames`, `all 60 frames`, `the only frame`. count: at least one where there is one only."""
    if count < whole:
        return f"{count} of {counted(whole, noun)}"
    return f"all {counted(whole, noun)}" if whole != 1 else f"the only {noun}"
