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


def expected(avatar, pose, yaw, lamp=None):
    """lamp: around, above, share."""
    R, eye = look_at(yaw, np.zeros(3), DISTANCE)
    f = SIZE / 2 / math.tan(math.radians(FOV / 2))
    vertices, gaussians, light = avatar.posed(avatar.pose(pose)), replace(avatar.gaussians, light=None), avatar.gaussians.light
    normals = face_frames(vertices, avatar.faces).R[gaussians.face, :, 1]
    factor = np.ones((len(normals), 3)) if light is None else shade(light, normals)
    if lamp:
        lit, share = lamp_factors(normals, *lamp)
        factor = factor + share * (lit - factor)
    gaussians.rgb = (gaussians.rgb * factor).astype(np.float32)
    out = render_bound(((vertices - eye) @ R.T).astype(np.float32), avatar.faces, gaussians,
                       Camera((f, f), (SIZE / 2, SIZE / 2), SIZE, SIZE))
    image = out.rgb + (1 - out.alpha[..., None]) * np.array(BACKGROUND) / 255
    return np.clip(image, 0, 1), out.alpha > 0.02


def lamp_factors(normals, around, above, share):
    """What the page's lamp multiplies display colours with, as a factor (N, 1), and its share. normals: (N, 3)."""
    a, b = math.radians(around), math.radians(above)
    cosine = normals @ [math.cos(b) * math.sin(a), math.sin(b), math.cos(b) * math.cos(a)]
    light = .3 + 1.1 * (1 / 4 + cosine / 2 + 5 / 32 * (3 * cosine ** 2 - 1))
    return np.maximum(light, 1e-6)[:, None] ** (1 / 2.2), share


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


@pytest.mark.parametrize("draw", ["webgpu", "webgl", "software"])
def test_a_lamp_stands_in_for_the_clips_light_as_far_as_its_slider_says_and_without_it_no_bit_changes(browser, lit, address, draw):
    browser.open(f"{address}?lamp{draw}#draw={draw}")
    if draw == "webgpu" and not browser.has_webgpu():
        pytest.skip("this chromium has no WebGPU")
    assert browser.run("gsac.renderer.kind") == draw
    view = f"pose=A&yaw=20&pitch={PITCH}&dist={DISTANCE}&fov={FOV}&target=0,0,0&bg=3a6080&still"

    def picture(words, share=None):
        browser.run(f"location.hash = '{view}{words}'")
        browser.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        if share is not None:
            browser.run(f"gsac.levels.scene.share = {share}; gsac.levels.scene.update(); gsac.step(0); gsac.draw()")
        return browser.picture() / 255

    before = picture("")
    for lamp in ((70, 30, 1), (-120, -20, 1), (70, 30, .4)):
        got, (want, person) = picture(f"&lamp={lamp[0]},{lamp[1]}", lamp[2]), expected(lit, "A", 20, lamp)
        print(f"{draw} lamp {lamp}: {psnr(got[person], want[person]):.1f} dB")
        assert psnr(got[person], want[person]) >= 45 and psnr(got[person], before[person]) < 35
    np.testing.assert_array_equal(picture("&lamp=70,30", 0), before)
    np.testing.assert_array_equal(picture(""), before)
    assert browser.errors == []


def test_the_dial_puts_the_lamp_where_it_is_dragged_and_keys_turn_it(browser, address):
    browser.open(f"{address}?dial#pose=A")
    dial = "document.getElementById('lamp')"
    lamp = "(() => { const l = gsac.levels.scene; return [l.share, l.around, l.above]; })()"
    assert browser.run(lamp)[0] == 0 and browser.run("document.getElementById('lamp-share').offsetParent === null")
    drag = """(({left, top, width, height}, right, up) => %s.dispatchEvent(new PointerEvent('pointerdown', {pointerId: 1,
        clientX: left + width / 2 * (1 + right), clientY: top + height / 2 * (1 - up)})))(%s.getBoundingClientRect(), %s, %s)"""
    browser.run("Element.prototype.setPointerCapture = () => {}")
    for right, up, around, above in ((0, 0, 0, 0), (.6, 0, 36.9, 0), (0, .8, 0, 53.1), (-1, 0, -90, 0)):
        browser.run(drag % (dial, dial, right, up))
        assert np.allclose(browser.run(lamp), [1, around, above], atol=4), (right, up)
    key = dial + ".dispatchEvent(new KeyboardEvent('keydown', {key: '%s', bubbles: true, cancelable: true}))"
    browser.run(drag % (dial, dial, 0, 0))
    at = np.array(browser.run(lamp))
    browser.run(key % "ArrowRight")
    browser.run(key % "ArrowUp")
    np.testing.assert_allclose(browser.run(lamp), at + [0, 10, 10])
    assert "above" in browser.run(f"{dial}.getAttribute('aria-valuetext')")
    assert browser.run("document.getElementById('lamp-share').offsetParent !== null")
    browser.run(key % "Delete")
    assert browser.run(lamp)[0] == 0 and browser.errors == []
