"""A brought mask: read the same in each of its forms, refused with its name where it is none."""

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from gsac.avatar.mask_file import MaskError, read_mask, scale_mask


def soft_disc():
    """(160, 96) uint8: a disc with a soft edge."""
    rows, columns = np.mgrid[:160, :96] + 0.5
    return np.clip(255 * (24 - np.hypot(columns - 48, rows - 80)) / 6 + 128, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("values", ["255", "1", "65535", "bool", "colours", "transparency", "exr"])
def test_a_mask_reads_the_same_in_each_of_its_forms(tmp_path, values):
    alpha = soft_disc() / np.float32(255)
    hard = (alpha > 0.5).astype(np.uint8)
    grey = soft_disc()
    file, wanted = tmp_path / "0.png", hard if values in ("1", "bool") else alpha
    if values == "exr":
        file = tmp_path / "0.exr"
        with OpenEXR.File({"type": OpenEXR.scanlineimage}, {"Y": alpha}) as exr:
            exr.write(str(file))
    else:
        pictures = {"255": grey, "1": hard, "65535": grey.astype(np.uint16) * 257, "bool": hard.astype(bool),
                    "colours": np.dstack([grey] * 3), "transparency": np.dstack([np.full_like(grey, 90)] * 3 + [grey])}
        Image.fromarray(pictures[values]).save(file)
    assert np.abs(read_mask(file) - wanted).max() < 1e-4


def test_values_beyond_white_are_refused(tmp_path):
    with OpenEXR.File({"type": OpenEXR.scanlineimage}, {"Y": np.full((4, 4), 255, np.float32)}) as exr:
        exr.write(str(tmp_path / "0.exr"))
    with pytest.raises(MaskError, match=r".*/0.exr: has values from 255 to 255; expected 0 to 1"):
        read_mask(tmp_path / "0.exr")


def test_a_smaller_mask_grows_about_its_pixels_middles_and_a_larger_one_is_averaged(tmp_path):
    mask = soft_disc() / np.float32(255)
    small = scale_mask(mask, 48, 80, tmp_path / "0.png")
    assert np.abs(small - mask.reshape(80, 2, 48, 2).mean((1, 3))).max() < 1e-6
    columns = np.arange(96) + 0.5
    grown = scale_mask(small, 96, 160, tmp_path / "0.png")
    assert abs((grown * columns).sum() / grown.sum() - 48) < 0.01
    with pytest.raises(MaskError, match="is 96x160 px, of another aspect than its frame, which is 96x96"):
        scale_mask(mask, 96, 96, tmp_path / "0.png")


@pytest.mark.parametrize(("value", "words"), [(0, "masks/0.png: is empty"), (255, "masks/0.png: is white all over")])
def test_a_mask_of_nobody_and_one_of_nothing_else_are_refused_by_name(tmp_path, value, words):
    (tmp_path / "masks").mkdir()
    Image.fromarray(np.full((8, 6), value, np.uint8)).save(tmp_path / "masks/0.png")
    with pytest.raises(MaskError, match=words):
        read_mask(tmp_path / "masks/0.png")
