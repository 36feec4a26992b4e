"""Artifact files: the one place that knows their names, arrays and shapes; docs/artifacts.md gives units and meanings.

Readers return plain arrays; writers are byte-deterministic; checks raise `ArtifactError` and import nothing heavy. `frame_files.py`
reads and writes the pictures.
A letter in a shape is one length throughout a file: T kept frames, B betas, E expression size, N gaussians or vertices, F faces.
"""

from __future__ import annotations

import io
import json
import math
import zipfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, asdict, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, cast

from gsac.avatar.files import write_file

if TYPE_CHECKING:  # numpy is imported where it works: every `gsac status` reads this file
    import numpy as np


class ArtifactError(Exception):
    """A file is not what its port promises. The message names the file, the array and what was expected."""


@dataclass(frozen=True)
class Crop:
    """The part of the footage that the frames show."""

    x: int
    """px of the upright footage, as y, width and height."""
    y: int
    width: int
    height: int
    scale: float
    """Frames' px per px of the footage."""


@dataclass
class Clip:
    """clip.json of `split`."""

    fps: float | None
    """Frames a second of the source; None for photos."""
    timestamps_s: list[float] | None
    """True presentation time of each kept frame; None for photos: no temporal terms then."""
    width: int
    height: int
    focal_px: float | None
    """From the file's metadata, else None."""
    source_sha256: str
    """Of the video file, or of the photos in order."""
    notes: list[str] = field(default_factory=list)
    """What was changed on the way, for people: `transparency composited over black`."""
    crop: Crop | None = None
    """None: the frames show the whole footage."""
    center: tuple[float, float] | None = None
    """Principal point, px; None: the frame's middle."""
    repeated: list[int] = field(default_factory=list)
    """Frames whose picture shows an earlier one's moment: no stage learns from them."""

    @property
    def principal_point(self) -> tuple[float, float]:
        """px."""
        return self.center or (self.width / 2, self.height / 2)

    def shows_own_moment(self, frames: int) -> np.ndarray:
        """(T,) bool: all but the repeated ones of so many frames."""
        import numpy as np

        return ~np.isin(np.arange(frames), self.repeated)

    @property
    def longer_side(self) -> float:
        """Of the footage, cut or not, in px of the frames: what a focal length is guessed from."""
        if self.crop is None:
            return max(self.width, self.height)
        middle = self.principal_point
        return 2 * max(middle[0] + self.crop.x * self.crop.scale, middle[1] + self.crop.y * self.crop.scale)

    def write(self, path: Path) -> None:
        cut = {"crop", "center"} if self.crop is None and self.center is None else set()
        cut |= set() if self.repeated else {"repeated"}
        values = {name: value for name, value in asdict(self).items() if name not in cut}
        write_file(path, (json.dumps(values, indent=1, sort_keys=True) + "\n").encode())

    @classmethod
    def read(cls, path: Path) -> Clip:
        """Raises ArtifactError that names the field which is missing."""
        values = _read_json(path)
        if not isinstance(values, dict):
            raise ArtifactError(f"{path}: expected a JSON object, not a {type(values).__name__}")
        for each in fields(cls):
            if each.name not in values and each.default_factory is MISSING and each.default is MISSING:
                raise ArtifactError(f"{path}: field {each.name} is missing (has {', '.join(sorted(values))})")
        for name, (words, fits) in CLIP_FIELDS.items():
            if name in values and not fits(values[name]):
                raise ArtifactError(f"{path}: field {name} is {str(values[name])[:40]!r}, expected {words}")
        clip = cls(**{each.name: values[each.name] for each in fields(cls) if each.name in values})
        try:
            if cut := values.get("crop"):
                clip.crop = Crop(int(cut["x"]), int(cut["y"]), int(cut["width"]), int(cut["height"]), float(cut["scale"]))
            if values.get("center"):
                x, y = map(float, values["center"])
                clip.center = x, y
        except (KeyError, TypeError, ValueError) as e:
            raise ArtifactError(f"{path}: crop and center must be an object of {', '.join(f.name for f in fields(Crop))}, "
                                f"and two numbers ({e})") from e
        return clip


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_list(value: object, of: Callable[[object], bool]) -> bool:
    return isinstance(value, list) and all(map(of, value))


