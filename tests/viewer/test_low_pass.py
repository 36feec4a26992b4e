"""The low-pass of viewer.html: an old file looks as before, a new one alike at every size. test_page.py draws by the new rule."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gsac.avatar.camera import Camera
from gsac.avatar.draw_rule import ADDED, PIXEL
from gsac.avatar.film import FOV, PITCH, look_at
from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.avatar.raster import render_bound
from gsac.benchmarks.viewer import browser as chromium
from gsac.viewer.page import page_bytes

pytestmark = [pytest.mark.slow,
              pytest.mark.skipif(chromium.find_chromium() is None, reason="needs the Debian package chromium")]
SIZE, BACKGROUND = 320, (0x3A, 0x60, 0x80)


@pytest.fixture(scope="module")
def thin(figure):
    """The figure of gaussians of which most are smaller than a pixel."""
    return replace(figure, gaussians=replace(figure.gaussians, log_scale=figure.gaussians.log_scale - .7), coarser=[])


def expected(avatar, distance):
    R, eye = look_at(30, np.zeros(3), distance)
    f = SIZE / 2 / math.tan(math.radians(FOV / 2))
    out = render_bound(((avatar.posed(avatar.pose("A")) - eye) @ R.T).astype(np.float32), avatar.faces, avatar.gaussians,
                       Camera((f, f), (SIZE / 2, SIZE / 2), SIZE, SIZE))
    return out.rgb + (1 - out.alpha[..., None]) * np.array(BACKGROUND) / 255, out.alpha > .02


def reduced(picture, size):
    """(size, size, 3), each pixel the mean of those of a picture (n * size, n * size, 3)."""
    n = len(picture) // size
    return picture.reshape(size, n, size, n, 3).mean((1, 3))


def psnr(a, b):
    return -10 * math.log10(max(((a - b) ** 2).mean(), 1e-12))


def test_by_the_rule_of_old_files_the_person_looks_as_the_trainers_renderer_shows(browser, thin, tmp_path):
    avatar, other = (replace(thin, gaussians=replace(thin.gaussians, low_pass=rule)) for rule in (ADDED, PIXEL))
    (tmp_path / "viewer.html").write_bytes(page_bytes(avatar_bytes(avatar)))
    for draw in ("webgpu", "webgl", "software"):
        browser.open(f"{(tmp_path / 'viewer.html').as_uri()}?{draw}#draw={draw}")
        if draw == "webgpu" and not browser.has_webgpu():
            continue
        for distance in (1.2, 12.0):
            browser.run(f"location.hash = 'pose=A&yaw=30&pitch={PITCH}&dist={distance}&fov={FOV}&target=0,0,0&bg=3a6080&still'")
            browser.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
            got, (want, person) = browser.picture() / 255, expected(avatar, distance)
            print(f"{draw} {distance} m: {psnr(got[person], want[person]):.1f} dB")
            assert psnr(got[person], want[person]) >= 45
        assert psnr(want[person], expected(other, distance)[0][person]) < 35, "the rules differ"
    assert browser.errors == []


@pytest.mark.parametrize(("rule", "alike"), [(PIXEL, True), (ADDED, False)], ids=["energy kept", "added"])
def test_with_energy_kept_the_person_looks_alike_at_half_and_at_two_and_four_times_the_size(browser, thin, tmp_path, rule, alike):
    avatar = replace(thin, gaussians=replace(thin.gaussians, low_pass=rule))
    (tmp_path / "viewer.html").write_bytes(page_bytes(avatar_bytes(avatar)))
    pictures, view = {}, "draw=software&pose=A&yaw=30&dist=3.4&target=0,0,0&bg=808080&still"
    try:
        for size in (80, 160, 320, 640):
            browser.resize(size, size)
            browser.open(f"{(tmp_path / 'viewer.html').as_uri()}?{size}#{view}")
            pictures[size] = reduced(browser.picture() / 255, min(size, 160))
    finally:
        browser.resize(SIZE, SIZE)
    once, half = pictures[160], reduced(pictures[160], 80)
    person, person_half = (abs(p - 128 / 255).max(-1) > .02 for p in (once, half))
    got = [psnr(pictures[80][person_half], half[person_half]), *(psnr(pictures[size][person], once[person]) for size in (320, 640))]
    print(rule, [f"{x:.1f} dB" for x in got])
    assert (min(got) > 36) == alike
