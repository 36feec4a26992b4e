"""The clip that a command is about: the one given, else that of the run whose folder the command was typed in."""

from __future__ import annotations

from pathlib import Path

from gsac.pipeline.run_folder import DAG, RunFolder
from gsac.stages.contract import BadInput


def run_folder_here() -> RunFolder:
    """The folder of a run that the command was typed in. BadInput where it was typed elsewhere."""
    here = Path.cwd()
    try:
        return RunFolder.around(here)
    except BadInput as error:
        raise BadInput(f"no CLIP was given, and this folder is not a run's: no {DAG} in {here} or above; give a video or a "
                       "folder of photos") from error


def find_clip(path: Path | None) -> Path:
    """Absolute path of the clip; None: the clip of the run that the command was typed in. BadInput where there is none, or
    where the path is that of a run's folder."""
    if path is None:
        return run_folder_here().require_clip()
    if not path.exists():
        raise BadInput(f"{path}: no such file or folder; give a video or a folder of photos")
    if not (path.is_file() or path.is_dir()):
        raise BadInput(f"{path} is no regular file; give a video or a folder of photos")
    if RunFolder(path).is_run:
        raise BadInput(f"{path} is the folder of a run; give its clip, {RunFolder(path).require_clip()}")
    return path.resolve()
