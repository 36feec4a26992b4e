"""The code that a trial's result depends on, as one digest."""

from __future__ import annotations

import hashlib
import json
from functools import cache

from gsac.cache.code import code_parts

RESULTS = ("gsac.avatar", "gsac.benchmarks.fit", "gsac.benchmarks.stability", "gsac.stages", "gsac.turntable")
"""Packages whose sources make results; the rest starts, keeps and tells them."""
DIGITS = 12


@cache
def hash_code(*modules: str) -> str:
    """A digest of the sources in RESULTS that these modules import, and of files that they name."""
    parts = {name: digest for name, digest in code_parts(modules[0], modules[1:]).items()
             if any(f"{name}.".startswith((f"{package}.", f"{package}/")) for package in RESULTS)}
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:DIGITS]
