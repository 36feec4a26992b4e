"""What paints a truth clip's skin is what its bake gives."""

import hashlib

import numpy as np
import pytest

from gsac.avatar import body
from gsac.turntable.person import REGIONS
from support.scripts import script


@pytest.fixture(scope="module")
def bake():
    """The script is no module of the product."""
    return script("open_body/bake_regions")


def test_the_shipped_file_is_what_the_bake_gave(bake):
    assert hashlib.sha256(REGIONS.read_bytes()).hexdigest() == bake.GIVES
    assert [str(n) for n in np.load(REGIONS)["names"]] == list(bake.MASKS)


def test_every_region_lies_where_it_is_named():
    share, template = np.load(REGIONS)["share"] > 127, body.Body.load().v_template
    lips, ears, eyelids, nails, mouth, face = (template[s] for s in share)
    assert np.abs(lips[:, 0]).max() < 0.04 and lips[:, 1].min() > 0.79 and lips[:, 1].max() < 0.84
    assert np.abs(ears[:, 0]).min() > 0.05 and eyelids[:, 1].min() > lips[:, 1].max()
    assert np.abs(nails[:, 0]).min() > 0.6  # fingers of the T-pose
    assert mouth[:, 2].mean() < lips[:, 2].mean() and np.ptp(face[:, 1]) > 0.12


def test_a_vertex_takes_the_masks_value_at_its_place_and_the_mean_on_a_seam(bake):
    mask = np.tile(np.linspace(0, 1, 100, dtype=np.float32), (100, 1))
    mask[:50] = 0  # the upper half of the picture, where v is large
    vt = np.array([[0.25, 0.2], [0.75, 0.2], [0.5, 0.9], [0.5, 0.2]])
    faces = np.array([[0, 1, 2], [0, 1, 2]])
    ft = np.array([[0, 1, 2], [0, 1, 3]])
    got = bake.sample_mask(mask, vt, ft, faces)
    np.testing.assert_allclose(got, [0.25, 0.75, 0.25], atol=0.01)
