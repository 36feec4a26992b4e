"""The code that a stage's result depends on: every first-party module reachable from it by imports in the source.

Nothing is imported to find out. Imports inside functions count, and so do the `__init__` of every package on the way,
strings that are the full name of a first-party module (`"gsac.stages.handgap.methods.gp"` in a table of methods), and files
beside or below a module that it names by a string or by a path of strings: a CUDA kernel, a page template, an `.npz`
table. Files that do not ship with the package are declared by the stage as model files. Imports whose names are put
together at run time are not seen: `extra` names them.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from gsac.cache.digest import content_digest
from gsac.cache.errors import CacheError
from gsac.cache.memo import Memo, memo_in
from gsac.cache.module_digest import read_source
from gsac.cache.root import default_root

FIRST_PARTY = "gsac"
FILE_SUFFIXES = tuple(f".{s}" for s in (
    "npz npy onnx json cu cuh c h cpp cs js css html jinja glsl wgsl hlsl compute shader asmdef unity md".split()))
MEMO_KIND = f"module 4 python {sys.version_info.major}.{sys.version_info.minor}"
"""To be raised when `module_digest` reads sources in another way, so that no memo of the old way is used."""


def code_parts(
    module: str,
    extra: tuple[str, ...] = (),
    memo: Memo | None = None,
    packages: Mapping[str, Path] | None = None,
) -> dict[str, str]:
    """Module, or `module/file` for a file that the module names -> digest, over the closure of `module` and `extra`.

    packages: folders of top packages (`gsac.stages` -> path), by default those that are installed.
    Raises CacheError where `module` or one of `extra` does not exist.
    """
    memo = memo or memo_in(default_root())
    parts: dict[str, str] = {}
    waiting = [module, *extra]
    for name in waiting:
        if _file(name, packages) is None:
            raise CacheError(f"there is no first-party module {name}")
    seen: set[str] = set()
    while waiting:
        name = waiting.pop()
        if name in seen:
            continue
        seen.add(name)
        file = _file(name, packages)
        if file is None:
            continue
        waiting += _parents(name)
        is_package = file.name == "__init__.py"
        parts[name], named = _module(file, name if is_package else name.rpartition(".")[0], memo)
        for reference in named:
            if reference.endswith(FILE_SUFFIXES) and (file.parent / reference).is_file():  # `gsac.js` too is a file, not a module
                parts[f"{name}/{reference}"] = content_digest(file.parent / reference, memo)
            elif reference.startswith(FIRST_PARTY + "."):
                waiting.append(reference)
    memo.flush()
    return dict(sorted(parts.items()))


def _module(file: Path, package: str, memo: Memo) -> tuple[str, list[str]]:
    """Digest of a module, and its references that may be first-party."""
    stat = file.stat()
    known = memo.get(f"{MEMO_KIND} {package}", stat)
    if known is None:
        digest, references = read_source(file.read_bytes(), package)
        named = [r for r in sorted(references) if r.startswith(FIRST_PARTY + ".") or r.endswith(FILE_SUFFIXES)]
        known = json.dumps([digest, named])
        memo.put(f"{MEMO_KIND} {package}", stat, known)
    digest, named = json.loads(known)
    return digest, named


def _parents(name: str) -> list[str]:
    pieces = name.split(".")
    return [".".join(pieces[:n]) for n in range(2, len(pieces))]


def _file(name: str, packages: Mapping[str, Path] | None) -> Path | None:
    """Source file of a first-party module, None where the name is none."""
    pieces = name.split(".")
    if len(pieces) < 2 or pieces[0] != FIRST_PARTY:
        return None
    top = ".".join(pieces[:2])
    folder = packages.get(top) if packages is not None else _installed(top)
    if folder is None:
        return None
    stem = os.path.join(folder, *pieces[2:])
    for candidate in (f"{stem}.py", os.path.join(stem, "__init__.py")):
        if os.path.isfile(candidate):
            return Path(candidate)
    return None


@cache
def _installed(top: str) -> Path | None:
    """Folder of an installed top package, found without importing it."""
    try:
        spec = find_spec(top)
    except (ImportError, ValueError):
        return None
    if spec is None or not spec.submodule_search_locations:
        return None
    return Path(next(iter(spec.submodule_search_locations)))
