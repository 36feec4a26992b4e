"""PeopleSnapshot (Alldieck et al. 2018): a folder a subject, with `<subject>.mp4`, `masks.hdf5` and `camera.pkl`.

`reconstructed_poses.hdf5`, SMPL's poses of each frame, is taken where it is there; `consensus.pkl` and `keypoints.hdf5` are not.
The split is that of InstantAvatar and HAHA, frames counted from 0, both ends among them; a subject without one gives every
fourth frame. Lens distortion is taken out of frames and masks.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from gsac.pipeline.data_sets.given import GivenClip, Lens, need_file, need_lens, same_size
from gsac.pipeline.data_sets.hdf5 import read_hdf5
from gsac.pipeline.data_sets.plain_pickle import read_pickle
from gsac.stages.contract import BadInput
from gsac.stages.split.probe import open_video, probe

SPLITS = {"male-3-casual": ((0, 455, 4), (456, 675, 4)), "male-4-casual": ((0, 659, 6), (660, 872, 6)),
          "female-3-casual": ((0, 445, 4), (446, 647, 4)), "female-4-casual": ((0, 335, 4), (335, 523, 4))}
"""Subject -> first and last frame and step, to train on and to test."""
STEP = 4
FPS = 30.0
"""Frames a second where the video has no rate."""
NOTICE = ("PeopleSnapshot: T. Alldieck, M. Magnor, W. Xu, C. Theobalt, G. Pons-Moll: Video Based Reconstruction of 3D People "
          "Models, CVPR 2018.\nhttps://graphics.tu-bs.de/people-snapshot\nFor research that is not commercial, under the licence "
          "that you agreed to when you downloaded it; frames, masks and poses here are that data set's and must not be passed "
          "on.\n")


def read(path: Path) -> Iterator[GivenClip]:
    """The clip of a subject's folder, or of each subject in a folder of them."""
    inside = [folder for folder in sorted(path.iterdir()) if folder.is_dir() and (folder / f"{folder.name}.mp4").is_file()]
    for folder in inside or [path]:
        yield read_subject(folder)


def read_subject(folder: Path) -> GivenClip:
    """The clip of one subject."""
    video = need_file(folder / f"{folder.name}.mp4", "the subject's video")
    camera = read_camera(need_file(folder / "camera.pkl", "the camera"))
    masks = read_hdf5(folder / "masks.hdf5", "masks")["masks"]
    if masks.ndim != 3:
        raise BadInput(f"{folder / 'masks.hdf5'}: masks has shape {masks.shape}; expected frames, rows and columns")
    count = len(masks)
    train, test = ([t for t in range(first, last + 1, step) if t < count]
                   for first, last, step in SPLITS.get(folder.name, ((0, count - 1, STEP), (0, -1, STEP))))
    numbers = sorted({*train, *test})
    (fx, fy), (cx, cy) = camera["camera_f"].tolist(), camera["camera_c"].tolist()
    lens = need_lens(Lens((fx, fy), (cx, cy)), folder / "camera.pkl")
    return GivenClip(folder.name, numbers, lambda: read_frames(video, masks, numbers, lens, camera["camera_k"]), NOTICE,
                     fps=probe(video).rate or FPS, lens=lens, poses=read_poses(folder, numbers, count), train=train, test=test,
                     split_source="InstantAvatar and HAHA" if test else "")


def read_camera(path: Path) -> dict[str, np.ndarray]:
    """camera_f (2,), camera_c (2,) px and camera_k (5,) distortion, of OpenCV's model."""
    values = read_pickle(path)
    shapes = {"camera_f": 2, "camera_c": 2, "camera_k": 5}
    try:
        found = {name: np.asarray(values[name], float).reshape(size) for name, size in shapes.items()}
    except (KeyError, TypeError, ValueError) as e:
        raise BadInput(f"{path}: expected {', '.join(f'{name} of {size} numbers' for name, size in shapes.items())} ({e})") from e
    if not np.isfinite(found["camera_k"]).all():
        raise BadInput(f"{path}: camera_k has a number that is not finite; download it again")
    return found


def read_frames(video: Path, masks: np.ndarray, numbers: list[int], lens: Lens,
                distortion: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """rgb (H, W, 3) and mask (H, W) of these frames, undistorted. masks: (N, H, W), not 0 where the person is; distortion: (5,)."""
    wanted, seen = set(numbers), 0
    matrix = np.array([[lens.focal[0], 0, lens.center[0]], [0, lens.focal[1], lens.center[1]], [0, 0, 1]])
    with open_video(video) as container:
        for t, frame in enumerate(container.decode(video=0)):
            seen += 1
            if t not in wanted:
                continue
            rgb, mask = frame.to_ndarray(format="rgb24"), np.where(masks[t] > 0, np.uint8(255), np.uint8(0))
            same_size(rgb, mask, video.with_name("masks.hdf5"))
            if distortion.any():
                rgb, mask = (cv2.undistort(image, matrix, distortion) for image in (rgb, mask))
            yield rgb, mask
    if seen != len(masks):
        raise BadInput(f"{video}: has {seen} frames, masks.hdf5 {len(masks)}; both must be of the same subject, and whole")


def read_poses(folder: Path, numbers: list[int], count: int) -> dict[str, np.ndarray]:
    """SMPL's pose (n, 72) rad and trans (n, 3) m of these frames, and betas (10,); nothing where the data set has none. count: of
    the video's frames."""
    path = folder / "reconstructed_poses.hdf5"
    if not path.is_file():
        return {}
    found = read_hdf5(path, "pose", "trans", "betas")
    if found["pose"].shape != (count, 72) or found["trans"].shape != (count, 3):
        raise BadInput(f"{path}: pose and trans have shapes {found['pose'].shape} and {found['trans'].shape}; expected "
                       f"{(count, 72)} and {(count, 3)}, as many as masks.hdf5 has frames")
    return {"pose": found["pose"][numbers], "trans": found["trans"][numbers], "betas": found["betas"].reshape(-1)}
