"""Pictures of artifacts: frames as PNG and masks as half EXR files; who only looks at a run imports nothing heavy by this."""

from __future__ import annotations

import struct
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from gsac.avatar.artifacts import ArtifactError
from gsac.avatar.files import told_no_room, write_file

if TYPE_CHECKING:  # numpy is imported where it works
    import numpy as np


def read_frame(path: Path) -> np.ndarray:
    """(H, W, 3) uint8 RGB."""
    import cv2
    import numpy as np

    try:
        data = np.fromfile(path, np.uint8)  # OpenCV's own reading ends the process where the path is not UTF-8
    except OSError as e:
        raise ArtifactError(f"{path}: cannot be read ({e.strerror})") from e
    image = cv2.imdecode(data, cv2.IMREAD_COLOR) if len(data) else None
    if image is None:
        raise ArtifactError(f"{path}: cannot be read as an image")
    return cv2.cvtColor(image, cv2.COLOR_BGR2RGB)


def image_size(path: Path) -> tuple[int, int]:
    """Width and height, px, of a frame or mask, from the head of its PNG or EXR."""
    try:
        with open(path, "rb") as stream:
            if path.suffix == ".png":
                width, height = struct.unpack_from(">II", stream.read(24), 16)
                return width, height
            import OpenEXR

            (x0, y0), (x1, y1) = OpenEXR.File(stream, header_only=True).header()["dataWindow"]
            return int(x1 - x0 + 1), int(y1 - y0 + 1)
    except (OSError, RuntimeError, struct.error) as e:
        raise ArtifactError(f"{path}: cannot be read as an image") from e


def write_frame(path: Path, rgb: np.ndarray) -> None:
    """rgb: (H, W, 3) uint8."""
    import cv2

    write_image(path, cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR))


def write_image(path: Path, image: np.ndarray, *settings: int) -> None:
    """image: (H, W) or (H, W, 3) uint8, BGR; settings: OpenCV's, of the format that the suffix names."""
    import cv2

    ok, content = cv2.imencode(path.suffix, image, settings)
    if not ok:
        raise OSError(f"{path}: an image of shape {image.shape} cannot be encoded")
    write_file(path, content.tobytes())


def read_alpha(path: Path) -> np.ndarray:
    """(H, W) float32 in 0..1 from a one-channel half EXR."""
    import numpy as np
    import OpenEXR

    try:
        with _open_exr(path) as source, OpenEXR.File(source) as f:
            alpha = np.ascontiguousarray(next(iter(f.channels().values())).pixels, dtype=np.float32)
    except (OSError, RuntimeError, StopIteration, ValueError) as e:
        raise ArtifactError(f"{path}: cannot be read as a mask ({e or type(e).__name__})") from e
    if alpha.ndim != 2 or not (alpha.min() >= 0 and alpha.max() <= 1):
        raise ArtifactError(f"{path}: expected one channel, every pixel in 0..1")
    return alpha


def _open_exr(path: Path) -> AbstractContextManager[str | BinaryIO]:
    """What OpenEXR reads a file by: its path, or where that is not UTF-8, which it opens none of, a stream.

    Each piece that it takes from a stream waits for the interpreter's lock: beside busy threads that is ten times as slow.
    """
    try:
        str(path).encode()
    except UnicodeEncodeError:
        return open(path, "rb")
    return nullcontext(str(path))


def write_alpha(path: Path, alpha: np.ndarray) -> None:
    """alpha: (H, W) in 0..1; written as one half channel `A`, ZIP."""
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"A": alpha.astype("float16")}) as f:
        try:
            f.write(str(path))  # it has no encoder into memory, but looks at each write
        except RuntimeError as error:
            raise told_no_room(str(error), path) or OSError(f"{path}: cannot be written ({error})") from error
