"""The element <gsac-avatar> while several things happen at once: openings, moves in the page, lost renderers, the camera, films."""

import dataclasses

import pytest

from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.benchmarks.viewer import browser as chromium
from gsac.benchmarks.viewer.frame_rate import serve
from gsac.viewer.package import write_package

pytestmark = [pytest.mark.slow,
              pytest.mark.skipif(chromium.find_chromium() is None, reason="needs the Debian package chromium")]
SIZE = 300
HOST = """<!doctype html><html lang="en"><head><title>One element</title><link rel="icon" href="data:,"></head><body>
<gsac-avatar></gsac-avatar><script type="module">
import "./gsac-avatar.js";
const take = async (name) => (await fetch(name)).arrayBuffer();
const it = document.querySelector("gsac-avatar"), told = [], tracks = [];
for (const event of ["load", "error", "note"]) it.addEventListener(event, (e) => told.push([event, e.detail]));
const wait = (ms) => new Promise((done) => setTimeout(done, ms));
// Showing an avatar takes this long, ms: once each.
const showings = [];
Object.defineProperty(navigator, "gpu", { value: { requestAdapter: () => wait(showings.shift() ?? 0).then(() => null) } });
// The user takes this long to allow the camera, ms.
let answer = 0;
navigator.mediaDevices.getUserMedia = async () => {
  await wait(answer);
  const canvas = document.createElement("canvas");
  canvas.getContext("2d").fillRect(0, 0, 9, 9);
  const stream = canvas.captureStream(30);
  tracks.push(...stream.getTracks());
  return stream;
};
const lit = () => tracks.filter((track) => track.readyState === "live").length;
Object.assign(window, { it, told, tracks, wait, showings, lit, setAnswer: (ms) => { answer = ms; },
  first: await take("first.gsac"), second: await take("second.gsac"), kit: { face: { detectForVideo: () => ({}) } } });
document.documentElement.dataset.ready = "yes";
</script></body></html>"""
"""`second` has no clips. `lit()`: how many cameras are on."""


@pytest.fixture(scope="module")
def site(figure, tmp_path_factory):
    where = tmp_path_factory.mktemp("element")
    write_package(where)
    (where / "first.gsac").write_bytes(avatar_bytes(figure))
    (where / "second.gsac").write_bytes(avatar_bytes(dataclasses.replace(figure, clips={})))
    (where / "host.html").write_text(HOST)
    with serve(where) as address:
        yield address


@pytest.fixture
def page(browser, site):
    browser.errors.clear()
    browser.call("Page.navigate", url="about:blank")
    browser.open(f"{site}/host.html")
    yield browser
    assert browser.errors == []


def ask(page, script):
    """What the body of an async function returns."""
    return page.run(f"(async () => {{ {script} }})()")


@pytest.mark.parametrize("later", [0, 50], ids=["at once", "while the first is being shown"])
def test_of_two_avatars_that_are_opened_the_last_stays_on_the_page_however_long_the_first_takes(page, later):
    got = ask(page, f"""showings.push(300, 0);
      const one = it.open(first);
      await wait({later});
      await Promise.all([one, it.open(second)]);
      await wait(400);
      const {{ stage, canvas }} = it.viewer;
      return [it.file === second, it.clips, told.at(-1)[1].clips, stage.children.length, canvas.isConnected];""")
    assert got == [True, [], [], 1, True]


def test_a_broken_file_leaves_alone_what_is_being_shown(page):
    got = ask(page, """showings.push(200);
      const one = it.open(first), said = await it.open(new ArrayBuffer(9)).catch((error) => error.message);
      await one;
      return [typeof said, it.file === first, told.map(([event]) => event)];""")
    assert got == ["string", True, ["load"]]


def test_an_address_that_was_replaced_says_nothing_when_it_fails(page):
    got = ask(page, """const { fetch } = window;
      window.fetch = async (address) => {
        if (address !== "none") return fetch(address);
        await wait(200);
        throw new Error("no line");
      };
      it.setAttribute("src", "none");
      it.setAttribute("src", "first.gsac");
      await wait(600);
      return [told.map(([event]) => event), it.inside("message").checkVisibility()];""")
    assert got == [["load"], False]


def test_an_element_that_leaves_the_page_and_comes_back_still_loads_what_was_asked_for(page):
    got = ask(page, """await it.open(first);
      const { fetch } = window;
      window.fetch = (address) => wait(300).then(() => fetch(address));
      it.setAttribute("src", "second.gsac");
      it.remove();
      await wait(50);
      document.body.append(it);
      await wait(800);
      return [it.clips, it.viewer.renderer !== null];""")
    assert got == [[], True]


def test_an_element_that_is_moved_while_another_avatar_is_being_shown_shows_that_one(page):
    got = ask(page, """await it.open(first);
      showings.push(200);
      const two = it.open(second);
      await wait(50);
      document.body.append(it);
      await two;
      await wait(300);
      return [it.file === second, it.clips, it.viewer.renderer !== null && Boolean(it.viewer.running)];""")
    assert got == [True, [], True]


def test_an_element_that_is_removed_while_it_is_being_shown_keeps_nothing_of_the_graphics_card(page):
    got = ask(page, """showings.push(200);
      const one = it.open(first);
      await wait(50);
      it.remove();
      await one;
      await wait(50);
      const left = it.viewer.renderer === null;
      document.body.append(it);
      await wait(300);
      return [left, it.viewer.renderer !== null];""")
    assert got == [True, True]


