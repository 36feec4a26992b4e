"""The avatar that a command is given: its file, its name, and the run that it came from."""

from __future__ import annotations

from pathlib import Path

from gsac.pipeline.lost_files import require_file
from gsac.pipeline.run_folder import RunFolder
from gsac.stages.contract import BadInput

EXPORT, FILE = "export", "avatar.gsac"


def find_avatar(path: Path) -> Path:
    """The .gsac file itself, or the one in a run's or an export folder. BadInput where there is none, or a link that leads to
    nothing."""
    if path.is_file():
        return path
    for folder in (path / EXPORT, path):
        if (folder / FILE).is_file():
            return folder / FILE
        require_file(folder / FILE)
    require_file(path)
    raise BadInput(f"{path}: no {FILE} here; give the file, or the folder of a run whose stage export is done")


def name_avatar(file: Path) -> str:
    """The avatar's name: that of the run's folder, or where its file lies alone the file's own."""
    folder = file.absolute().parent
    return folder.parent.name if folder.name == EXPORT else file.stem


def folder_around(file: Path) -> RunFolder:
    """The folder of the run whose stage export wrote the avatar `file`, if it was one."""
    return RunFolder(file.absolute().parent.parent)


def refuse_footage(out: Path, file: Path) -> None:
    """BadInput where a file would take the place of the clip, or of a photo of it, that the avatar was made from."""
    folder = folder_around(file)
    clip = folder.clip.resolve()
    if out.exists() and clip.exists() and (clip.samefile(out) or clip in out.resolve().parents):
        raise BadInput(f"{out} is the clip that {folder.root} was made from, which is never written over; give another --out")
