"""gsac view AVATAR: serves the viewer page to this machine's browser, or with --host to a phone or a headset."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
import webbrowser
from pathlib import Path

from gsac.cache.half_made import half_made, temporary_folder
from gsac.pipeline.lost_files import require_file
from gsac.pipeline.outcomes import ExitCode
from gsac.pipeline.page_server import PAGE, PageServer, find_network_address, make_certificate, serve
from gsac.pipeline.wrapping import fit
from gsac.stages.contract import BadInput

AVATAR = "avatar.gsac"
EXPECTED = "give the folder of a run whose stage export is done, its export folder, or a .gsac file"
ENDS = "Ctrl-C ends it."
EXPOSED = ("Whoever is in this network and has this address sees the avatar and can save its files, until Ctrl-C; "
           "nothing else of this machine is served.")
CERTIFICATE = "The certificate is made for this call alone, so the browser warns once: go on by 'Advanced'."
PLAIN = "Served without https, since there is no openssl here: the page works, but VR and AR need https."


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("avatar", type=Path, metavar="AVATAR",
                         help="the folder of a run, its export folder, a file in it, or an avatar.gsac that lies alone")
    command.add_argument("--port", type=int, default=0, metavar="N", help="default: any free one")
    command.add_argument("--no-browser", action="store_true", help="only say the address")
    command.add_argument("--host", action="store_true",
                         help="serve to the network too, for a phone or a headset, at an address nobody can guess; by https, "
                              "which VR and AR need, where the program openssl is there, else by plain http")
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    with half_made(temporary_folder()) as (folder, _):
        page = find_page(arguments.avatar, folder)
        with open_server(page, find_name(arguments.avatar), arguments, folder) as server:
            print(server.url, flush=True)
            if arguments.host:
                show_code(server.url)
                print(fit(f"{EXPOSED}\n{CERTIFICATE if server.scheme == 'https' else PLAIN}", sys.stderr), file=sys.stderr)
            elif not arguments.no_browser and has_screen():
                webbrowser.open(server.url)
            print(ENDS, file=sys.stderr, flush=True)
            with contextlib.suppress(KeyboardInterrupt):  # Ctrl-C is how a user ends it
                server.serve_forever()
    return ExitCode.OK


def open_server(page: Path, name: str, arguments: argparse.Namespace, folder: Path) -> PageServer:
    """The server that the options ask for. folder: where its certificate may lie."""
    if not arguments.host:
        return serve(page, arguments.port, name)
    host = find_network_address()
    if host is None:
        raise BadInput("--host: this machine has no address in a network; connect it to one, or leave --host out")
    return serve(page, arguments.port, name, host, make_certificate(folder, host))


def find_page(path: Path, spare: Path) -> Path:
    """viewer.html of a run's folder, of an export folder, or beside a file; an avatar without one gets its page in the folder
    `spare`. BadInput where there is none, or where its link leads to nothing."""
    if path.is_file() and path.suffix.lower() == ".gsac" and path.name != AVATAR:
        return make_page(path, spare)
    folders = [path / "export", path] if path.is_dir() else [path.parent]
    for folder in folders:
        if (folder / PAGE).is_file():
            return folder / PAGE
        require_file(folder / PAGE)
    require_file(path)
    for folder in folders:
        if (folder / AVATAR).is_file() and (path.is_dir() or path.name == AVATAR):
            return make_page(folder / AVATAR, spare)
    raise BadInput(f"{path}: {why_not(path)}; {EXPECTED}")


def why_not(path: Path) -> str:
    """What is wrong with a path that leads to no page."""
    if not path.exists():
        return "no such file or folder"
    return f"no {PAGE} and no {AVATAR} here" if path.is_dir() else f"no {PAGE} lies beside it, and it is no .gsac file"


def find_name(path: Path) -> str:
    """The avatar's name: its run's folder without `-avatar`, or the file's own name."""
    here = Path(os.path.abspath(path))  # without `..`, which a browser takes out of an address
    if here.is_file() and here.suffix.lower() == ".gsac" and here.name != AVATAR:
        name = here.stem
    else:
        folder = here if here.is_dir() else here.parent
        name = (folder.parent if folder.name == "export" else folder).name.removesuffix("-avatar")
    return name if name.strip(".") else "avatar"


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


def has_screen() -> bool:
    """Whether a browser with a window can open here: without one a text browser would take the terminal."""
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def show_code(url: str) -> None:
    """Draws the address as a QR code in the terminal."""
    import segno

    segno.make(url, error="l").terminal(out=sys.stderr, compact=True)
