"""X-Humans (Shen et al. 2023): `<subject>/train|test/<take>/render/image/color_%06d.png`, `render/depth/depth_%06d.tiff`,
`render/cameras.npz` and `SMPLX/mesh-f%05d_smplx.pkl`.

The mask is where the depth is less than its largest value, as ExAvatar takes it. All takes of `train` are trained on and those of
`test` judged, but for the four subjects of which HAHA names a take each. A take's frames follow those of the take before after
GAP frames, so that nothing is filled or smoothed across.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gsac.avatar import rotation
from gsac.avatar.npz import NpzError, read_npz
from gsac.pipeline.data_sets.given import (
    GivenClip,
    Lens,
    list_pictures,
    need_file,
    need_folder,
    need_lens,
    read_grey,
    read_rgb,
    same_size,
)
from gsac.pipeline.data_sets.plain_pickle import read_pickle
from gsac.stages.contract import BadInput

TAKES = {"00016": ("Take4", "Take6"), "00018": ("Take6", "Take9"), "00019": ("Take5", "Take7"), "00027": ("Take7", "Take6")}
"""Subject -> the takes that HAHA trains on and tests."""
GAP = 1000
FPS = 30.0
PARTS = ("global_orient", "body_pose", "left_hand_pose", "right_hand_pose", "jaw_pose", "leye_pose", "reye_pose")
NOTICE = ("X-Humans: K. Shen, C. Guo, M. Kaufmann, J. J. Zarate, J. Valentin, J. Song, O. Hilliges: X-Avatar: Expressive Human "
          "Avatars, CVPR 2023.\nhttps://skype-line.github.io/projects/X-Avatar/\nUnder the licence that you agreed to when you "
          "downloaded it; frames, masks and poses here are that data set's and must not be passed on.\n")


def read(path: Path) -> Iterator[GivenClip]:
    """The clip of a subject's folder, or of each subject in a folder of them."""
    inside = [folder for folder in sorted(path.iterdir()) if (folder / "train").is_dir()]
    for folder in [path] if (path / "train").is_dir() else inside or [path]:
        yield read_subject(folder)


def read_subject(folder: Path) -> GivenClip:
    """The clip of one subject: the frames of its takes to train on, then those to test."""
    images: list[Path] = []
    numbers: list[int] = []
    parts: dict[str, list[int]] = {"train": [], "test": []}
    extrinsics, lens, poses = [], None, []
    for part, take in find_takes(folder):
        found = list_pictures(take / "render" / "image")
        start = numbers[-1] + GAP if numbers else 0
        own = [start + number_of(path) for path in found]
        matrix, turns = read_cameras(need_file(take / "render" / "cameras.npz", "the cameras"), len(found))
        lens = lens or matrix
        if lens != matrix:
            raise BadInput(f"{take / 'render' / 'cameras.npz'}: has another intrinsic than the take before; import "
                           "takes of one camera")
        images, numbers, parts[part] = images + found, numbers + own, parts[part] + own
        extrinsics.append(turns)
        poses += [read_pose(take, number_of(path), turn) for path, turn in zip(found, turns, strict=True)]
    known = [pose for pose in poses if pose is not None]
    stacked = {name: np.stack([pose[name] for pose in known]) for name in known[0]} if len(known) == len(images) else {}
    return GivenClip(folder.name, numbers, lambda: map(read_frame, images), NOTICE, FPS, lens=lens,
                     extrinsics=np.concatenate(extrinsics), poses=stacked, train=parts["train"], test=parts["test"],
                     split_source="HAHA" if folder.name in TAKES else "X-Humans",
                     sources=[str(path.relative_to(folder)) for path in images])


def find_takes(folder: Path) -> list[tuple[str, Path]]:
    """Which part, train or test, each take's folder is for."""
    if folder.name in TAKES:
        there = {take.name: take for part in ("train", "test") if (folder / part).is_dir() for take in (folder / part).iterdir()}
        pair = list(zip(("train", "test"), TAKES[folder.name], strict=True))
        if all(name in there for _, name in pair):
            return [(part, there[name]) for part, name in pair]
        missing = next(name for _, name in pair if name not in there)
        raise BadInput(f"{folder}: has no {missing} in train or test, which HAHA's split of this subject names; it has "
                       f"{', '.join(sorted(there)) or 'no take'}. Unpack the subject whole")
    found = [(part, take) for part in ("train", "test") for take in sorted(need_folder(folder / part, "the takes").iterdir())
             if take.is_dir()]
    if not found:
        raise BadInput(f"{folder}: has no takes in train and test; unpack the subject whole")
    return found


def number_of(path: Path) -> int:
    """A frame's number by its name."""
    found = re.fullmatch(r"color_(\d+)", path.stem)
    if found is None:
        raise BadInput(f"{path}: is misnamed; expected color_000001.png")
    return int(found[1])


def read_cameras(path: Path, count: int) -> tuple[Lens, np.ndarray]:
    """The lens, and world -> camera (count, 3, 4)."""
    try:
        arrays = read_npz(path, ("intrinsic", "extrinsic"), objects=False)
        k, turns = arrays["intrinsic"], arrays["extrinsic"]
    except (NpzError, KeyError) as e:
        raise BadInput(f"{path}: expected arrays intrinsic and extrinsic ({e})") from e
    if k.shape != (3, 3) or turns.ndim != 3 or turns.shape[0] != count or turns.shape[1] < 3 or turns.shape[2] != 4:
        raise BadInput(f"{path}: intrinsic has shape {k.shape}, extrinsic {turns.shape}; expected (3, 3) and ({count}, 3, 4), "
                       "one of each picture in image")
    if not np.isfinite(turns).all():
        raise BadInput(f"{path}: extrinsic has a number that is not finite; download it again")
    lens = Lens((float(k[0, 0]), float(k[1, 1])), (float(k[0, 2]), float(k[1, 2])))
    return need_lens(lens, path), turns[:, :3].astype(float)


def read_frame(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """rgb (H, W, 3) and mask (H, W) of a picture."""
    depth_path = path.parent.parent / "depth" / f"depth_{number_of(path):06d}.tiff"
    rgb, depth = read_rgb(path), read_grey(need_file(depth_path, "the depth"))
    mask = np.where(depth < depth.max(), np.uint8(255), np.uint8(0))
    same_size(rgb, mask, depth_path)
    return rgb, mask


def read_pose(take: Path, number: int, turn: np.ndarray) -> dict[str, np.ndarray] | None:
    """SMPL-X's parameters of a frame in the camera's axes, betas among them; None where the take has none. turn: (3, 4).

    transl is left out where the camera is turned: it would need the pelvis at rest of the body that the data were made with.
    """
    if not (take / "SMPLX").is_dir():
        return None
    path = need_file(take / "SMPLX" / f"mesh-f{number:05d}_smplx.pkl", "the pose")
    values = read_pickle(path)
    try:
        pose = {name: np.asarray(values[name], float).reshape(-1) for name in (*PARTS, "transl", "betas")}
        pose["global_orient"] = rotation.log(turn[:, :3] @ rotation.exp(pose["global_orient"].reshape(3)))
    except (KeyError, TypeError, ValueError) as e:
        raise BadInput(f"{path}: expected SMPL-X's {', '.join(PARTS)}, transl and betas ({e})") from e
    transl = pose.pop("transl")
    return pose | ({"transl": transl + turn[:, 3]} if np.allclose(turn[:, :3], np.eye(3)) else {})
