"""The options of an address: what is wrong in them is said and left out, and the person is seen all the same."""

import subprocess

import numpy as np
import pytest

from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.benchmarks.viewer import browser as chromium
from gsac.viewer.page import page_bytes
from support.page_modules import copy_modules

pytestmark = pytest.mark.slow
SIZE = 300
BAD = {"yaw=abc": "degrees", "t=abc": "seconds", "t=-5": "seconds", "fov=0": "1 to 150", "fov=x": "1 to 150",
       "dist=-1": "metres", "dist=1m": "metres", "target=a,b": "three numbers", "target=1,,2": "three numbers",
       "pitch=500": "-90 to 90", "bg=red": "2b303b", "clip=dance": "wave, walk", "pose=Q": "A, T",
       "expression=jawOpen:wide": "jawOpen:0.5", "expression=jawOpne": "jawOpen", "joints=head:1,2": "head:0,30,0",
       "joints=haed:0,1,0": "pelvis, left_hip", "draw=metal": "webgpu or webgl", "light=dim": "on or off",
       "turntable=fast": "on or off"}
"""Words that are no option -> what the page then says was expected."""
EMPTY = ("yaw=abc", "t=abc", "fov=0", "fov=x", "dist=-1", "target=a,b")
"""Those that gave an empty page."""


@pytest.fixture(scope="module")
def page(figure, tmp_path_factory):
    if chromium.find_chromium() is None:
        pytest.skip("needs the Debian package chromium")
    path = tmp_path_factory.mktemp("page") / "viewer.html"
    path.write_bytes(page_bytes(avatar_bytes(figure)))
    it = chromium.Browser(SIZE, SIZE)
    it.open(path.as_uri())
    yield it
    it.close()


@pytest.mark.parametrize("words", BAD)
def test_what_is_no_option_is_named_and_left_out_and_the_person_is_seen(page, words):
    page.run("document.getElementById('note').textContent = ''")
    page.run(f"location.hash = '{words}'")
    page.until("document.getElementById('note').textContent !== ''")
    said = page.run("document.getElementById('note').textContent")
    name, value = words.split("=")
    assert name in said and value.split(":")[0] in said and BAD[words] in said
    if words in EMPTY:
        page.run("document.body.classList.add('bare')")
        picture = page.picture().astype(int)
        assert (np.abs(picture - picture[3, 3]).max(-1) > 30).mean() > 0.02
    assert page.run("gsac.clock") >= 0 and page.errors == []


def test_what_is_an_option_is_taken_without_a_word(page):
    page.run("document.getElementById('note').textContent = ''")
    page.run("location.hash = 'clip=walk&t=0.5&yaw=-20.5&pitch=5&dist=3&target=0,-.1,0&fov=25&bg=A0b0C0"
             "&expression=jawOpen,browInnerUp:.5&joints=head:0,20,0&light=off&turntable&rate'")
    page.until("gsac.playing.clip === 'walk'")
    assert page.run("[gsac.camera.fov, gsac.background, gsac.expression, gsac.turned]") == [
        25, "#A0b0C0", {"jawOpen": 1, "browInnerUp": 0.5}, {"head": [0, 20, 0]}]
    assert page.run("document.getElementById('note').textContent") == ""


def test_any_words_give_numbers_that_a_camera_can_have(tmp_path):
    copy_modules(tmp_path)
    (tmp_path / "attack.js").write_text("""
      import { OPTIONS, readAddress } from "./address.js";
      const words = ["", "abc", "NaN", "Infinity", "-1e999", "1e309", "0", "-0", "1,2,3", ",", ":", ";:,", "a:b,c;d", "%", "\\0",
        "٣", "0x10"];
      for (const name of OPTIONS) for (const word of words) {
        const got = readAddress(`${name}=${encodeURIComponent(word)}`), { seconds, yaw, fov, pitch, distance, target } = got;
        const numbers = [seconds, yaw, fov, pitch ?? 0, distance ?? 1, ...target ?? [], ...Object.values(got.expression),
          ...Object.values(got.turned).flat()];
        const possible = fov > 0 && seconds >= 0 && (distance ?? 1) > 0 && got.faults.every((fault) => fault.length < 200);
        if (!numbers.every(Number.isFinite) || !possible) throw new Error(`${name}=${word}`);
      }
      console.log("sound");
    """)
    done = subprocess.run(["node", tmp_path / "attack.js"], capture_output=True, text=True)
    assert done.stdout == "sound\n", done.stderr
