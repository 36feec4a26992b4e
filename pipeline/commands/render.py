"""gsac render AVATAR: a video, a GIF or pictures of the avatar, moved by a motion file or seen from all sides."""

from __future__ import annotations

import argparse
import math
import re
import time
from pathlib import Path
from typing import TYPE_CHECKING

from gsac.avatar.video import ENCODERS, TRANSPARENT
from gsac.cache.half_made import half_made
from gsac.pipeline.avatar_file import EXPORT, find_avatar, folder_around, name_avatar, refuse_footage
from gsac.pipeline.commands.options import add_force, add_json, progress_reporter, require_free, warn_stale
from gsac.pipeline.journal import Journal
from gsac.pipeline.json_output import emit
from gsac.pipeline.outcomes import ExitCode, Outcome
from gsac.stages.contract import BadInput, StageError, did_you_mean

if TYPE_CHECKING:
    import numpy as np

    from gsac.avatar.gsac_file.rigged import RiggedAvatar
    from gsac.avatar.motion.source import Motion

FILMS = tuple(ENCODERS)
"""Suffixes of --out; without one it is a folder of pictures."""
HEIGHT, WIDTHS = 960, (720, 1280)
"""Of the picture, px, unless told: its height, and the least and largest width."""
SIZES = (16, 4096)
"""Least and largest width or height, px."""
TURN_S = 6.0
"""How long the turn takes, s, unless told."""


def declare(command: argparse.ArgumentParser) -> None:
    command.add_argument("avatar", type=Path, metavar="AVATAR",
                         help="avatar.gsac, or the folder of a run or its export folder")
    command.add_argument("--motion", metavar="FILE",
                         help="a .bvh, .fbx (Mixamo), .glb, .vrma, .gltf with its buffers inside or AMASS-style .npz file, or the "
                              "name of a clip in the avatar (walk, wave); without it the avatar is seen from all sides")
    command.add_argument("--out", type=Path, metavar="FILE",
                         help="a .mp4, .webm, .mov (ProRes 4444) or .gif, or a new folder for PNG pictures; "
                              "default: <avatar>-<motion>.mp4 here, without a motion <avatar>-turn.mp4")
    add_force(command)
    command.add_argument("--size", metavar="WxH",
                         help=f"pixels, even numbers; default: {HEIGHT} high and as wide as the motion needs to fill that, "
                              f"{WIDTHS[0]} to {WIDTHS[1]}")
    command.add_argument("--fps", type=float, default=30.0, metavar="N", help="default: 30")
    command.add_argument("--seconds", type=float, metavar="N",
                         help=f"no more of the motion than this; of the turn, how long it takes (default: {TURN_S:g})")
    command.add_argument("--background", default="2b303b", metavar="RRGGBB",
                         help="or none: transparent, for .webm, .mov, .gif and PNG pictures; default: 2b303b")
    command.add_argument("--floor", metavar="RRGGBB", help="a floor of this colour with lines half a metre apart, which fades out")
    command.add_argument("--no-shadow", action="store_true", help="no soft shadow on the floor")
    command.add_argument("--yaw", type=float, metavar="DEGREES",
                         help="where the camera stands around a motion; default: 0, in front")
    add_json(command)
    command.set_defaults(do=do)


def do(arguments: argparse.Namespace) -> ExitCode:
    size = parse_size(arguments.size) if arguments.size else None
    background = None if arguments.background == "none" else parse_colour("--background", arguments.background)
    floor = parse_colour("--floor", arguments.floor) if arguments.floor else None
    if not 1 <= arguments.fps <= 240:
        raise BadInput(f"--fps {arguments.fps:g}: expected 1 to 240")
    if arguments.seconds is not None and not 0 < arguments.seconds <= 3600:
        raise BadInput(f"--seconds {arguments.seconds:g}: expected more than 0, at most 3600")
    if arguments.yaw is not None and not -360 <= arguments.yaw <= 360:
        raise BadInput(f"--yaw {arguments.yaw:g}: expected degrees, -360 to 360")
    if arguments.yaw is not None and arguments.motion is None:
        raise BadInput(f"--yaw {arguments.yaw:g}: goes with --motion alone; without one the avatar is seen from all sides")
    file = find_avatar(arguments.avatar)
    out = (arguments.out or Path(default_name(file, arguments.motion))).absolute()
    check_out(out, file, arguments.force)
    if background is None and out.suffix.lower() not in ("", *TRANSPARENT):
        raise BadInput(f"--background none: {out.suffix} holds no transparency; expected --out with {' or '.join(TRANSPARENT)}, "
                       "or a folder for PNG pictures")
    with progress_reporter(arguments) as reporter:
        warn_stale(folder_around(file), reporter, EXPORT)
        began, journal = time.monotonic(), Journal(reporter.take)
        avatar, motion = read_avatar(file, arguments.motion)
        journal.starts("render", f"{file.name} to {out}")
        frames, (width, height) = film(avatar, motion, arguments, out, size, background, floor, journal)
        seconds = time.monotonic() - began
        journal.finishes("render", seconds)
    if arguments.json:
        emit({"stages": [{"name": "render", "status": Outcome.RAN.value, "seconds": seconds, "key": None}],
              "outputs": {"video": str(out)},
              "metrics": {"frames": frames, "fps": arguments.fps, "width": width, "height": height,
                          "seconds_a_frame": seconds / frames}})
    else:
        print(out)
    return ExitCode.OK


