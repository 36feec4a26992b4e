"""The light of the clip in viewer.html: what it shows is what the trainer's renderer gives, and it can be switched off."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gsac.avatar.binding import face_frames
from gsac.avatar.camera import Camera
from gsac.avatar.draw_rule import DARKEST
from gsac.avatar.film import FOV, PITCH, look_at
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.avatar.light import shade
from gsac.avatar.raster import render_bound
from gsac.benchmarks.viewer import browser as chromium
from gsac.viewer.page import page_bytes

pytestmark = [pytest.mark.slow,
              pytest.mark.skipif(chromium.find_chromium() is None, reason="needs the Debian package chromium")]
SIZE, DISTANCE, BACKGROUND = 512, 3.4, (0x3A, 0x60, 0x80)
LIGHT = np.float32([[.8, .75, .7], [.3, .2, -.1], [.2, .1, .3], [.25, -.6, .2]])
"""Strong and coloured, in one colour darker than a factor may become."""


@pytest.fixture(scope="module")
def lit(exported):
    avatar = RiggedAvatar.read(exported / "avatar.gsac")
    return replace(avatar, gaussians=replace(avatar.gaussians, light=LIGHT))


@pytest.fixture(scope="module")
def address(lit, tmp_path_factory):
    path = tmp_path_factory.mktemp("lit") / "viewer.html"
    path.write_bytes(page_bytes(avatar_bytes(lit)))
    return path.as_uri()


def expected(avatar, pose, yaw):
    R, eye = look_at(yaw, np.zeros(3), DISTANCE)
    f = SIZE / 2 / math.tan(math.radians(FOV / 2))
    vertices, gaussians, light = avatar.posed(avatar.pose(pose)), replace(avatar.gaussians, light=None), avatar.gaussians.light
    if light is not None:
        gaussians.rgb = gaussians.rgb * shade(light, face_frames(vertices, avatar.faces).R[gaussians.face, :, 1])
    out = render_bound(((vertices - eye) @ R.T).astype(np.float32), avatar.faces, gaussians,
                       Camera((f, f), (SIZE / 2, SIZE / 2), SIZE, SIZE))
    image = out.rgb + (1 - out.alpha[..., None]) * np.array(BACKGROUND) / 255
    return np.clip(image, 0, 1), out.alpha > 0.02


def psnr(a, b):
    return -10 * math.log10(max(((a - b) ** 2).mean(), 1e-12))


@pytest.mark.parametrize("draw", ["webgpu", "webgl", "software"])
def test_in_its_light_the_person_looks_as_the_trainers_renderer_shows_from_every_side(browser, lit, address, draw):
    assert shade(LIGHT, np.float32([[0, 0, 1]])).min() == np.float32(DARKEST), "the front reaches the darkest that is drawn"
    browser.open(f"{address}?{draw}#draw={draw}")
    if draw == "webgpu" and not browser.has_webgpu():
        pytest.skip("this chromium has no WebGPU")
    for pose, yaw in (("A", 20), ("T", 160), ("A", -80)):
        pictures = []
        for words, avatar in (("", lit), ("&light=off", replace(lit, gaussians=replace(lit.gaussians, light=None)))):
            view = f"pose={pose}&yaw={yaw}&pitch={PITCH}&dist={DISTANCE}&fov={FOV}&target=0,0,0&bg=3a6080&still{words}"
            browser.run(f"location.hash = '{view}'")
            browser.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
            got = browser.picture() / 255
            want, person = expected(avatar, pose, yaw)
            print(f"{draw} {pose} {yaw} {words or 'lit'}: {psnr(got[person], want[person]):.1f} dB")
            assert psnr(got[person], want[person]) >= 45
            pictures.append(got[person])
        assert psnr(*pictures) < 22, "it is seen"
    assert browser.errors == []


def test_its_button_switches_it_and_is_there_only_where_a_light_is(browser, address, exported):
    browser.open(f"{address}?button#pose=A")
    factors, button = [], "document.getElementById('light')"
    for pressed in ("true", "false", "true"):
        assert browser.run(f"{button}.getAttribute('aria-pressed')") == pressed and browser.run(f"{button}.offsetParent !== null")
        browser.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        factors.append(np.array(browser.run("Array.from(gsac.levels.binding.data)")).reshape(-1, 12)[:100, 9:])
        browser.run(f"{button}.click()")
    assert np.ptp(factors[0]) > 0.5 and (factors[1] == 1).all()
    np.testing.assert_array_equal(factors[0], factors[2])
    browser.open((exported / "viewer.html").as_uri())
    assert browser.run(f"{button}.offsetParent === null && gsac.levels.binding.data[9] === 1")
    assert browser.errors == []
