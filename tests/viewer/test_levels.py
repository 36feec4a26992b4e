"""Levels of detail in viewer.html: the person's height in the picture decides which is drawn, whatever draws it."""

from dataclasses import replace

import numpy as np
import pytest

from gsac.avatar.film import PITCH, look_at
from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.avatar.skinning import joint_transforms
from gsac.benchmarks.viewer import browser as chromium
from gsac.stages.train.fast.drawn_height import person_height
from gsac.viewer.page import page_bytes

pytestmark = [pytest.mark.slow,
              pytest.mark.skipif(chromium.find_chromium() is None, reason="needs the Debian package chromium")]
SIZE, FOV = 300, 30
HEIGHTS = (120, 60)
FAR = {6.5: 0, 10.0: 1, 40.0: 2}
"""m: level that is drawn from there."""


@pytest.fixture(scope="module")
def levelled(figure):
    levels = zip(figure.coarser, HEIGHTS, strict=True)
    return replace(figure, coarser=[replace(level, max_height_px=height) for level, height in levels])


@pytest.fixture(scope="module")
def addresses(levelled, tmp_path_factory):
    """The page of the figure; of its middle level alone; of the figure whose levels say no height."""
    folder = tmp_path_factory.mktemp("levels")
    alone = replace(levelled, gaussians=replace(levelled.coarser[0], max_height_px=None), coarser=[])
    plain = replace(levelled, coarser=[replace(level, max_height_px=None) for level in levelled.coarser])
    for name, avatar in (("whole", levelled), ("alone", alone), ("plain", plain)):
        (folder / f"{name}.html").write_bytes(page_bytes(avatar_bytes(avatar)))
    return [(folder / f"{name}.html").as_uri() for name in ("whole", "alone", "plain")]


def view(distance, more=""):
    return f"pose=A&yaw=20&pitch={PITCH}&fov={FOV}&dist={distance}&target=0,0,0&bg=a0b0c0{more}"


def picture(page, words):
    page.run(f"location.hash = '{words}&still'")
    page.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert page.errors == []
    return page.picture()


def test_from_afar_the_picture_is_that_of_the_coarser_level_whatever_draws_it(browser, addresses):
    whole, alone, _ = addresses
    for draw in ("webgpu", "webgl", "software"):
        browser.open(f"{whole}?{draw}#draw={draw}")
        if draw == "webgpu" and not browser.has_webgpu():
            continue
        got = []
        for distance, level in [*FAR.items(), (6.5, 0)]:
            got.append(picture(browser, view(distance)))
            assert browser.run("gsac.levels.drawn") == level
        near, middle, _, again = got
        np.testing.assert_array_equal(near, again)
        browser.open(f"{alone}?{draw}#draw={draw}")
        np.testing.assert_array_equal(picture(browser, view(10.0)), middle, draw)


def test_the_height_is_measured_as_training_does_and_on_a_dense_screen_in_its_own_pixels(browser, addresses, levelled):
    browser.open(f"{addresses[0]}?height#draw=webgl")
    picture(browser, view(10))
    R, eye = look_at(20, np.zeros(3), 10.0)
    bones = joint_transforms(levelled.pose("A")[None], levelled.joints, levelled.parents)[0]
    joints = np.einsum("jab,jb->ja", bones[:, :, :3], levelled.joints) + bones[:, :, 3]
    focal = SIZE / 2 / np.tan(np.radians(FOV / 2))
    wanted = person_height(np.ptp(levelled.vertices[:, 1]), (joints - eye) @ R.T, focal)
    measured = "gsac.levels.height(gsac.camera.eye(gsac.canvas.width, gsac.canvas.height), gsac.skin)"
    assert HEIGHTS[1] < wanted < HEIGHTS[0] and browser.run(measured) == pytest.approx(wanted, rel=1e-4)
    try:
        browser.resize(SIZE, SIZE, 2)
        picture(browser, view(10.001))
        assert browser.run(measured) == pytest.approx(2 * wanted, rel=1e-3) and browser.run("gsac.levels.drawn") == 0
    finally:
        browser.resize(SIZE, SIZE)


def test_at_a_border_the_level_of_before_stays_and_a_finer_one_comes_at_once(browser, addresses):
    browser.open(f"{addresses[0]}?border#draw=software&{view(6)}")
    heights = [300, 119, 109, 107, 119, 121, 107, 53, 61, 50, 400]
    assert browser.run(f"{heights}.map((height) => {{ gsac.levels.choose(height); return gsac.levels.drawn; }})") == [
        0, 0, 0, 1, 1, 0, 1, 2, 1, 2, 0]


def test_the_eye_that_sees_the_person_largest_decides_for_both(browser, addresses):
    browser.open(f"{addresses[0]}?eyes#draw=webgl&{view(40)}")
    near, far = (f"{{ ...gsac.camera.eye({SIZE}, {SIZE}), focal: [{focal}, {focal}] }}" for focal in (3000, 600))
    for eyes, level in (([far, far], 2), ([far, near], 0), ([near, far], 0), ([far], 2)):
        assert browser.run(f"gsac.chooseLevel([{', '.join(eyes)}]), gsac.levels.drawn") == level
        assert browser.run("gsac.levels.binding.data[0]") != 0, "its gaussians are where the pose has them"


def test_the_page_says_which_level_it_draws_and_without_heights_always_draws_the_finest(browser, addresses):
    shown = "document.getElementById('fps').textContent"
    browser.open(f"{addresses[0]}?words#draw=software&{view(10)}")
    browser.until(f"{shown}.includes('gaussians, level 2 of 3')")
    browser.open(f"{addresses[2]}?words#draw=software&{view(90)}")
    browser.until(f"{shown}.includes('gaussians')")
    assert browser.run("gsac.levels.drawn") == 0 and "level" not in browser.run(shown) and browser.errors == []
