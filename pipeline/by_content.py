"""Entry of a stage's process: our modules run as their sources are now, by content.

Python believes compiled code whose source has the same size and time, in whole seconds. An edit that keeps both (rsync, tar, two
edits within a second) would run old code under the key of the new. What is compiled here lies beside Python's own, under the
digest of the source that it was made from.
"""

from __future__ import annotations

import importlib
import marshal
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from importlib.util import MAGIC_NUMBER, cache_from_source, source_hash
from types import CodeType, ModuleType

FIRST_PARTY = "gsac."
WORKER = "gsac.pipeline.worker"
CHECKED = (0b11).to_bytes(4, "little")
"""Flags of PEP 552: the file is valid by its source's digest, which is to be compared."""


class ByContent(SourceFileLoader):
    """Loads a module from its source, or from code that was compiled from exactly that source."""

    def get_code(self, fullname: str) -> CodeType:
        """The module's code."""
        path = self.get_filename(fullname)
        source = self.get_data(path)
        head = MAGIC_NUMBER + CHECKED + source_hash(source)
        compiled = cache_from_source(path, optimization=f"content{sys.flags.optimize}")
        try:
            data = self.get_data(compiled)
            if data.startswith(head):
                return marshal.loads(memoryview(data)[len(head):])
        except (OSError, ValueError, EOFError, TypeError):
            pass  # not there yet, or torn
        code = self.source_to_code(source, path)
        if not sys.dont_write_bytecode:
            self.set_data(compiled, head + marshal.dumps(code))
        return code


class Finder:
    """Finds our modules as ever, and loads them by content."""

    @staticmethod
    def find_spec(name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        """The spec of one of our modules; None of any other."""
        if not name.startswith(FIRST_PARTY):
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = ByContent(spec.loader.name, spec.loader.path)
        return spec


def main() -> None:
    sys.meta_path.insert(0, Finder)  # pyright: ignore[reportArgumentType], a class will do
    importlib.import_module(WORKER).main()


if __name__ == "__main__":
    main()
