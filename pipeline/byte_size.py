"""Numbers of bytes as words for the terminal."""

from __future__ import annotations


def format_size(count: float) -> str:
    """`1.2 MB`"""
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000:
            return f"{count:.0f} {unit}" if unit == "B" else f"{count:.1f} {unit}"
        count /= 1000
    return f"{count:.1f} TB"
