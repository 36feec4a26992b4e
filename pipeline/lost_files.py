"""Results that a run's folder links to and that the cache no longer holds."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

from gsac.cache.roots import object_of
from gsac.pipeline.quality import STANDARD, name_of
from gsac.pipeline.rows import read_json
from gsac.pipeline.run_folder import DAG, PARAMS, RUN, RunFolder
from gsac.stages.contract import BadInput


def require_files(folder: Path) -> None:
    """BadInput where any link of a run's folder leads to nothing; it says how to get the files back."""
    for name in RunFolder(folder).links():
        require_file(folder / name)


def require_file(path: Path) -> None:
    """BadInput where `path` is a link into a cache and leads to nothing."""
    if object_of(path) is None or path.exists():
        return
    cache = Path(os.readlink(path)).parents[2]
    state = "which does not hold them any more" if (cache / "objects").is_dir() else "which is gone"
    raise BadInput(f"{path}: its files lie in the cache {cache}, {state}: `{recovery(path)}` brings them back")


def recovery(path: Path) -> str:
    """The command that makes the results of the folder around `path` again, by the folder's own parameters."""
    root = next((folder for folder in path.absolute().parents if (folder / DAG).is_file()), None)
    if root is None:
        return "gsac run CLIP"
    clip, run = RunFolder(root).clip, read_json(root / RUN)
    quality = name_of(run.get("quality")) if isinstance(run, dict) else ""
    return shlex.join(["gsac", "run", str(clip.resolve()) if clip.exists() else "CLIP", "--out", str(root),
                       *(["--quality", quality] if quality not in ("", STANDARD) else []),
                       *(["--params", str(root / PARAMS)] if (root / PARAMS).is_file() else [])])