def test_an_element_that_was_moved_plays_no_faster(page):
    got = ask(page, """await it.open(first);
      it.play("walk");
      const { viewer } = it, { advance } = viewer;
      for (let n = 0; n < 3; n++) document.body.append(it);
      await wait(50);
      let steps = 0, frames = 0;
      viewer.advance = function (...given) { steps += 1; return advance.apply(this, given); };
      await new Promise((done) => {
        const next = () => (++frames < 20 ? requestAnimationFrame(next) : done());
        requestAnimationFrame(next);
      });
      return steps;""")
    assert 18 <= got <= 21


def test_a_lost_renderer_takes_no_place_of_an_avatar_that_was_opened_since(page):
    got = ask(page, """await it.open(first);
      it.viewer.renderer.onLost("gone");
      await it.open(second);
      const { renderer } = it.viewer;
      await wait(1300);
      return [it.viewer.renderer === renderer, told.filter(([event]) => event === "note")];""")
    assert got == [True, []]


def test_a_renderer_that_is_lost_when_the_element_leaves_the_page_has_no_successor_until_it_is_back(page):
    got = ask(page, """await it.open(first);
      it.viewer.renderer.onLost("gone");
      it.remove();
      await wait(1300);
      const left = it.viewer.renderer === null;
      document.body.append(it);
      await wait(300);
      return [left, it.viewer.renderer !== null];""")
    assert got == [True, True]


def test_of_two_mirrors_that_are_asked_for_at_once_one_camera_stays_on_until_it_is_switched_off(page):
    got = ask(page, """await it.open(first);
      setAnswer(100);
      await Promise.all([it.mirror(kit), it.mirror(kit)]);
      const during = lit();
      await it.mirror(null);
      return [tracks.length, during, lit()];""")
    assert got == [2, 1, 0]


@pytest.mark.parametrize("end", ["it.mirror(null)", "it.remove()"])
def test_a_mirror_that_ends_while_the_user_is_asked_leaves_no_camera_on(page, end):
    got = ask(page, f"""await it.open(first);
      it.play("walk");
      setAnswer(100);
      const asked = it.mirror(kit);
      {end};
      await asked;
      return [tracks.length, lit(), it.reflection, it.viewer.playing];""")
    assert got == [1, 0, None, {"clip": "walk"}]


def test_a_camera_whose_picture_cannot_be_played_is_switched_off(page):
    got = ask(page, """await it.open(first);
      HTMLMediaElement.prototype.play = async () => { throw new Error("no play"); };
      const said = await it.mirror(kit).catch((error) => error.message);
      return [said, tracks.length, lit()];""")
    assert got == ["no play", 1, 0]


def test_without_an_avatar_a_mirror_asks_for_no_camera_and_says_why(page):
    got = ask(page, "return [await it.mirror(kit).catch((error) => error.message), tracks.length];")
    assert got == ["no avatar is there yet", 0]


def test_a_network_that_fails_ends_the_mirror_in_a_sentence(page):
    got = ask(page, """await it.open(first);
      await it.mirror({ face: { detectForVideo: () => { throw new Error("out of memory"); } } });
      await wait(300);
      return [lit(), it.reflection, it.viewer.playing, told.at(-1)];""")
    assert got == [0, None, {"pose": "A"}, ["note", "The mirror has ended: out of memory"]]


def test_a_camera_that_is_pulled_out_ends_the_mirror_in_a_sentence(page):
    got = ask(page, """await it.open(first);
      await it.mirror(kit);
      tracks[0].dispatchEvent(new Event("ended"));
      return [lit(), it.reflection, told.at(-1)];""")
    assert got == [0, None, ["note", "The mirror has ended: the camera is gone"]]


def test_a_film_of_a_pose_goes_once_around_the_figure_and_one_of_a_motion_begins_with_it(page):
    got = ask(page, """await it.open(first);
      const { viewer } = it;
      Object.defineProperty(viewer, "round", { value: 0.5 });
      it.play("T");
      const yaw = viewer.camera.yaw;
      await it.film();
      const turned = viewer.camera.yaw - yaw;
      it.play("walk");
      it.pause();
      it.currentTime = it.duration - 0.01;
      await it.film();
      return [turned, it.paused, it.currentTime];""")
    turned, paused, clock = got
    assert 5 < turned < 60 and not paused and 0.2 < clock < 1


def test_a_film_of_so_many_seconds_shows_what_is_seen(page):
    got = ask(page, """await it.open(first);
      it.play("T");
      await it.film(0.3);
      return [it.viewer.turntable, it.viewer.camera.yaw];""")
    assert got == [False, 0]


def test_a_film_that_does_not_begin_lets_the_figure_at_rest_be_drawn_once_again(page):
    got = ask(page, """await it.open(first);
      MediaRecorder.prototype.start = () => { throw new Error("no recorder"); };
      let said = null;
      try { await it.film(0.1); } catch (error) { said = error.message; }
      return [said, it.viewer.filmed];""")
    assert got == ["no recorder", False]


def test_where_a_browser_has_no_full_screen_it_is_said(page):
    got = ask(page, """await it.open(first);
      it.screen.requestFullscreen = undefined;
      it.inside("full").click();
      await wait(50);
      return told.at(-1);""")
    assert got[0] == "note" and "full screen" in got[1]
