"""Makes the README's pictures, `docs/demo-*.jpg`, from the folder of `make demo`.

    python tools/demo_pictures.py
"""

from __future__ import annotations

import argparse
import base64
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

    from gsac.pipeline.report.pictures import Picture

VIEWS = 4
"""Frames in a strip."""
HIGH = 420
"""Height of every picture, px."""
QUALITY = 82
"""JPEG quality."""
BROWSERS = ("chromium", "chromium-browser", "google-chrome")


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python tools/demo_pictures.py", description=__doc__.splitlines()[0])
    parser.add_argument("--run", type=Path, default=Path("demo/avatar"), metavar="DIR", help="default: demo/avatar")
    parser.add_argument("--out", type=Path, default=Path("docs"), metavar="DIR", help="default: docs")
    options = parser.parse_args(argv)
    from gsac.pipeline.report.pictures import Footage
    from gsac.pipeline.report.results import Results
    from gsac.pipeline.report.sheets import body_sheet, contact_sheet, heldout_sheet

    results = Results(options.run)
    footage = Footage(results)
    save(options.out / "demo-clip.jpg", join_strip(contact_sheet(footage).pictures))
    save(options.out / "demo-body.jpg", join_strip(body_sheet(footage).pictures))
    held = heldout_sheet(results).pictures
    save(options.out / "demo-heldout.jpg", decode(held[len(held) // 2].uri))
    save(options.out / "demo-viewer.jpg", photograph(options.run / "export" / "viewer.html"))
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

    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if not browser:
        sys.exit(f"demo_pictures: needs a browser to photograph {page}: one of {', '.join(BROWSERS)}")
    with tempfile.TemporaryDirectory() as home:
        shot = Path(home) / "shot.png"
        subprocess.run([browser, "--headless", "--no-sandbox", "--hide-scrollbars", "--use-angle=swiftshader",
                        "--enable-unsafe-swiftshader", f"--user-data-dir={home}/user", f"--screenshot={shot}",
                        "--window-size=760,760", "--virtual-time-budget=6000", page.resolve().as_uri()],
                       check=True, capture_output=True)
        image = cv2.imread(str(shot))
    return cv2.resize(image, (HIGH, HIGH), interpolation=cv2.INTER_AREA)


def save(path: Path, image: np.ndarray) -> None:
    """image: (H, W, 3) uint8 BGR."""
    import cv2

    path.parent.mkdir(parents=True, exist_ok=True)
    if not cv2.imwrite(str(path), image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY]):
        sys.exit(f"demo_pictures: cannot write {path}")
    print(path)


if __name__ == "__main__":
    sys.exit(main())
