"""Where an artifact comes from: the stages that led to it with all that they depended on, down to the clip."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gsac.avatar.network_files import licence_of
from gsac.cache.bundle import papers_of
from gsac.cache.digest import canonical, tree_digest, typed_digest
from gsac.cache.record import Record, is_digest
from gsac.cache.roots import find_roots
from gsac.cache.store import Store
from gsac.pipeline.graph import CLIP
from gsac.pipeline.rows import read_json, read_rows, result_row
from gsac.pipeline.run_folder import DAG, RUN, RunFolder
from gsac.stages.contract import BadInput

SHORTEST = 8
"""Characters of a digest's or a key's beginning at least."""


@dataclass
class Lineage:
    """The runs of stages that led to some artifacts, those that came last first, and the clips that they began with."""

    artifacts: list[str]
    """Tree digests that were asked for."""
    records: list[Record] = field(default_factory=list)
    clips: dict[str, list[str]] = field(default_factory=dict)
    """Tree digest -> where the clip lay when folders of runs here were made."""
    papers: list[str] = field(default_factory=list)
    """Files that the cache keeps for these clips: licences, the consent of the person shown."""
    lost: dict[str, str] = field(default_factory=dict)
    """Port -> tree digest, of inputs whose record is not in the cache any more."""
    others: dict[str, int] = field(default_factory=dict)
    """Key -> number of other runs that gave the same bytes."""

    def to_json(self) -> dict[str, Any]:
        """As --json and a bundle hold it."""
        return {
            "artifacts": self.artifacts, "stages": [stage_entry(record) for record in self.records],
            "clips": [{"digest": digest, "paths": paths} for digest, paths in self.clips.items()],
            "papers": self.papers, "lost": self.lost, "same_bytes": self.others,
        }


def trace(store: Store, folder: RunFolder | None, asked: str | Path) -> Lineage:
    """The lineage of a file or folder, of a digest or key (or its beginning), or of all that the folder of a run shows.

    folder: of the run, where `asked` is it or lies in it: of equal results then those count that it shows. BadInput where the cache
    knows no such artifact.
    """
    shown = _keys(folder) if folder is not None else set()
    makers = _Makers(store, shown)
    if folder is not None and isinstance(asked, Path) and asked.resolve() == folder.root.resolve():
        start = [record for record in makers.all if record.key in shown]
        digests = sorted(digest for record in start for digest in record.outputs.values())
        if not start:
            raise BadInput(f"{asked}: the cache {store.root} has none of its results; `gsac run` makes them again")
    elif isinstance(asked, Path):
        digests = [tree_digest(asked.resolve(), store.memo)[0]]
        port = asked.absolute().relative_to(folder.root).as_posix() if folder is not None else ""
        start = makers.of_port(port, digests[0])[:1] or makers.of_digest(digests[0])
        if not start:
            raise BadInput(f"{asked}: the cache {store.root} knows no result of this content (digest {digests[0][:12]}); give an "
                           "output of a stage as it was made, or the folder of the run")
    else:
        start = makers.of_word(asked)
        digests = [asked] if is_digest(asked) else sorted({d for record in start for d in record.outputs.values()})
        if not start:
            raise BadInput(f"{asked}: neither a file, nor the folder of a run, nor a digest or key (its first {SHORTEST} digits at "
                           f"least) that the cache {store.root} knows")
    found = Lineage(digests)
    _walk(found, makers, start)
    found.clips = {digest: [] for digest in sorted({r.parts.inputs[CLIP] for r in found.records if CLIP in r.parts.inputs})}
    for digest, path in _clip_paths(store, folder):
        if digest in found.clips and path not in found.clips[digest]:
            found.clips[digest].append(path)
    found.papers = [str(file) for digest in found.clips for file in papers_of(store, digest).values()]
    return found


def stage_entry(record: Record) -> dict[str, Any]:
    """One run of a stage, as --json shows it."""
    parts, info = record.parts, record.info
    return {
        "stage": parts.stage, "key": record.key, "outputs": record.outputs, "inputs": parts.inputs, "params": parts.params,
        "code": {"digest": code_digest(parts.code), "modules": parts.code},
        "models": [{"name": name, "sha256": sha256, "licence": licence_of(name, sha256)}
                   for name, sha256 in parts.models.items()],
        "packages": parts.packages, "device": info.device, "started": info.started, "seconds": info.seconds,
        "cpu_seconds": info.cpu_seconds, "peak_rss_mb": info.peak_rss_mb,
    }


def code_digest(code: dict[str, str]) -> str:
    """Digest of a stage's code closure, as `cache.key` specifies it."""
    return typed_digest("code 1", canonical(code))


class _Makers:
    """Who made what, of all records of a store; of equal results that of the run in question first, then the newest."""

    def __init__(self, store: Store, shown: set[str]) -> None:
        found = [record for record in map(store.read, store.record_files()) if record is not None]
        if store.below is not None:
            found += _Makers(store.below, shown).all
        self.all = sorted(found, key=lambda record: (record.key in shown, record.info.started), reverse=True)

    def of_port(self, port: str, digest: str) -> list[Record]:
        """Records of the runs whose output at a port has this digest."""
        stage, _, output = port.partition("/")
        return [record for record in self.all if record.parts.stage == stage and record.outputs.get(output) == digest]

    def of_digest(self, digest: str) -> list[Record]:
        """The record that stands for whoever made a digest: the first; [] where nobody is known."""
        return [record for record in self.all if digest in record.outputs.values()][:1]

    def of_word(self, word: str) -> list[Record]:
        """Likewise, by the beginning of a digest or key."""
        if len(word) < SHORTEST:
            return []
        return [record for record in self.all
                if record.key.startswith(word) or any(d.startswith(word) for d in record.outputs.values())][:1]


def _walk(found: Lineage, makers: _Makers, start: Iterable[Record]) -> None:
    """Adds the records that lead to `start`; each stands before those that it was made from."""
    placed: dict[str, Record] = {}

    def visit(record: Record) -> None:
        if record.key in placed:
            return
        for port, digest in record.parts.inputs.items():
            above = makers.of_port(port, digest) if port != CLIP else []
            if above:
                if len({other.key for other in above}) > 1:
                    found.others[above[0].key] = len({other.key for other in above}) - 1
                visit(above[0])
            elif port != CLIP:
                found.lost[port] = digest
        placed[record.key] = record

    for record in start:
        visit(record)
    found.records = list(reversed(placed.values()))


def _keys(folder: RunFolder) -> set[str]:
    """Keys of the results that the folder of a run shows."""
    return {str(row.get("key")) for row in map(result_row, read_rows(folder).values()) if row is not None}


def _clip_paths(store: Store, folder: RunFolder | None) -> Iterator[tuple[str, str]]:
    """Digest and path of the clips that folders of runs speak of."""
    folders = [folder] if folder is not None else []
    for one in [*folders, *(RunFolder(root.folder) for root in find_roots(store))]:
        run = read_json(one.root / RUN)
        if isinstance(run, dict) and isinstance(run.get("clip"), str):
            yield str(run.get("clip_digest")), run["clip"]


def run_folder_around(path: Path) -> RunFolder | None:
    """The folder of the run that a path is or lies in; None where there is none."""
    at = path.absolute()
    return next((RunFolder(place) for place in (at, *at.parents) if (place / DAG).is_file() and (place / RUN).is_file()), None)
