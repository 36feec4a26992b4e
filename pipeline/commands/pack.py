"""gsac pack DIR: one zip of an avatar with viewer, report and exports, which opens anywhere."""

from __future__ import annotations

import argparse
import contextlib
import os
import shutil
import zipfile
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

from gsac.avatar.zip_member import undated
from gsac.cache.digest import tree_files
from gsac.cache.errors import CacheError
from gsac.cache.half_made import half_made
from gsac.pipeline.avatar_file import EXPORT
from gsac.pipeline.commands.options import add_force, add_json, progress_reporter, require_free, warn_stale
from gsac.pipeline.json_output import emit
from gsac.pipeline.lost_files import recovery, require_files
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.run_folder import DAG, METRICS, PARAMS, REPORT, RunFolder
from gsac.stages.contract import BadInput

VIEWER, README = "viewer.html", "README.txt"

FIRST_PAGE = """<!doctype html>
<meta charset="utf-8">
<meta http-equiv="refresh" content="0; url=export/viewer.html">
<title>Avatar</title>
<a href="export/viewer.html">Open the avatar</a>
"""
"""The viewer's address at the top of the zip. The page itself stays in export/, so that links from it and to it hold."""

WORDS = """{name}: an avatar that GSAC made from a clip of a person.
viewer.html opens in a browser, without a network: turn, pose and animate the avatar.
report.html says how good it is and how it was made; metrics.json and params.yaml hold the figures and the parameters.
export/ holds the avatar as .gsac, .glb, .fbx, .ply and .spz, and the Unity package.
An avatar shows a person, who has a say in its use.
"""


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("folder", type=Path, metavar="DIR", help="the folder of a run")
    command.add_argument("--out", type=Path, metavar="FILE", help="default: <name of DIR>.zip, here")
    add_force(command)
    add_json(command)
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    folder = Path(os.path.realpath(arguments.folder))
    out = (arguments.out or Path(f"{folder.name}.zip")).absolute()
    if out.suffix.lower() != ".zip" or not out.parent.is_dir():
        raise BadInput(f"--out {out}: expected a file .zip in a folder that exists")
    require_free(out, arguments.force)
    run_folder = RunFolder(folder)
    with progress_reporter(arguments) as reporter, run_folder.hold() if folder.is_dir() else contextlib.nullcontext():
        members = {name: source for name, source in gather(folder).items() if source != out}
        warn_stale(run_folder, reporter)
        size = write_zip(out, folder.name, members)
    if arguments.json:
        emit({"stages": [], "outputs": {"zip": str(out)}, "metrics": {"files": len(members), "bytes": size}})
    else:
        print(out)
    return ExitCode.OK


def gather(folder: Path) -> dict[str, Path | str]:
    """Name in the zip -> file, or text, of all that makes a run's folder complete elsewhere. BadInput says what is missing."""
    if not (folder / DAG).is_file():
        raise BadInput(f"{folder}: not the folder of a run (no {DAG}); `gsac run CLIP --out DIR` makes one")
    require_files(folder)
    for name in (REPORT, METRICS, PARAMS, f"{EXPORT}/{VIEWER}"):
        if not (folder / name).is_file():
            raise BadInput(f"{folder / name} is missing; `{recovery(folder / name)}` makes it")
    members: dict[str, Path | str] = {VIEWER: FIRST_PAGE, README: WORDS.format(name=as_text(folder.name))}
    for name in (EXPORT, METRICS, PARAMS, REPORT, *find_addresses(folder / REPORT)):
        members |= find_files(folder, name)
    return dict(sorted(members.items()))


def find_files(folder: Path, name: str) -> Iterator[tuple[str, Path]]:
    """Names and files of one file, or of all below a folder but the hidden ones, in the folder of a run. BadInput where there
    is none."""
    path = folder / name
    if ".." in Path(name).parts or not path.exists():
        raise BadInput(f"{folder / REPORT} links to {name}, which is not in {folder}; `{recovery(folder / REPORT)}` makes it anew")
    tops = [top for top in path.iterdir() if not top.name.startswith(".")] if path.is_dir() else [path]
    for top in tops:
        try:
            files = tree_files(top.resolve())
        except CacheError as e:
            raise BadInput(f"{e}; take it out of {path}") from e
        for inner, file in files.items():
            yield "/".join(filter(None, (top.relative_to(folder).as_posix(), inner))), file


class _Addresses(HTMLParser):
    """Collects the addresses in a page."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found += [value for name, value in attrs if name in ("href", "src", "poster", "data") and value]


def find_addresses(page: Path) -> list[str]:
    """Relative paths that a page links to or shows, without what follows `#` or `?`."""
    parser = _Addresses()
    parser.feed(page.read_text(encoding="utf-8"))
    parts = [urlsplit(address) for address in parser.found if not address.startswith("data:")]
    return sorted({unquote(part.path) for part in parts if part.path and not part.scheme and not part.netloc})


def as_text(name: str) -> str:
    """A file's name with a mark in place of each byte that is not UTF-8: a zip and a page hold text alone."""
    return os.fsencode(name).decode(errors="replace")


def write_zip(out: Path, name: str, members: dict[str, Path | str]) -> int:
    """Writes the members below one folder of this name, whole or not at all; equal members give equal bytes.

    Returns the zip's size in bytes.
    """
    with half_made(out.parent) as (temp, _):
        with zipfile.ZipFile(temp / out.name, "w") as archive:
            for member, source in members.items():
                info = undated(as_text(f"{name}/{member}"))
                info.compress_type, info.create_system, info.external_attr = zipfile.ZIP_DEFLATED, 3, 0o644 << 16
                if isinstance(source, str):
                    archive.writestr(info, source)
                    continue
                info.file_size = source.stat().st_size
                with source.open("rb") as reading, archive.open(info, "w") as writing:
                    shutil.copyfileobj(reading, writing, 1 << 20)
        os.replace(temp / out.name, out)
    return out.stat().st_size
