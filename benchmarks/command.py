"""gsac bench NAME: benchmarks are the packages below this one with a module `bench` and its `main(argv)`."""

from __future__ import annotations

import argparse
import importlib
import pkgutil

import gsac.benchmarks
from gsac.pipeline.outcomes import ExitCode
from gsac.stages.contract import BadInput, did_you_mean

HELP = "run a benchmark"


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("name", metavar="NAME", help=f"one of: {', '.join(names()) or 'none yet'}")
    command.add_argument("rest", nargs=argparse.REMAINDER, metavar="ARGUMENT",
                         help="handed on; `gsac bench NAME --help` lists them")
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
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
