"""Files that a user drops on viewer.html: another avatar takes the place of the one that is seen."""

import base64
import dataclasses

import numpy as np
import pytest

from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.avatar.motion.source import Motion
from gsac.benchmarks.viewer import browser as chromium
from gsac.viewer.page import page_bytes
from support import dances
from support.page_modules import expose

pytestmark = [pytest.mark.slow,
              pytest.mark.skipif(chromium.find_chromium() is None, reason="needs the Debian package chromium")]
SIZE = 300
NOTE = "document.getElementById('note').textContent"


@pytest.fixture(scope="module")
def other(figure):
    """Another avatar: green, and without clips and expressions."""
    rgb = np.full_like(figure.gaussians.rgb, (0.1, 0.9, 0.1))
    return avatar_bytes(dataclasses.replace(
        figure, clips={}, coarser=[], gaussians=dataclasses.replace(figure.gaussians, rgb=rgb), expression_names=[],
        expression_start=np.zeros(1, np.int32), expression_vertex=np.zeros(0, np.int32),
        expression_delta=np.zeros((0, 3), np.float32), jaw_actions=np.zeros((0, 3), np.float32)))


@pytest.fixture
def page(figure, browser, tmp_path):
    (tmp_path / "viewer.html").write_bytes(page_bytes(avatar_bytes(figure)))
    browser.call("Page.navigate", url="about:blank")
    browser.open((tmp_path / "viewer.html").as_uri() + "#clip=walk")
    return browser


def drop(page, name, data):
    page.run(f"""(() => {{
      const bytes = Uint8Array.from(atob('{base64.b64encode(data).decode()}'), (c) => c.charCodeAt(0)), held = new DataTransfer();
      held.items.add(new File([bytes], '{name}'));
      {NOTE.removesuffix('.textContent')}.textContent = '';
      document.body.dispatchEvent(new DragEvent('drop', {{ dataTransfer: held, bubbles: true, cancelable: true }}));
    }})()""")


@pytest.mark.parametrize("draw", ["webgpu", "webgl", "software"])
def test_a_dropped_avatar_is_shown_in_place_of_the_first(page, other, draw):
    page.open(page.run("location.href").split("#")[0] + f"?{draw}#draw={draw}&clip=walk")
    drop(page, "Grace.gsac", other)
    page.until("document.getElementById('name').textContent === 'Grace' && gsac.playing.pose === 'A'")
    assert page.run("[...document.querySelectorAll('#poses button')].map((b) => b.textContent)") == ["A-pose", "T-pose"]
    assert not page.run("document.getElementById('show-faces').checkVisibility()")
    page.run("document.body.classList.add('bare')")
    page.run("new Promise((done) => setTimeout(done, 300))")
    red, green, blue = np.moveaxis(page.picture().astype(int), -1, 0)
    assert ((green > red + 60) & (green > blue + 60)).mean() > 0.02
    assert page.errors == []


def test_a_broken_avatar_is_refused_in_a_sentence_and_the_first_stays(page, other):
    drop(page, "cut.gsac", other[:5000])
    page.until(f"{NOTE} !== ''")
    assert "5000" in page.run(NOTE)
    assert page.run("[document.getElementById('name').textContent, gsac.playing.clip]")[1] == "walk"


def test_a_motion_that_is_read_while_another_avatar_comes_is_refused_in_a_sentence(page, figure):
    skeleton = dances.Skeleton(figure.joint_names, figure.parents, figure.joints)
    still = Motion(10.0, np.zeros((3, 55, 3), np.float32), np.zeros((3, 3), np.float32))
    page.run("""const { arrayBuffer } = File.prototype, bytes = document.getElementById('person').file;
      File.prototype.arrayBuffer = async function () {
        await document.getElementById('person').open(bytes);
        return arrayBuffer.call(this);
      };""")
    drop(page, "dance.bvh", dances.bvh_text(skeleton, still).encode())
    page.until(f"{NOTE} !== ''")
    assert page.run(NOTE) == "dance.bvh: another avatar has come meanwhile; drop it again"
    assert page.run("document.querySelector('[data-clip=dance]')") is None and page.errors == []


def test_without_an_avatar_a_motion_is_refused_in_a_sentence(page):
    page.run("gsac.avatar = undefined")
    drop(page, "dance.bvh", b"HIERARCHY")
    page.until(f"{NOTE} !== ''")
    assert page.run(NOTE) == "dance.bvh: no avatar is there that a motion could move"


@pytest.mark.parametrize("name", ["avatar.ply", "avatar.spz"])
def test_gaussians_without_a_body_are_named_as_what_they_are(page, name):
    drop(page, name, b"ply\nformat binary_little_endian 1.0\n")
    page.until(f"{NOTE} !== ''")
    assert name in page.run(NOTE) and ".gsac" in page.run(NOTE) and "without a body" in page.run(NOTE)


def test_the_page_gives_back_every_byte_of_the_avatar_it_holds(page, figure, browser):
    expose(browser, "unpackArrays")
    assert bytes(page.run("Array.from(new Uint8Array(document.getElementById('person').file))")) == avatar_bytes(figure)


def test_the_page_of_6000_gaussians_is_smaller_than_seven_tenths_of_its_avatars_file(exported):
    page, container = (exported / "viewer.html").stat().st_size, (exported / "avatar.gsac").stat().st_size
    assert page < 0.7 * container, "arrays and script packed: 1.2 MB hold 12,000 gaussians and three levels of them"
