"""Members of a zip without a date, so that equal content gives equal bytes."""

from __future__ import annotations

import zipfile

NEVER = (1980, 1, 1, 0, 0, 0)
"""The earliest date that a zip can hold."""


def undated(name: str) -> zipfile.ZipInfo:
    """A member of that name, to be written."""
    return zipfile.ZipInfo(name, NEVER)
