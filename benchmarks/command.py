"""gsac bench NAME: benchmarks are the packages below this one with a module `bench` and its `main(argv)`."""

from __future__ import annotations

import argparse
import ast
import importlib
import pkgutil
from pathlib import Path

import gsac.benchmarks
from gsac.pipeline.outcomes import ExitCode
from gsac.stages.contract import BadInput, did_you_mean

HELP = "run a benchmark"
LIST = "list"
"""Instead of a benchmark's name: tells them all."""


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("name", metavar="NAME", help=f"one of: {', '.join(names()) or 'none yet'}; or {LIST}: what each measures")
    command.add_argument("rest", nargs=argparse.REMAINDER, metavar="ARGUMENT",
                         help="handed on; `gsac bench NAME --help` lists them")
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    if arguments.name == LIST:
        for name in names():
            print(f"{name:<16} {describe(name)}")
        return ExitCode.OK
    if arguments.name not in names():
        raise BadInput(f"there is no benchmark {arguments.name} yet{did_you_mean(arguments.name, names())}; "
                       f"there is: {', '.join(names()) or 'none'}")
    bench = importlib.import_module(f"gsac.benchmarks.{arguments.name.replace('-', '_')}.bench")
    return ExitCode(bench.main(arguments.rest) or 0)


def names() -> list[str]:
    """Benchmarks at hand, without importing them."""
    roots = gsac.benchmarks.__path__
    packages = [m.name for m in pkgutil.iter_modules(roots) if m.ispkg]
    found = [p for p in packages if any(m.name == "bench" for m in pkgutil.iter_modules([f"{root}/{p}" for root in roots]))]
    return sorted(name.replace("_", "-") for name in found)


def describe(name: str) -> str:
    """The first line of a benchmark's docstring, without its name; nothing is imported."""
    places = [Path(root) / name.replace("-", "_") / "bench.py" for root in gsac.benchmarks.__path__]
    text = ast.get_docstring(ast.parse(next(place for place in places if place.is_file()).read_text())) or ""
    return text.partition("\n")[0].removeprefix(f"gsac bench {name}: ")
