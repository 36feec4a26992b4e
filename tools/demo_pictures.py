"""Makes the README's pictures and film, `docs/demo-*`, from the folder of `make demo`.

    python tools/demo_pictures.py
"""

from __future__ import annotations

import argparse
import base64
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

    from gsac.avatar.gsac_file.rigged import RiggedAvatar
    from gsac.avatar.motion.source import Motion
    from gsac.pipeline.report.pictures import Picture

VIEWS = 4
"""Frames in a strip."""
HIGH = 420
"""Height of every picture, px."""
QUALITY = 82
"""JPEG quality."""
TURN_S, BLEND_S, WALKS = 6.0, 0.6, 4
"""Of the film: seconds of the turn and between its poses, and double steps of the walk."""
RENDER = ("--size", "480x640", "--yaw", "30", "--background", "f4f2ee")
"""Options of the film's `gsac render`."""
FILM_QUALITY, FILM_METHOD = 75, 4
"""WebP quality of the film, and the effort of its encoder, 0 to 6."""
WINDOW, VIEW = (760, 760), "clip=walk&turntable=off&yaw=30"
"""Of the viewer page's picture: px of the window, and the part of the address that says what is seen."""


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python tools/demo_pictures.py", description=__doc__.splitlines()[0])
    parser.add_argument("--run", type=Path, default=Path("demo/avatar"), metavar="DIR", help="default: demo/avatar")
    parser.add_argument("--out", type=Path, default=Path("docs"), metavar="DIR", help="default: docs")
    options = parser.parse_args(argv)
    from gsac.pipeline.report.pictures import RunPictures
    from gsac.pipeline.report.results import Results
    from gsac.pipeline.report.sheets import body_sheet, contact_sheet, heldout_sheet

    results = Results(options.run)
    run = RunPictures(results)
    save(options.out / "demo-clip.jpg", join_strip(contact_sheet(run).pictures))
    save(options.out / "demo-body.jpg", join_strip(body_sheet(run).pictures))
    held = heldout_sheet(results).pictures
    save(options.out / "demo-heldout.jpg", decode(held[len(held) // 2].uri))
    save(options.out / "demo-viewer.jpg", photograph(options.run / "export" / "viewer.html"))
    write_film(options.run / "export" / "avatar.gsac", options.out / "demo-film.webp")
    return 0


def decode(uri: str) -> np.ndarray:
    """Image (H, W, 3) uint8 BGR of a data URI, resized to H = `HIGH`."""
    import cv2
    import numpy as np

    image = cv2.imdecode(np.frombuffer(base64.b64decode(uri.partition(",")[2]), np.uint8), cv2.IMREAD_COLOR)
    return cv2.resize(image, (round(image.shape[1] * HIGH / image.shape[0]), HIGH), interpolation=cv2.INTER_AREA)


def join_strip(pictures: list[Picture]) -> np.ndarray:
    """`VIEWS` evenly spaced pictures side by side, (H, W, 3) uint8 BGR."""
    import numpy as np

    return np.hstack([decode(pictures[i * len(pictures) // VIEWS].uri) for i in range(VIEWS)])


def photograph(page: Path) -> np.ndarray:
    """Screenshot (H, W, 3) uint8 BGR of the viewer page."""
    import cv2

    from gsac.benchmarks.viewer.browser import Browser, find_chromium

    if find_chromium() is None:
        sys.exit(f"demo_pictures: needs the Debian package chromium to photograph {page}")
    browser = Browser(*WINDOW)
    try:
        browser.open(f"{page.resolve().as_uri()}#{VIEW}")
        image = browser.picture()[:, :, ::-1]
    finally:
        browser.close()
    return cv2.resize(image, (HIGH, HIGH), interpolation=cv2.INTER_AREA)


def write_film(avatar: Path, path: Path) -> None:
    """The avatar of a file turns once and walks: rendered by `gsac render`, its pictures joined to a WebP that plays for ever."""
    import numpy as np
    from PIL import Image

    from gsac.avatar.gsac_file.rigged import RiggedAvatar

    motion = turn_and_walk(RiggedAvatar.read(avatar))
    with tempfile.TemporaryDirectory() as home:
        file, frames = Path(home) / "film.npz", Path(home) / "frames"
        np.savez(file, poses=motion.rotation.reshape(len(motion.rotation), -1), trans=motion.transl, mocap_framerate=motion.fps)
        subprocess.run([sys.executable, "-m", "gsac.pipeline.cli", "render", str(avatar), "--motion", str(file),
                        "--out", str(frames), "--fps", f"{motion.fps:g}", *RENDER], check=True, stdout=subprocess.DEVNULL)
        first, *others = [Image.open(frame) for frame in sorted(frames.iterdir())]
        first.save(path, save_all=True, append_images=others, duration=round(1000 / motion.fps), loop=0, quality=FILM_QUALITY,
                   method=FILM_METHOD)
    print(path)


def turn_and_walk(avatar: RiggedAvatar) -> Motion:
    """The A-pose turns once, walks on the spot and stands again; the key after the last would be the first."""
    import numpy as np

    from gsac.avatar.motion.source import Motion

    walk, standing = avatar.clips["walk"], avatar.pose("A")
    turn, blend = round(TURN_S * walk.fps), round(BLEND_S * walk.fps)
    steps = np.arange(WALKS * len(walk.rotation) + blend)
    pose = np.tile(standing, (turn + len(steps), 1, 1))
    pose[:turn, 0, 1] = 2 * np.pi * ease(np.arange(turn) / turn)
    walking = np.zeros((len(steps), *standing.shape))
    walking[:, [avatar.joint_names.index(name) for name in walk.joints]] = walk.rotation[steps % len(walk.rotation)]
    share = ease(np.minimum(steps, steps[::-1] + 1) / blend)[:, None]
    pose[turn:] += share[..., None] * (walking - standing)  # half a radian at most: axis-angle will do
    transl = np.zeros((len(pose), 3))
    transl[turn:] = share * walk.transl[steps % len(walk.rotation)]
    return Motion(walk.fps, pose.astype(np.float32), transl.astype(np.float32))


def ease(share: np.ndarray) -> np.ndarray:
    """0 to 1, beginning and ending at rest. share: any shape, from 0; 1 and more give 1."""
    share = share.clip(0, 1)
    return share * share * (3 - 2 * share)


def save(path: Path, image: np.ndarray) -> None:
    """image: (H, W, 3) uint8 BGR."""
    import cv2

    from gsac.avatar.frame_files import write_image

    path.parent.mkdir(parents=True, exist_ok=True)
    write_image(path, image, cv2.IMWRITE_JPEG_QUALITY, QUALITY)
    print(path)


if __name__ == "__main__":
    sys.exit(main())
