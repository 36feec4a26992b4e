"""All faults, in the order of what someone who films with a phone meets."""

from __future__ import annotations

from gsac.benchmarks.stability import footage, framing, given, occluders, outlines, person, picture, points, timing
from gsac.benchmarks.stability.fault import Fault

FAMILIES = (person, given, framing, occluders, picture, timing, footage, points, outlines)
FAULTS: dict[str, Fault] = {fault.name: fault for family in FAMILIES for fault in family.FAULTS}
QUICK = ("frozen", "pole", "hand-on-other", "mask-empty", "no-numbers")
"""Those of `--quick`: one of every origin, and values that are no numbers."""