CLIP_FIELDS: Mapping[str, tuple[str, Callable[[object], bool]]] = {
    "fps": ("a number or null", lambda value: value is None or _is_number(value)),
    "timestamps_s": ("a list of numbers or null", lambda value: value is None or _is_list(value, _is_number)),
    "width": ("a whole number of px", lambda value: type(value) is int),
    "height": ("a whole number of px", lambda value: type(value) is int),
    "focal_px": ("a number above 0 or null", lambda value: value is None or _is_number(value) and cast("float", value) > 0),
    "source_sha256": ("text", lambda value: isinstance(value, str)),
    "repeated": ("a list of frame numbers", lambda value: _is_list(value, lambda t: type(t) is int)),
}
"""Field of clip.json -> what it must be, in words and as a test."""


def frame_paths(frames: Path) -> list[Path]:
    """(T,) sorted `%06d.png` or `%06d.exr` files of a folder."""
    return sorted(p for p in Path(frames).iterdir() if p.suffix in (".png", ".exr") and p.stem.isdigit())


def write_arrays(path: Path, **arrays: np.ndarray) -> None:
    """Compressed npz, no pickle, byte-deterministic. arrays: (...) of any shape, by name."""
    pack_arrays(path, arrays.items())


def pack_arrays(path: Path, arrays: Iterable[tuple[str, np.ndarray]]) -> None:
    """As `write_arrays`, of names and arrays (...): each is compressed as soon as it comes."""
    import numpy as np

    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, array in arrays:
            with packed.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.asanyarray(array), allow_pickle=False)
    write_file(path, content.getvalue())


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """All arrays (...) of an npz by name, unchecked; objects are refused."""
    from gsac.avatar.npz import NpzError, read_npz

    try:
        return read_npz(path)
    except (OSError, NpzError) as e:
        raise ArtifactError(f"{path}: not a readable npz ({e})") from e


Shapes = Mapping[str, tuple[int | str, ...]]
"""Array -> its shape; a letter stands for one length, the same wherever it appears in the file."""


def check_arrays(path: Path, shapes: Shapes, *groups: Shapes) -> dict[str, np.ndarray]:
    """Reads an npz and checks names, shapes and kinds. Returns its arrays (...) by name, those that nobody asked for among them.

    groups: arrays of which a file has all or none.
    """
    arrays = read_arrays(path)
    shapes = dict(shapes)
    for group in groups:
        shapes |= group if group.keys() & arrays.keys() else {}
    sizes: dict[str, int] = {}
    for name, shape in shapes.items():
        if name not in arrays:
            raise ArtifactError(f"{path}: array {name} is missing (has {', '.join(sorted(arrays))})")
        got = arrays[name].shape
        want = tuple(sizes.setdefault(s, got[i] if i < len(got) else -1) if isinstance(s, str) else s
                     for i, s in enumerate(shape))
        if got != want:
            raise ArtifactError(f"{path}: array {name} has shape {got}, expected {want}")
        _check_kind(path, name, arrays[name])
    return arrays


TEXT = ("detector", "model")
"""Arrays of text; all others hold numbers."""
WHOLE = ("face", "coarser_face", "levels", "head_faces")
"""Arrays of whole numbers."""
NOWHERE = ("xy", "world", "face_mesh", "landmarks")
"""Arrays of points, which are NaN where a point is nowhere; all others are finite."""


