"""Versions of the interpreter and of installed distributions, from the names of their `.dist-info` folders.

`importlib.metadata` would read and parse each METADATA file: a third of what a run with nothing to do may cost.
"""

from __future__ import annotations

import os
import re
import sys
from functools import cache

ABSENT = "absent"
"""The version of a package that is not installed: some are optional."""
PYTHON = "python"
"""The interpreter's name among packages."""


def python_version() -> str:
    """Of the interpreter that runs: `3.13.5`; another implementation than CPython is named."""
    number = ".".join(map(str, sys.version_info[:3]))
    return number if sys.implementation.name == "cpython" else f"{sys.implementation.name} {number}"


def package_version(package: str) -> str:
    """Version of a distribution, or ABSENT."""
    return _installed(tuple(sys.path)).get(_normal(package), ABSENT)


@cache
def _installed(path: tuple[str, ...]) -> dict[str, str]:
    """Normal name -> version; the first on the path counts, as for imports."""
    found: dict[str, str] = {}
    for folder in path:
        try:
            names = os.listdir(folder or ".")
        except OSError:
            continue
        for name in sorted(names):
            stem, dot, ending = name.rpartition(".")
            if ending in ("dist-info", "egg-info") and "-" in stem:
                package, version = stem.split("-")[:2]
                found.setdefault(_normal(package), version)
    return found


def _normal(name: str) -> str:
    """The name normalised by PEP 503."""
    return re.sub(r"[-_.]+", "-", name).lower()
