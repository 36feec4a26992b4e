"""What the type checker found when it came may only become less."""

import json
from pathlib import Path

BASELINE = Path(__file__).resolve().parents[1] / ".basedpyright" / "baseline.json"
MOST = 154
"""To be lowered with every finding that is mended, never raised."""


def test_the_type_checkers_baseline_only_shrinks():
    files = json.loads(BASELINE.read_text())["files"]
    assert sum(len(findings) for findings in files.values()) <= MOST
