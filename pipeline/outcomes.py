"""Exit codes of the command and outcomes of a stage; each says its own sentence."""

from __future__ import annotations

from enum import Enum, IntEnum


class ExitCode(IntEnum):
    """What `gsac` returns to the shell."""

    OK = 0
    FAILED = 1
    USAGE = 2
    STALE = 3
    INTEGRITY = 4
    INTERRUPTED = 130

    @property
    def sentence(self) -> str:
        return _EXIT_CODES[self]


_EXIT_CODES = {
    ExitCode.OK: "all is well",
    ExitCode.FAILED: "a stage failed, or the cache could not keep its result; of `batch`: a clip failed, or, with `--dry-run`, "
                     "cannot run; of `check`: the clip filmed again would be better",
    ExitCode.USAGE: "the command line, a parameter or an input file is at fault; of `check`: nothing can come of the clip",
    ExitCode.STALE: "something is not up to date",
    ExitCode.INTEGRITY: "the cache holds something else than was put there",
    ExitCode.INTERRUPTED: "stopped by Ctrl-C or a signal; finished stages are kept",
}


class Outcome(Enum):
    """The end of one stage in one run; the value is the word of `--json` and `run.json`."""

    RAN = "ran"
    CACHED = "cached"
    FAILED = "failed"
    PLANNED = "planned"

    @property
    def sentence(self) -> str:
        return _OUTCOMES[self][0]

    @property
    def style(self) -> str:
        """Colour in a terminal."""
        return _OUTCOMES[self][1]


_OUTCOMES = {
    Outcome.RAN: ("computed in this run", "green"),
    Outcome.CACHED: ("taken from the cache", "cyan"),
    Outcome.FAILED: ("gave no result; `error` says why", "bold red"),
    Outcome.PLANNED: ("would run; only with `--dry-run`", "yellow"),
}
