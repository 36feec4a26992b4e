"""Writes dvc.lock as DVC itself would, so that `dvc status` agrees after a run. DVC is never imported.

Schema 2.0: a file is its md5 and size; a folder the md5 of the JSON list of its files, `.dir`, with size and count.
Outputs are `cache: false` in dvc.yaml, so DVC wants no objects of its own: they stay in gsac's store.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from gsac.cache.digest import tree_files, typed_digest
from gsac.cache.store import Store
from gsac.pipeline.graph import Graph, Step, read_yaml
from gsac.pipeline.params import config_values
from gsac.pipeline.run_folder import LOCK, PARAMS, RunFolder, write_text
from gsac.stages.contract import BadInput

MEMO_KIND = "md5"


def write_lock(run_folder: RunFolder, graph: Graph, steps: list[str], configs: dict[str, Any], store: Store,
               digests: Mapping[str, str]) -> None:
    """Writes entries of the steps that have just finished; those of others stay as they are.

    digests: port -> tree digest, of all that the steps read and wrote. The first line of the file is a digest of them and of the
    lines below: where both are as they were, the file is, too.
    """
    import yaml

    if not steps:
        return
    path = run_folder.root / LOCK
    told = json.dumps([_request(graph.step(name), configs[name], digests) for name in steps])
    with contextlib.suppress(OSError, UnicodeDecodeError):
        head, _, body = path.read_text(encoding="utf-8").partition("\n")
        if head == _mark(told, body):
            return
    known = _entries(path)
    fresh = {name: _entry(run_folder, graph.step(name), configs[name], store) for name in steps}
    entries = {name: fresh.get(name) or known[name] for name in graph.steps if name in fresh or name in known}
    store.memo.flush()
    dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    dumper.ignore_aliases = lambda self, data: True
    body = yaml.dump({"schema": "2.0", "stages": entries}, Dumper=dumper, sort_keys=False)
    write_text(path, f"{_mark(told, body)}\n{body}")


def _request(step: Step, config: Any, digests: Mapping[str, str]) -> list[Any]:
    """What the entry of a step depends on."""
    return [step.name, step.cmd, config_values(config), {port: digests.get(port) for port in (*step.deps, *step.outs)}]


def _mark(told: str, body: str) -> str:
    """The first line of a lock. told: what it was written from; body: the lines below."""
    return f"# gsac: {typed_digest('lock 1', f'{told}{body}'.encode())}"


def _entries(path: Path) -> dict[str, Any]:
    try:
        return dict(read_yaml(path).get("stages") or {}) if path.is_file() else {}
    except BadInput:
        return {}


def _entry(run_folder: RunFolder, step: Step, config: Any, store: Store) -> dict[str, Any]:
    entry: dict[str, Any] = {"cmd": step.cmd, "deps": [_hash(run_folder, port, store) for port in sorted(step.deps)]}
    if step.params:
        entry["params"] = {PARAMS: {step.name: config_values(config)}}
    entry["outs"] = [_hash(run_folder, port, store) for port in sorted(step.outs)]
    return entry


def _hash(run_folder: RunFolder, port: str, store: Store) -> dict[str, Any]:
    path = run_folder.path(port).resolve()
    files = tree_files(path)
    sizes = sum(file.stat().st_size for file in files.values())
    entry = {"path": port, "hash": "md5"}
    digests = dict(zip(files, _md5s(list(files.values()), store), strict=True))
    if "" in files:
        return entry | {"md5": digests[""], "size": sizes}
    listing = [{"md5": digests[name], "relpath": name} for name in sorted(files)]
    digest = hashlib.md5(json.dumps(listing, sort_keys=True).encode(), usedforsecurity=False).hexdigest()
    return entry | {"md5": f"{digest}.dir", "size": sizes, "nfiles": len(listing)}


def _md5s(paths: list[Path], store: Store) -> list[str]:
    stats = [path.stat() for path in paths]
    known = {i: digest for i, stat in enumerate(stats) if (digest := store.memo.get(MEMO_KIND, stat)) is not None}
    unknown = [i for i in range(len(paths)) if i not in known]
    if unknown:
        with ThreadPoolExecutor() as pool:
            for i, digest in zip(unknown, pool.map(_md5, [paths[i] for i in unknown]), strict=True):
                store.memo.put(MEMO_KIND, stats[i], digest)
                known[i] = digest
    return [known[i] for i in range(len(paths))]


def _md5(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, lambda: hashlib.md5(usedforsecurity=False)).hexdigest()
