"""gsac bench NAME: benchmarks are the packages of gsac.benchmarks with a module `bench` and its `main(argv)`."""

from __future__ import annotations

import argparse
import importlib
import pkgutil

from gsac.pipeline.outcomes import ExitCode
from gsac.stages.contract import BadInput


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("name", metavar="NAME", help=f"one of: {', '.join(names()) or 'none yet'}")
    command.add_argument("rest", nargs=argparse.REMAINDER, help="arguments of the benchmark")
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    if arguments.name not in names():
        raise BadInput(f"there is no benchmark {arguments.name} yet; there is: {', '.join(names()) or 'none'}")
    bench = importlib.import_module(f"gsac.benchmarks.{arguments.name.replace('-', '_')}.bench")
    return ExitCode(bench.main(arguments.rest) or 0)


def names() -> list[str]:
    """Benchmarks at hand, without importing them."""
    import gsac.benchmarks

    packages = [m.name for m in pkgutil.iter_modules(gsac.benchmarks.__path__) if m.ispkg]
    folders = [f"{root}/{package}" for package in packages for root in gsac.benchmarks.__path__]
    found = {m.module_finder.path for m in pkgutil.iter_modules(folders) if m.name == "bench"}
    return sorted(folder.rsplit("/", 1)[1].replace("_", "-") for folder in found)
