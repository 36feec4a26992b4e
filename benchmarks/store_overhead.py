"""What the store costs of a run: `python -m gsac.benchmarks.store_overhead CLIP [ARGUMENT ...]`, arguments as of `gsac run`.

The command runs three times in this process: in a cache that knows nothing, again with nothing to do, and with all results dropped,
as a clip that is new finds a cache that has seen the code and the models before. Counted is what code of `gsac.cache` does for the
run's main process: keys, hashing, lookups, locks, publishing. Stages run in processes of their own, which know no cache.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import importlib
import inspect
import os
import pkgutil
import resource
import sys
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from enum import Enum
from pathlib import Path
from typing import Any

TOLD = 8
"""Functions of the store that are told, those that cost most."""


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m gsac.benchmarks.store_overhead",
                                     description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("clip", type=Path, metavar="CLIP")
    options, rest = parser.parse_known_args(argv)
    meter = Meter()
    meter.watch("gsac.cache")  # before anything else has its functions by name
    from gsac.benchmarks.batch_planner import borrow_models
    from gsac.pipeline.cli import execute

    with tempfile.TemporaryDirectory() as folder:
        cache = Path(folder, "cache")
        borrow_models(cache)
        os.environ["GSAC_CACHE"] = str(cache)
        words = ["run", str(options.clip), "--out", str(Path(folder, "out")), *rest]
        for name in ("empty cache", "nothing to do", "new clip"):
            if name == "new clip":
                drop_results(cache)
            meter.clear()
            began = time.perf_counter(), cpu_seconds()
            if execute(words):
                return 1
            wall, cpu = time.perf_counter() - began[0], cpu_seconds() - began[1]
            in_cpu, in_wall = sum(meter.cpu.values()), sum(meter.wall.values())
            print(f"{name}: {in_cpu:.2f} of {cpu:.2f} CPU s, {in_cpu / cpu:.2%}; {in_wall:.2f} of {wall:.2f} s by the clock, "
                  f"{in_wall / wall:.2%}")
            for function, seconds in sorted(meter.wall.items(), key=lambda one: -one[1])[:TOLD]:
                print(f"  {meter.cpu[function]:6.3f} CPU s, {seconds:6.3f} s  {function}")
    return 0


def drop_results(cache: Path) -> None:
    """Leaves a cache its models and what it remembers of files."""
    from gsac.cache.objects import remove

    for name in ("objects", "actions"):
        remove(cache / name)


def cpu_seconds() -> float:
    """Of this process and of those that it has started and that have ended."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


class Meter:
    """Time of the main thread in the functions of a package, those below them included, by the one that was called from outside."""

    def __init__(self):
        self.cpu: dict[str, float] = defaultdict(float)
        self.wall: dict[str, float] = defaultdict(float)
        self._inside = False

    def clear(self) -> None:
        """Begins anew."""
        self.cpu.clear()
        self.wall.clear()

    def watch(self, package: str) -> None:
        """Puts a clock about each function and method of a package's modules."""
        root = importlib.import_module(package)
        for found in pkgutil.walk_packages(root.__path__, f"{package}."):
            if found.name.startswith(f"{package}.remote"):  # asks for an extra, and runs in threads of its own
                continue
            module = importlib.import_module(found.name)
            for owner in (module, *(one for one in vars(module).values() if _is_own_class(one, module.__name__))):
                for name, function in list(vars(owner).items()):
                    if inspect.isfunction(function) and function.__module__ == module.__name__:
                        setattr(owner, name, self._timed(f"{module.__name__.rpartition('.')[2]}.{name}", function))

    def _timed(self, name: str, function: Callable) -> Callable:
        if inspect.isgeneratorfunction(inspect.unwrap(function)):
            return self._timed_context(name, function) if hasattr(function, "__wrapped__") else function

        @functools.wraps(function)
        def call(*args: Any, **options: Any) -> Any:
            with self._clock(name):
                return function(*args, **options)
        return call

    def _timed_context(self, name: str, function: Callable) -> Callable:
        """Entering and leaving of a context manager count, what is done in it does not."""
        @functools.wraps(function)
        @contextlib.contextmanager
        def enter(*args: Any, **options: Any) -> Iterator[Any]:
            manager = function(*args, **options)
            with self._clock(name):
                value = manager.__enter__()
            try:
                yield value
            except BaseException as error:
                with self._clock(name):
                    handled = manager.__exit__(type(error), error, error.__traceback__)
                if not handled:
                    raise
            else:
                with self._clock(name):
                    manager.__exit__(None, None, None)
        return enter

    @contextlib.contextmanager
    def _clock(self, name: str) -> Iterator[None]:
        if self._inside or threading.current_thread() is not threading.main_thread():
            yield
            return
        self._inside, began = True, (time.perf_counter(), time.thread_time())
        try:
            yield
        finally:
            self._inside = False
            self.wall[name] += time.perf_counter() - began[0]
            self.cpu[name] += time.thread_time() - began[1]


def _is_own_class(value: Any, module: str) -> bool:
    return inspect.isclass(value) and value.__module__ == module and not issubclass(value, (Enum, Exception))


if __name__ == "__main__":
    sys.exit(main())