def _check_kind(path: Path, name: str, array: np.ndarray) -> None:
    kinds, words = ("U", "text") if name in TEXT else ("iu", "whole numbers") if name in WHOLE else ("biuf", "numbers")
    if array.dtype.kind not in kinds:
        raise ArtifactError(f"{path}: array {name} is of type {array.dtype}, expected {words}")
    if name not in NOWHERE and not _finite(array):
        raise ArtifactError(f"{path}: array {name} is not finite")


def _finite(array: np.ndarray) -> bool:
    import numpy as np

    return array.dtype.kind != "f" or bool(np.isfinite(array).all())


POINT_SHAPES: Shapes = {"xy": ("T", 133, 2), "score": ("T", 133), "world": ("T", 133, 3), "detector": ()}
KEYPOINT_SHAPES: Shapes = {**POINT_SHAPES, "pose33": ("T", 33, 3), "face_mesh": ("T", 468, 3)}
FILLED_SHAPES: Shapes = {**POINT_SHAPES, "missing": ("T", 2), "filled": ("T", 133), "sigma": ("T", 133)}
FACE_SHAPES: Shapes = {"valid": ("T",), "expression": ("T", "E"), "jaw": ("T", 3), "shape": ("S",), "landmarks": ("T", "L", 3)}
HEAD_SHAPES: Shapes = {"head_template": ("N", 3), "head_vertices": ("N", 3), "head_faces": ("F", 3), "head_eyes": (2, 3)}
"""Of face.npz where a face was seen: the person's resting head."""
FLAME_SHAPES: Shapes = {"flame_expression": ("T", "X"), "flame_jaw": ("T", 3)}
"""Of face.npz where a FLAME file was given: how FLAME's face moves."""
REST_SHAPE: Shapes = {"rest_expression": ("E",)}
"""Of face.npz where a face was seen, and of body.npz where the body acts the facial actions: the person's face at rest."""
OCCLUDER_SHAPE: Shapes = {"occluder": ("Y", "X")}
"""Of body.npz where something stands before the person in all frames: where, in the frame at a smaller size."""
BODY_SHAPES: Shapes = {
    "betas": ("B",), "expression": ("T", "E"), "global_orient": ("T", 3), "body_pose": ("T", 63),
    "left_hand_pose": ("T", 45), "right_hand_pose": ("T", 45), "jaw_pose": ("T", 3), "leye_pose": ("T", 3),
    "reye_pose": ("T", 3), "transl": ("T", 3), "joint_offset": (55, 3), "joints": ("T", 55, 3), "focal": (2,),
    "center": (2,), "sigma_joints": ("T", 55), "model": (),
}
LIGHT_SHAPE: Shapes = {"light": (4, 3)}
LOW_PASS_SHAPE: Shapes = {"low_pass": (2,)}
AVATAR_SHAPES: Shapes = {
    "face": ("N",), "mu": ("N", 3), "quat": ("N", 4), "log_scale": ("N", 3), "rgb": ("N", 3), "opacity": ("N",),
}
LEVEL_SHAPES: Shapes = {"levels": ("L",), **{f"coarser_{name}": ("M", *shape[1:]) for name, shape in AVATAR_SHAPES.items()}}
"""Of avatar.npz where it has coarser levels of detail: the gaussians in each, then their arrays, joined level by level."""
LEVEL_HEIGHT_SHAPE: Shapes = {"level_heights": ("L",)}
MORE_AVATAR_SHAPES = LIGHT_SHAPE, LOW_PASS_SHAPE, LEVEL_SHAPES, LEVEL_HEIGHT_SHAPE
"""Groups of arrays that avatar.npz has or has not."""
PER_FRAME = frozenset(name for shapes in (KEYPOINT_SHAPES, FILLED_SHAPES, FACE_SHAPES, FLAME_SHAPES, BODY_SHAPES)
                      for name, shape in shapes.items() if shape[:1] == ("T",))
"""Arrays with a row for each kept frame."""


