"""A folder that holds another clip's avatar: known by path and content, and replaced only if told."""

from __future__ import annotations

import os
from pathlib import Path

from gsac.cache.store import Store
from gsac.pipeline.graph import CLIP
from gsac.pipeline.rows import port_digest, read_json, result_row, rows_of
from gsac.pipeline.run_folder import METRICS, REPORT, RUN, RunFolder
from gsac.pipeline.sources import source_digest
from gsac.stages.contract import BadInput


def find_other_clip(folder: RunFolder, clip: Path, store: Store) -> str | None:
    """Path of the clip whose results the folder holds, where it has another path and other content than this one; else None."""
    run = read_json(folder.root / RUN)
    run = run if isinstance(run, dict) else {}
    if not any(map(result_row, rows_of(run).values())) and not folder.links():
        return None
    there = str(run.get("clip") or (os.readlink(folder.clip) if folder.clip.is_symlink() else folder.clip))
    digest = run.get("clip_digest") or port_digest(folder, CLIP, store)
    return there if there != str(clip) and digest != source_digest(clip, store) else None


def make_way(folder: RunFolder, clip: Path, store: Store, replace: bool) -> bool:
    """Whether another clip's results are to give way to this one's in the folder. BadInput where they must not.

    replace: whether they may.
    """
    other = find_other_clip(folder, clip, store)
    if other is not None and not replace:
        raise BadInput(f"{folder.root} holds the avatar of {other}; give another --out, or --replace to put this clip's there")
    return other is not None


def forget_results(folder: RunFolder) -> None:
    """Removes what speaks of the results in the folder: they are of another clip."""
    for name in (RUN, METRICS, REPORT):
        folder.forget(name)
