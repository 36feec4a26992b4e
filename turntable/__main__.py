"""`python -m gsac.turntable OUT --seed 3 --frames 60 --height 1280 ...`: renders one truth clip; every option is a flag."""

from __future__ import annotations

import argparse
import dataclasses
import sys
from types import NoneType
from typing import Literal, Union, get_args, get_origin, get_type_hints

from gsac.turntable.options import TurntableOptions


def parser() -> argparse.ArgumentParser:
    out = argparse.ArgumentParser(prog="python -m gsac.turntable", description="Render one truth clip.")
    out.add_argument("out", help="folder for clip.mp4, mask/ and truth.npz")
    hints = get_type_hints(TurntableOptions)
    for f in dataclasses.fields(TurntableOptions):
        kind, flag = hints[f.name], "--" + f.name.replace("_", "-")
        if kind is bool:
            out.add_argument(flag, action=argparse.BooleanOptionalAction, default=f.default)
            continue
        plain = next((a for a in get_args(kind) if a is not NoneType), kind) if _optional(kind) else kind
        choices = get_args(kind) if get_origin(kind) is Literal else None
        out.add_argument(flag, type=str if choices else plain, choices=choices, default=f.default)
    return out


def main(arguments: list[str] | None = None) -> int:
    given = vars(parser().parse_args(arguments))
    folder = given.pop("out")
    options = TurntableOptions(**given)
    try:
        options.check()
    except ValueError as e:
        print(f"turntable: {e}", file=sys.stderr)
        return 2
    from gsac.turntable.clip import make_clip

    def say(done: int, total: int, what: str) -> None:
        print(f"\r{done}/{total} {what}", end="", file=sys.stderr)

    made = make_clip(folder, options, say)
    print(file=sys.stderr)
    print(made)
    return 0


def _optional(kind: object) -> bool:
    return NoneType in get_args(kind) and (get_origin(kind) is Union or type(kind).__name__ == "UnionType")


if __name__ == "__main__":
    sys.exit(main())
