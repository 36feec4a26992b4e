"""Exit codes of the command, outcomes of a stage, and the words for both."""

from __future__ import annotations

from enum import Enum, IntEnum


class ExitCode(IntEnum):
    """What `gsac` returns to the shell."""

    OK = 0
    FAILED = 1
    """A stage failed."""
    USAGE = 2
    """The command line, a parameter or an input file is at fault."""
    STALE = 3
    """Something is not up to date."""
    INTEGRITY = 4
    """The cache holds something that is not what it says."""
    INTERRUPTED = 130


class Outcome(Enum):
    """What became of one stage in one run; the value is the word of `--json` and `run.json`."""

    RAN = "ran"
    CACHED = "cached"
    FAILED = "failed"
    PLANNED = "planned"
    """Would run; only `--dry-run` says so."""

    @property
    def style(self) -> str:
        """Colour in a terminal."""
        return {"ran": "green", "cached": "cyan", "failed": "bold red", "planned": "yellow"}[self.value]
