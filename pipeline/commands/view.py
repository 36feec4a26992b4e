"""gsac view AVATAR: serves the viewer page on localhost."""

from __future__ import annotations

import argparse
import contextlib
import functools
import http.server
import tempfile
from pathlib import Path

from gsac.pipeline.lost_files import require_file
from gsac.pipeline.outcomes import ExitCode
from gsac.stages.contract import BadInput

PAGE = "viewer.html"


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("avatar", type=Path, metavar="AVATAR",
                         help="the folder of a run, its export folder, a file in it, or an avatar.gsac that lies alone")
    command.add_argument("--port", type=int, default=0, metavar="N", help="default: any free one")
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    with tempfile.TemporaryDirectory() as folder, serve(find_page(arguments.avatar, Path(folder)), arguments.port) as server:
        print(address(server), flush=True)
        with contextlib.suppress(KeyboardInterrupt):  # Ctrl-C is how a user ends it
            server.serve_forever()
    return ExitCode.OK


def find_page(path: Path, spare: Path) -> Path:
    """viewer.html of a run's folder, of an export folder, or beside a file; a .gsac file without one gets its page in the
    folder `spare`. BadInput where there is none, or where its link leads to nothing."""
    folders = [path / "export", path] if path.is_dir() else [path.parent]
    for folder in folders:
        if (folder / PAGE).is_file():
            return folder / PAGE
        require_file(folder / PAGE)
    require_file(path)
    if path.is_file() and path.suffix.lower() == ".gsac":
        return make_page(path, spare)
    raise BadInput(f"{path}: no {PAGE} here; give the folder of a run whose stage export is done")


def make_page(path: Path, folder: Path) -> Path:
    """Writes the page of an avatar file into a folder. BadInput where the file is no avatar."""
    from gsac.avatar.artifacts import ArtifactError
    from gsac.avatar.gsac_file.rigged import RiggedAvatar
    from gsac.viewer.page import page_bytes

    try:
        RiggedAvatar.read(path)
    except ArtifactError as e:
        raise BadInput(str(e)) from e
    (folder / PAGE).write_bytes(page_bytes(path.read_bytes()))
    return folder / PAGE


class Handler(http.server.SimpleHTTPRequestHandler):
    """Serves the files of one folder without logging requests."""

    def log_message(self, *words: object) -> None:
        pass


def serve(page: Path, port: int) -> http.server.ThreadingHTTPServer:
    """A server of the page's folder on localhost only."""
    handler = functools.partial(Handler, directory=str(page.parent))
    try:
        return http.server.ThreadingHTTPServer(("127.0.0.1", port), handler)
    except (OSError, OverflowError) as e:
        raise BadInput(f"--port {port}: cannot be opened ({e}); choose another or leave it out") from e


def address(server: http.server.ThreadingHTTPServer) -> str:
    """URL of the page."""
    return f"http://127.0.0.1:{server.server_address[1]}/{PAGE}"
