"""Poses never seen are judged as large as their frames, unless a height is asked for."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from gsac.avatar.camera import Camera
from gsac.avatar.frame_files import write_frame
from gsac.benchmarks.speed_accuracy.novel_poses import read_views


@pytest.mark.parametrize("height, size", [(None, (50, 80)), (40, (25, 40)), (540, (50, 80))])
def test_frames_of_poses_never_seen_keep_their_size(tmp_path, height, size):
    for name in ("frames", "mask"):
        (tmp_path / name).mkdir()
    write_frame(tmp_path / "frames/000000.png", np.full((80, 50, 3), 120, np.uint8))
    cv2.imwrite(str(tmp_path / "mask/000000.png"), np.full((80, 50), 128, np.uint8))
    truth = SimpleNamespace(camera=lambda width, height: Camera((90.0, 90.0), (width / 2, height / 2), width, height))
    view, = read_views(tmp_path, truth, height)
    assert (view.camera.width, view.camera.height) == size and view.pixels.shape == (size[1], size[0], 4)
    assert (view.pixels == (60, 60, 60, 128)).all()
