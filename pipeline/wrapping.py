"""Lines for a terminal broken between words, where its width is known; for pipes and files they stay as they are."""

from __future__ import annotations

import os
import textwrap
from typing import TextIO

GOES_ON = "  "
"""Begins each further line of what was broken."""


def fit(text: str, stream: TextIO) -> str:
    """The text as the stream is to get it. A word longer than the terminal, such as a path, stays whole."""
    columns = terminal_columns(stream)
    return wrap(text, columns) if columns else text


def wrap(text: str, columns: int) -> str:
    """Each line of the text broken between words; what is spaced out within a line stays so."""
    lines = (textwrap.wrap(line, max(columns, 20), break_long_words=False, break_on_hyphens=False, subsequent_indent=GOES_ON)
             for line in text.split("\n"))
    return "\n".join("\n".join(line) for line in lines)


def terminal_columns(stream: TextIO) -> int:
    """Columns of the terminal that the stream writes to; 0 where it is none or does not tell."""
    try:
        return os.get_terminal_size(stream.fileno()).columns if stream.isatty() else 0
    except (OSError, ValueError):
        return 0
