"""Cuts patches with their true alpha out of a truth clip, for `train.py`.

    python -m gsac.turntable CLIP $(python tools/edge_network/clip_options.py SEED)
    gsac run CLIP/clip.mp4 --out RUN --until keypoints --set split.crop=false
    python tools/edge_network/patches.py RUN CLIP PATCHES/SEED.npy --pose-network FILE

The kept network saw 63 clips, seeds 3000 to 3079 as far as they were ready. FILE is `pose_landmark_full` of the model store.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from gsac.avatar.artifacts import Clip, frame_paths
from gsac.avatar.frame_files import read_frame
from gsac.stages.missing_frames import read_keypoints
from gsac.stages.segment.edge_network import CloseUp
from gsac.stages.segment.network import PoseMask, person_region
from gsac.stages.segment.plate_from_video import learn_plate, relearn_plate
from gsac.stages.segment.stage import LEAST, close_up, cut_frame

SIDE = 192
"""px of a patch."""
EACH = 12
"""Patches of a frame."""
AWAY = 60
"""px, the most by which a patch's middle is moved from the pixel that it was drawn by."""
EDGE, ANYWHERE = 0.1, 1e-4
"""Weights by which pixels at the true outline and any pixels are drawn, beside the squared error of the outline."""
LOST = 0.02
"""Share of the person beyond the part that is looked at from which on a frame is left out."""


def look(run: Path, pose_network: Path) -> Iterator[tuple[int, tuple[int, int, int, int], CloseUp]]:
    """Each frame's number, the part that is looked at (x0, y0, x1, y1 px), and what the network is shown."""
    paths = frame_paths(run / "split" / "frames")
    keypoints, _ = read_keypoints(run / "keypoints" / "keypoints.npz", len(paths))
    xy, score = np.nan_to_num(keypoints["xy"]), keypoints["score"]
    network, images = PoseMask({"pose_landmark_full": pose_network}), [read_frame(path) for path in paths]
    regions = [person_region(*points) for points in zip(xy, score, strict=True)]
    seen = [t for t, region in enumerate(regions) if region is not None]
    probability = {t: network(images[t], regions[t]) for t in seen}
    there = np.isin(np.arange(len(paths)), seen)
    plate = learn_plate(paths, there, lambda t, _: probability[t] > LEAST)
    cutouts = {t: cut_frame(images[t], probability[t], xy[t], score[t], plate, 1)[0] for t in seen}
    plate = relearn_plate(paths, there, lambda t, image: cutouts[t].on_frame(image.shape))
    for t, cutout in cutouts.items():
        if cutout.outline.any():
            yield t, cutout.box, close_up(images[t], cutout, plate)


def draw(planes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Patches (EACH, SIDE, SIDE, 10) uint8 of a frame's planes (H, W, 10), the last of which is the true alpha."""
    short = [max(0, SIDE - length) for length in planes.shape[:2]]
    planes = np.pad(planes, (*((n // 2, n - n // 2) for n in short), (0, 0)), mode="edge")
    height, width = planes.shape[:2]
    truth, outline = planes[..., 9], planes[..., 7]
    edge = cv2.morphologyEx((truth > 127).astype(np.uint8), cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8))
    weight = ((truth.astype(np.float64) - outline) / 255) ** 2 + EDGE * edge + ANYWHERE
    at = np.unravel_index(rng.choice(weight.size, EACH, p=(weight / weight.sum()).ravel()), weight.shape)
    corners = [np.clip(place - SIDE // 2 + rng.integers(-AWAY, AWAY + 1, EACH), 0, length - SIDE)
               for place, length in zip(at, (height, width), strict=True)]
    return np.stack([planes[y: y + SIDE, x: x + SIDE] for y, x in zip(*corners, strict=True)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("run", "clip", "out"):
        parser.add_argument(name, type=Path)
    parser.add_argument("--pose-network", type=Path, required=True)
    arguments = parser.parse_args()
    shape = Clip.read(arguments.run / "split" / "clip.json")
    masks, rng, patches = sorted((arguments.clip / "mask").iterdir()), np.random.default_rng(0), []
    for t, (x0, y0, x1, y1), seen in look(arguments.run, arguments.pose_network):
        truth = cv2.imread(str(masks[t]), cv2.IMREAD_GRAYSCALE)
        truth = cv2.resize(truth, (shape.width, shape.height), interpolation=cv2.INTER_AREA)
        part = truth[y0:y1, x0:x1]
        if part.sum(dtype=float) >= (1 - LOST) * truth.sum(dtype=float):
            patches.append(draw(np.dstack([seen.stacked(), part]), rng))
    np.save(arguments.out, np.concatenate(patches))


if __name__ == "__main__":
    main()
