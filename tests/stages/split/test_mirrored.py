"""Mirrored stretches are found by the room, and turned back."""

import imageio_ffmpeg
import numpy as np
import pytest

from gsac.avatar.artifacts import Clip, frame_paths
from gsac.avatar.frame_files import read_frame
from gsac.stages.contract import Job
from gsac.stages.findings import Code
from gsac.stages.split.config import SplitConfig
from gsac.stages.split.mirrored import find_mirrored
from gsac.stages.split.stage import run

FRAMES, SIZE = 20, (96, 160)


def film(mirrored=(), room=True):
    """(T, H, W, 3) uint8: a bar that moves before a room whose left is not its right; those frames mirrored."""
    w, h = SIZE
    out = np.zeros((FRAMES, h, w, 3), np.uint8)
    boxes = np.random.default_rng(1).integers(40, 220, (h // 8, w // 8, 3), np.uint8)
    out[:] = boxes.repeat(8, 0).repeat(8, 1) if room else 120
    for t in range(FRAMES):
        out[t, 30:140, 30 + t: 44 + t] = (20, 60, 200)
    for t in mirrored:
        out[t] = out[t, :, ::-1]
    return out


def split(pictures, folder):
    folder.mkdir()
    writer = imageio_ffmpeg.write_frames(folder / "clip.mp4", SIZE, fps=10, quality=9, macro_block_size=1)
    writer.send(None)
    for picture in pictures:
        writer.send(np.ascontiguousarray(picture))
    writer.close()
    found, out = [], folder / "out"
    out.mkdir()
    run(Job({"clip": folder / "clip.mp4"}, out, SplitConfig(), warn=found.append))
    return np.stack([read_frame(path) for path in frame_paths(out / "frames")]).astype(int), found, Clip.read(out / "clip.json")


@pytest.mark.parametrize("places", [range(6, 12), range(10, 20), range(3, 20)])
def test_a_mirrored_stretch_is_turned_back_and_named(tmp_path, places):
    right, nothing, _ = split(film(), tmp_path / "right")
    mended, found, clip = split(film(places), tmp_path / "mirrored")
    assert not nothing and [finding.code for finding in found] == [Code.MIRRORED] and not clip.repeated
    wrong = list(places) if len(places) <= FRAMES / 2 else [t for t in range(FRAMES) if t not in places]
    assert found[0].frames == [[wrong[0], wrong[-1]]]
    expected = right if len(places) <= FRAMES / 2 else right[:, :, ::-1]
    assert np.abs(mended - expected).mean() < 3


def test_a_room_without_a_side_tells_nothing():
    blocks = film(range(6, 12), room=False).astype(np.float32)
    assert not find_mirrored(blocks).any()
