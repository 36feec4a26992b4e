"""gsac bench viewer: frames a second of viewer.html, walking, against PlayCanvas with the same splats standing still.

Both run in headless Chromium without a graphics card, at the same size and distance, in turn; every frame is waited for. PlayCanvas
draws by software GL; viewer.html by each of its three backends, of which it chooses `software` by itself. Needs chromium and npm.
"""

from __future__ import annotations

import argparse
import shutil
import statistics
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.pipeline.command_parser import CommandParser
from gsac.stages.contract import BadInput, StageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gsac.avatar.gsac_file.rigged import RiggedAvatar
    from gsac.benchmarks.viewer.frame_rate import FrameRate

PACKAGE = "playcanvas@2.23.3"
PAGE = Path(__file__).with_name("playcanvas.html")
DRAWS = ("software", "webgl", "webgpu")
"""Backends of viewer.html."""
THEIRS = "PlayCanvas"
CAMERA = {"fov": 30.0, "dist": 3.8, "bg": "3a6080"}
"""Parameters of both pages: degrees, m, colour."""


def parser() -> CommandParser:
    out = CommandParser(prog="gsac bench viewer", description=(__doc__ or "").partition("\n")[0])
    out.add_argument("--out", type=Path, default=Path("bench-viewer"), metavar="DIR", help="default: bench-viewer")
    out.add_argument("--avatar", type=Path, metavar="FILE", help="an avatar.gsac; default: a made-up person")
    out.add_argument("--gaussians", type=int, default=6000, metavar="N", help="of the made-up person; default: 6000")
    out.add_argument("--size", type=int, default=512, metavar="PX", help="of the square picture; default: 512")
    out.add_argument("--draw", choices=DRAWS, nargs="+", default=DRAWS, help="backends of viewer.html; default: all")
    out.add_argument("--rounds", type=int, default=3, metavar="N", help="default: 3")
    out.add_argument("--seconds", type=float, default=6.0, metavar="N", help="length of one measurement; default: 6")
    return out


def main(argv: list[str] | None = None) -> int:
    options = parser().parse_args(argv)
    from gsac.benchmarks.viewer import browser, frame_rate

    if browser.find_chromium() is None or not shutil.which("npm"):
        raise BadInput("gsac bench viewer needs chromium and npm (Debian packages of those names)")
    options.out.mkdir(parents=True, exist_ok=True)
    avatar = prepare(options)
    rates: dict[str, list[frame_rate.FrameRate]] = {}
    with frame_rate.serve(options.out.absolute()) as address:
        for k in range(options.rounds):
            for name, page in pages(avatar, options.draw).items():
                picture = options.out / f"{name.lower()}.png" if k == 0 else None
                rates.setdefault(name, []).append(frame_rate.measure(f"{address}/{page}", options.size, options.seconds, picture))
                print(f"round {k + 1}: {name:11} {rates[name][-1].fps:6.2f} frames a second", file=sys.stderr)
    words = text(rates, len(avatar.gaussians), options.size)
    print(words)
    (options.out / "viewer.txt").write_text(words + "\n")
    return 0


def prepare(options: argparse.Namespace) -> RiggedAvatar:
    """Writes both pages and the splats, and installs PlayCanvas by npm. Returns the avatar."""
    from gsac.avatar.gsac_file.rigged import RiggedAvatar
    from gsac.benchmarks.viewer.avatar import make_avatar
    from gsac.stages.export.ply import ply_bytes
    from gsac.stages.export.stage import pose_gaussians
    from gsac.viewer.page import page_bytes

    avatar = make_avatar(options.gaussians) if options.avatar is None else RiggedAvatar.read(options.avatar)
    if "walk" not in avatar.clips:
        raise BadInput(f"{options.avatar}: it carries no clip walk; export it with export.animations=walk")
    splats = pose_gaussians(avatar, avatar.pose("A"))
    (options.out / "viewer.html").write_bytes(page_bytes(avatar_bytes(avatar)))
    (options.out / "avatar.ply").write_bytes(ply_bytes(*splats, avatar.gaussians.rgb, avatar.gaussians.opacity))
    shutil.copy(PAGE, options.out)
    if not (options.out / "node_modules" / "playcanvas").is_dir():
        done = subprocess.run(["npm", "install", "--silent", "--no-audit", "--no-fund", PACKAGE], cwd=options.out,
                              capture_output=True, text=True)
        if done.returncode:
            raise StageError(f"npm could not install {PACKAGE}: {done.stderr.strip() or 'it said nothing'}")
    return avatar


def pages(avatar: RiggedAvatar, draws: Sequence[str] = ("software",)) -> dict[str, str]:
    """Addresses of viewer.html, one a backend, and of PlayCanvas, with the same camera; PlayCanvas has the feet at y = 0."""
    middle = float(avatar.vertices[:, 1].max() + avatar.ground) / 2
    camera = "&".join(f"{name}={value}" for name, value in CAMERA.items())
    ours = f"clip=walk&yaw=0&pitch=0&target=0,{middle:.4f},0&{camera}"
    return {**{draw: f"viewer.html#draw={draw}&{ours}" for draw in draws},
            THEIRS: f"playcanvas.html#file=avatar.ply&height={middle - avatar.ground:.4f}&{camera}"}


def text(rates: dict[str, list[FrameRate]], count: int, size: int) -> str:
    """Medians over the rounds, and their ratios to PlayCanvas. count: gaussians; size: px."""
    fps = {name: statistics.median(r.fps for r in found) for name, found in rates.items()}
    work = {name: 1000 * statistics.median(r.cpu_s for r in found) for name, found in rates.items()}
    rows = [f"{name:11}  {fps[name]:6.2f} fps  {fps[name] / fps[THEIRS]:5.2f} x {THEIRS}  "
            f"{work[name]:6.1f} CPU ms a frame ({work[THEIRS] / work[name]:.2f} x)   "
            f"rounds: {', '.join(f'{r.fps:.2f}' for r in found)}" for name, found in rates.items()]
    return "\n".join([f"{count} gaussians, {size} x {size}, no graphics card; ours walks, {THEIRS} stands still", *rows])
