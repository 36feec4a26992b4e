"""Other tools' names of joints for the page: `python -m gsac.viewer.joint_names` writes joint_names.js.

The table is that of avatar/motion/names.py.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from gsac.avatar.motion import names

WRITTEN = Path(__file__).with_name("joint_names.js")


def format_script() -> str:
    """The text of joint_names.js."""
    rules = ",\n".join(f"  {json.dumps(rule)}" for rule in names.RULES)
    return "\n".join([
        "// Written by `python -m gsac.viewer.joint_names` from avatar/motion/names.py. Do not edit.", "",
        "// Words of a name without meaning: prefixes of tools.", f"export const NOISE = {json.dumps(names.NOISE)};",
        "// Word -> the beginning of our joints' names.", f"export const SIDES = {json.dumps(names.SIDES)};",
        "// Our joint, its side, and spellings, in the order in which joints are taken.",
        "/** @type {[string, string, string[]][]} */", f"export const RULES = [\n{rules},\n];", ""])


def main() -> int:
    """Writes joint_names.js."""
    WRITTEN.write_text(format_script())
    print(f"wrote {WRITTEN}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
