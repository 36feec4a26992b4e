"""Text files that people write or save: a thing a line."""

from __future__ import annotations

from pathlib import Path


def read_lines(path: Path) -> list[str]:
    """The lines without the empty ones and the blanks around them.

    Read as UTF-8 whatever the locale is, with or without the mark at the beginning that Windows writes. Raises OSError, and
    UnicodeDecodeError where the file is something else.
    """
    return [line.strip() for line in path.read_text(encoding="utf-8-sig").splitlines() if line.strip()]