def check_keypoints(path: Path) -> dict[str, np.ndarray]:
    """The arrays of `keypoints/keypoints.npz` by name: `KEYPOINT_SHAPES`, as xy (T, 133, 2).

    A point that is nowhere, NaN or infinite, counts as unseen: NaN with score 0.
    """
    import numpy as np

    arrays = check_arrays(path, KEYPOINT_SHAPES)
    score = arrays["score"]
    if not (score.min(initial=0) >= 0 and score.max(initial=0) <= 1):
        raise ArtifactError(f"{path}: score must lie in 0..1")
    placed = np.asarray(np.isfinite(arrays["xy"]).all(-1))
    return arrays if placed.all() else arrays | {"score": np.where(placed, score, 0).astype(score.dtype),
                                                 "xy": np.where(placed[..., None], arrays["xy"], np.float32(np.nan))}


def check_filled_keypoints(path: Path) -> dict[str, np.ndarray]:
    """The arrays of `handgap/keypoints.npz` by name: `FILLED_SHAPES`, as xy (T, 133, 2)."""
    return check_arrays(path, FILLED_SHAPES)


def check_face(path: Path) -> dict[str, np.ndarray]:
    """The arrays of face.npz by name: `FACE_SHAPES`, as valid (T,); all of `HEAD_SHAPES`, of `REST_SHAPE` and of `FLAME_SHAPES`, or
    none.
    """
    return check_arrays(path, FACE_SHAPES, HEAD_SHAPES, REST_SHAPE, FLAME_SHAPES)


def check_body(path: Path) -> dict[str, np.ndarray]:
    """The arrays of body.npz by name: `BODY_SHAPES`, as transl (T, 3); `REST_SHAPE` and `OCCLUDER_SHAPE` or not."""
    arrays = check_arrays(path, BODY_SHAPES, REST_SHAPE, OCCLUDER_SHAPE)
    if "rest_expression" in arrays and not (arrays["rest_expression"].min() >= 0 and arrays["rest_expression"].max() <= 1):
        raise ArtifactError(f"{path}: array rest_expression must lie in 0..1")
    return arrays


def check_avatar(path: Path) -> dict[str, np.ndarray]:
    """The arrays of avatar.npz: `AVATAR_SHAPES`, as mu (N, 3); light (4, 3), low_pass (2,), all of `LEVEL_SHAPES` or none.

    Where there are levels, level_heights (L,) or not.
    """
    arrays = check_arrays(path, AVATAR_SHAPES, *MORE_AVATAR_SHAPES)
    if "level_heights" in arrays and not ("levels" in arrays and (arrays["level_heights"] > 0).all()):
        raise ArtifactError(f"{path}: array level_heights must hold the height of the person for each of `levels`, px, above 0")
    if "levels" in arrays:
        counts = [len(arrays["face"]), *arrays["levels"].tolist()]
        if sum(counts[1:]) != len(arrays["coarser_face"]) or any(b >= a or b < 1 for a, b in zip(counts, counts[1:], strict=False)):
            raise ArtifactError(f"{path}: array levels is {counts[1:]}; each level must have fewer gaussians than the one before "
                                f"({counts[0]} at first), {len(arrays['coarser_face'])} in all")
    return arrays


def check_json(path: Path) -> None:
    _read_json(path)


def _read_json(path: Path) -> object:
    try:
        return json.loads(Path(path).read_text())
    except (OSError, ValueError) as e:
        raise ArtifactError(f"{path}: not readable JSON ({e})") from e


def check_image_folder(path: Path) -> None:
    if not Path(path).is_dir() or not frame_paths(path):
        raise ArtifactError(f"{path}: expected a folder of %06d.png or %06d.exr images")


def check_file(path: Path) -> None:
    if not Path(path).is_file() or Path(path).stat().st_size == 0:
        raise ArtifactError(f"{path}: expected a file with content")


def check_folder(path: Path) -> None:
    if not Path(path).is_dir() or not any(Path(path).iterdir()):
        raise ArtifactError(f"{path}: expected a folder with content")
