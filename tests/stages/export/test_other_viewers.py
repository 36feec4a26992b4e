"""Splat viewers that are not ours show avatar.ply and avatar.glb as viewer.html shows the avatar."""

import math
import shutil

import numpy as np
import pytest
from gsac.benchmarks.viewer import browser as chromium
from gsac.benchmarks.viewer.bench import PACKAGE, PAGE, pages
from gsac.benchmarks.viewer.race import served
from gsac.stages.export.rigged import RiggedAvatar

pytestmark = [pytest.mark.slow,
              pytest.mark.skipif(chromium.find_chromium() is None, reason="needs the Debian package chromium")]
SIZE, BACKGROUND = 400, (0x3A, 0x60, 0x80)


def shown(address):
    page = chromium.Browser(SIZE, SIZE)
    try:
        page.open(address)
        page.run("new Promise((done) => setTimeout(done, 1000))")
        assert page.errors == []
        return page.picture().astype(float)
    finally:
        page.close()


def person(picture):
    return np.abs(picture - BACKGROUND).max(-1) > 12


@pytest.mark.parametrize("name", ["avatar.ply", "avatar.glb"])
def test_playcanvas_shows_what_our_page_shows(exported, node_package, name):
    folder = node_package(PACKAGE)
    for file in (exported / name, exported / "viewer.html", PAGE):
        shutil.copy(file, folder / file.name)
    ours, theirs = pages(RiggedAvatar.read(exported / "avatar.gsac")).values()
    pose = {"avatar.ply": "A", "avatar.glb": "T"}[name]
    with served(folder) as address:
        got = shown(f"{address}/{theirs.replace('avatar.ply', name)}")
        want = shown(f"{address}/{ours.replace('clip=walk', f'pose={pose}')}&still")
    a, b = person(got), person(want)
    assert b.mean() > 0.03 and (a & b).sum() / (a | b).sum() > 0.95
    both = a & b
    assert -10 * math.log10((((got - want) / 255)[both] ** 2).mean()) > 26
    red = (got[..., 0] > 150) & (got[..., 1:].max(-1) < 100)
    assert np.nonzero(red)[1].min() > SIZE / 2
