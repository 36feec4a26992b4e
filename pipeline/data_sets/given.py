"""What is read of a data set: a clip with masks, its camera, poses where they are given, and the published split."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from gsac.pipeline import text_lines
from gsac.stages.contract import BadInput
from gsac.stages.split.photos import natural_order

PICTURES = (".png", ".jpg", ".jpeg")


@dataclass
class Lens:
    """A pinhole camera of all frames, px."""

    focal: tuple[float, float]
    center: tuple[float, float]


@dataclass
class GivenClip:
    """One clip of a data set, ready to be written."""

    name: str
    """Of the folder that it is written to."""
    numbers: list[int]
    """Of the frames, rising: the time of a frame is its number over fps."""
    frames: Callable[[], Iterator[tuple[np.ndarray, np.ndarray | None]]]
    """Gives rgb (H, W, 3) uint8 of each frame in order and, where the clip is masked, mask (H, W) uint8, 255 on the person."""
    notice: str
    """Where the data come from and under which terms."""
    fps: float
    lens: Lens | None = None
    extrinsics: np.ndarray | None = None  # (T, 3, 4) world -> camera
    """None: the camera stands still, and its axes are the world's."""
    poses: dict[str, np.ndarray] = field(default_factory=dict)  # (T, ...)
    """Body parameters by the names of the body model's own package, in the camera's axes."""
    train: list[int] = field(default_factory=list)
    """Numbers of the frames to train on."""
    test: list[int] = field(default_factory=list)
    """Numbers of the frames to judge by; none where no split is published."""
    split_source: str = ""
    """Whose split this is."""
    sources: list[str] | None = None
    """Name of each frame in the data set, where it is another."""
    masked: bool = True
    """Whether there are masks."""

    def names(self, numbers: list[int]) -> list[str]:
        """Names of frames, without an ending."""
        return [f"{number:06d}" for number in numbers]


def need_file(path: Path, what: str = "") -> Path:
    """The path. Raises BadInput where no file is there, with the names that are. what: it is, in words."""
    if path.is_file():
        return path
    raise _missing(path, what or "the file")


def need_folder(path: Path, what: str = "") -> Path:
    """The path. Raises BadInput where no folder is there, with the names that are. what: it is, in words."""
    if path.is_dir():
        return path
    raise _missing(path, what or "the folder")


def _missing(path: Path, what: str) -> BadInput:
    there = sorted(p.name for p in path.parent.iterdir() if not p.name.startswith("."))[:12] if path.parent.is_dir() else None
    has = "which is no folder" if there is None else f"which has {', '.join(there) or 'nothing'}"
    return BadInput(f"{path}: is missing; {what} {path.name} is expected in {path.parent}, {has}. Unpack the data set whole, with "
                    "its own names")


def need_lens(lens: Lens, path: Path) -> Lens:
    """The lens. Raises BadInput unless it is one. path: the file that it was read from."""
    if not np.isfinite([*lens.focal, *lens.center]).all() or min(lens.focal) <= 0:
        raise BadInput(f"{path}: has focal lengths {lens.focal} and centre {lens.center}; expected two lengths above 0 px, and all "
                       "numbers finite")
    return lens


def has_pictures(folder: Path) -> bool:
    """Whether pictures lie in a folder itself."""
    return any(is_picture(path) for path in folder.iterdir())


def is_picture(path: Path) -> bool:
    """Whether its name is that of a picture."""
    return path.suffix.lower() in PICTURES and not path.name.startswith(".")


def list_pictures(folder: Path) -> list[Path]:
    """The pictures of a folder in natural order (2 before 10). Raises BadInput where it has none."""
    found = sorted(filter(is_picture, need_folder(folder).iterdir()), key=natural_order)
    if not found:
        raise BadInput(f"{folder}: holds no pictures; expected {', '.join(PICTURES)} files")
    return found


def read_lines(path: Path, what: str = "") -> list[str]:
    """The lines of a text file without the empty ones. what: it is, in words."""
    try:
        return text_lines.read_lines(need_file(path, what))
    except UnicodeDecodeError as e:
        raise BadInput(f"{path}: is no text in UTF-8 ({e.reason}); download it again, or save it as UTF-8") from e


def read_names(path: Path, numbers: dict[str, int]) -> list[int]:
    """The numbers, rising, of the frames that a split names, one a line. numbers: of each frame by its name."""
    names = read_lines(path, "the split")
    unknown = [name for name in names if name not in numbers]
    if unknown or not names:
        raise BadInput(f"{path}: names {unknown[0] if unknown else 'no frame'}{', which is not in images' if unknown else ''}; "
                       f"expected names such as {next(iter(numbers))}, one a line")
    return sorted({numbers[name] for name in names})


def read_rgb(path: Path) -> np.ndarray:
    """(H, W, 3) uint8."""
    image = cv2.imread(str(need_file(path)), cv2.IMREAD_COLOR)
    if image is None:
        raise BadInput(f"{path}: cannot be read as a picture; download it again")
    return np.ascontiguousarray(image[..., ::-1])


def read_grey(path: Path) -> np.ndarray:
    """(H, W) as it is stored; of a picture in colours the first channel."""
    image = cv2.imread(str(need_file(path)), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise BadInput(f"{path}: cannot be read as a picture; download it again")
    return image if image.ndim == 2 else image[..., 0]


def same_size(rgb: np.ndarray, mask: np.ndarray, path: Path) -> None:
    """Raises BadInput unless rgb (H, W, 3) and mask (H, W) have one size. path: the mask's file."""
    if rgb.shape[:2] != mask.shape:
        raise BadInput(f"{path}: the mask has {mask.shape[1]}x{mask.shape[0]} px, its frame {rgb.shape[1]}x{rgb.shape[0]}")
