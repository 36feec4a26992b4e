"""The default folder of the store."""

from __future__ import annotations

import os
from pathlib import Path


def default_root() -> Path:
    """$GSAC_CACHE, else ~/.cache/gsac."""
    named = os.environ.get("GSAC_CACHE")
    return Path(named).expanduser().absolute() if named else Path.home() / ".cache" / "gsac"
