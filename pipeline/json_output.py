"""The one object of --json: the last line of stdout."""

from __future__ import annotations

import json
from typing import Any


def emit(content: dict[str, Any]) -> None:
    """Prints the object on a line of its own."""
    print(json.dumps(content), flush=True)