def read_avatar(file: Path, motion: str | None) -> tuple[RiggedAvatar, Motion | None]:
    """The avatar and how it moves, before what draws it is loaded. motion: as for `find_motion`. BadInput names a damaged file."""
    from gsac.avatar.artifacts import ArtifactError
    from gsac.avatar.gsac_file.rigged import RiggedAvatar

    try:
        avatar = RiggedAvatar.read(file)
        return avatar, find_motion(motion, avatar)
    except ArtifactError as e:
        raise BadInput(str(e)) from e


def film(avatar: RiggedAvatar, motion: Motion | None, arguments: argparse.Namespace, out: Path, size: tuple[int, int] | None,
         background: np.ndarray | None, floor: np.ndarray | None, journal: Journal) -> tuple[int, tuple[int, int]]:
    """Writes the video. Returns the number of its frames, and their width and height, px.

    background, floor: (3,) RGB in 0..1.
    """
    from gsac.avatar.film import draw_frames, fit_aspect, performance, turntable
    from gsac.avatar.video import Pictures, Video, VideoError

    try:
        plan = (turntable(avatar, arguments.seconds or TURN_S, arguments.fps) if motion is None
                else performance(motion, arguments.fps, arguments.seconds, arguments.yaw or 0.0))
        size = size or (min(max(2 * math.ceil(fit_aspect(avatar, plan) * HEIGHT / 2), WIDTHS[0]), WIDTHS[1]), HEIGHT)
        with half_made(out.parent) as (folder, _):
            made = folder / out.name
            with Video(made, *size, arguments.fps, background is None) if out.suffix else Pictures(made) as video:
                for done, frame in enumerate(draw_frames(avatar, plan, *size, background, shadow=not arguments.no_shadow,
                                                         floor=floor)):
                    journal.progress("render", done, len(plan), "frames")
                    video.add(frame)
            made.replace(out)
    except VideoError as e:
        raise StageError(str(e).replace(str(made), str(out))) from e
    return len(plan), size


def check_out(out: Path, file: Path, force: bool) -> None:
    """Raises BadInput unless the film of the avatar `file` can be written to `out` and takes nobody's place."""
    if (out.suffix and out.suffix.lower() not in FILMS) or not out.parent.is_dir():
        raise BadInput(f"--out {out}: expected a file {', '.join(FILMS)}, or a new folder for PNG pictures, "
                       "in a folder that exists")
    if not out.suffix:
        if out.is_file() or (out.is_dir() and any(out.iterdir())):
            raise BadInput(f"--out {out}: pictures go to a new or empty folder, and this is there already; give another name")
        return
    refuse_footage(out, file)
    require_free(out, force)


def find_motion(asked: str | None, avatar: RiggedAvatar) -> Motion | None:
    """The motion of a file, or of the avatar's own clips by name; None where none is asked for."""
    if asked is None:
        return None
    if Path(asked).is_file():
        from gsac.avatar.motion.files import read_motion

        return read_motion(Path(asked), avatar.joint_names, avatar.parents, avatar.joints)
    if asked not in avatar.clips:
        raise BadInput(f"--motion {asked}: no such file{did_you_mean(asked, avatar.clips)}, and the avatar's clips are: "
                       f"{', '.join(avatar.clips) or 'none'}")
    import numpy as np

    from gsac.avatar.motion.source import Motion

    clip = avatar.clips[asked]
    closed = [*range(len(clip.rotation)), *([0] if clip.loop else [])]
    rotation = np.zeros((len(closed), len(avatar.joints), 3), np.float32)
    rotation[:, [avatar.joint_names.index(name) for name in clip.joints]] = clip.rotation[closed]
    return Motion(clip.fps, rotation, clip.transl[closed])


def default_name(file: Path, motion: str | None) -> str:
    """`<avatar>-turn.mp4` or `<avatar>-<motion>.mp4`. file: the avatar.gsac; motion: a file's path or a clip's name."""
    return f"{name_avatar(file)}-{Path(motion).stem if motion else 'turn'}.mp4"


def parse_size(words: str) -> tuple[int, int]:
    """Width and height of `WxH`."""
    found = re.fullmatch(r"(\d{1,5})x(\d{1,5})", words)
    numbers = [int(n) for n in found.groups()] if found else []
    if not numbers or not all(SIZES[0] <= n <= SIZES[1] and n % 2 == 0 for n in numbers):
        raise BadInput(f"--size {words}: expected WIDTHxHEIGHT, even numbers of {SIZES[0]} to {SIZES[1]}, for example 720x960")
    return numbers[0], numbers[1]


def parse_colour(option: str, words: str) -> np.ndarray:
    """(3,) RGB in 0..1 of `rrggbb`."""
    import numpy as np

    if not re.fullmatch(r"#?[0-9a-fA-F]{6}", words):
        raise BadInput(f"{option} {words}: expected six hexadecimal digits, for example ffffff")
    return np.array([int(words.lstrip("#")[i:i + 2], 16) / 255 for i in (0, 2, 4)])
