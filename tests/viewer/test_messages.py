"""viewer.html in an <iframe>: the page around it steers it by messages, if its origin is allowed, and is told what happens."""

import json

import pytest

from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.benchmarks.viewer import browser as chromium
from gsac.benchmarks.viewer.frame_rate import serve
from gsac.viewer.page import page_bytes

pytestmark = [pytest.mark.slow,
              pytest.mark.skipif(chromium.find_chromium() is None, reason="needs the Debian package chromium")]
SIZE = 300
PLAIN = '<gsac-avatar id="person" '
AROUND = """<!doctype html><meta charset="utf-8"><link rel="icon" href="data:,">
<iframe id="frame" width="280" height="280" allow="fullscreen; xr-spatial-tracking"></iframe>
<script>
window.heard = [];
window.addEventListener("message", ({ data, origin }) => heard.push({ ...data, origin }));
window.say = (message) => document.getElementById("frame").contentWindow.postMessage(message, "*");
document.documentElement.dataset.ready = "yes";
</script>"""


@pytest.fixture(scope="module")
def folder(figure, tmp_path_factory):
    """Pages that allow their own origin, nobody and everybody, and one that holds them."""
    folder = tmp_path_factory.mktemp("site")
    page = page_bytes(avatar_bytes(figure)).decode()
    assert PLAIN in page
    (folder / "own.html").write_text(page)
    (folder / "nobody.html").write_text(page.replace(PLAIN, PLAIN + 'origins="" '))
    (folder / "everybody.html").write_text(page.replace(PLAIN, PLAIN + 'origins="*" '))
    (folder / "around.html").write_text(AROUND)
    return folder


@pytest.fixture(scope="module")
def sites(folder):
    """Two origins that serve the same files."""
    with serve(folder) as one, serve(folder) as other:
        yield one, other


def embed(browser, around, inside):
    """Opens a page of one origin with a page of another in it, and waits until that one shows its avatar."""
    browser.call("Page.navigate", url="about:blank")
    browser.open(f"{around}/around.html")
    browser.run(f"document.getElementById('frame').src = {json.dumps(inside)}")
    return browser


def say(page, **message):
    """What the page hears after a message, up to the answer to `hello`, which follows it."""
    page.run(f"heard.length = 0, say({json.dumps(message)}), say({{ gsac: 'hello' }})")
    page.until("heard.some(({ gsac }) => gsac === 'ready')")
    return [one for one in page.run("heard") if one["gsac"] != "ready"]


@pytest.fixture
def page(browser, sites):
    """A page that holds one of its own origin, whose viewer is `gsac`."""
    page = embed(browser, sites[0], f"{sites[0]}/own.html#clip=walk&draw=software")
    page.until("heard.some(({ gsac }) => gsac === 'ready')")
    page.run("window.gsac = document.getElementById('frame').contentWindow.gsac, 0")
    return page


def test_the_page_around_is_told_when_the_avatar_is_there_and_what_it_has(page, figure, sites):
    (ready,) = page.run("heard.filter(({ gsac }) => gsac === 'ready')")
    assert ready["origin"] == sites[0]
    assert ready["clips"] == list(figure.clips) and ready["poses"] == ["A", "T"]
    assert ready["expressions"] == figure.expression_names and ready["joints"] == figure.joint_names


def test_words_steer_motion_face_joints_camera_and_light(page):
    assert say(page, gsac="play", name="wave") == []
    assert page.run("gsac.playing") == {"clip": "wave"}
    assert say(page, gsac="pause") == [] and page.run("gsac.paused") is True
    assert say(page, gsac="play") == [] and page.run("gsac.paused") is False
    assert say(page, gsac="play", name="T") == [] and page.run("gsac.playing") == {"pose": "T"}
    assert say(page, gsac="express", weights={"jawOpen": 0.5}) == [] and page.run("gsac.expression") == {"jawOpen": 0.5}
    assert say(page, gsac="turn", turns={"head": [0, 30, 0]}) == [] and page.run("gsac.turned") == {"head": [0, 30, 0]}
    assert say(page, gsac="view", yaw=40, pitch=10, dist=2.5, target=[0, 0.5, 0]) == []
    assert page.run("[gsac.camera.yaw, gsac.camera.pitch, gsac.camera.distance, gsac.camera.target]") == [40, 10, 2.5, [0, 0.5, 0]]
    assert say(page, gsac="look", at="face") == [] and page.run("gsac.near") == "face"
    assert say(page, gsac="light", light="off") == [] and page.run("gsac.levels.lit") is False
    assert say(page, gsac="light", lamp=[40, 30]) == []
    assert page.run("[gsac.levels.lit, gsac.levels.scene.around, gsac.levels.scene.share]") == [True, 40, 1]
    assert say(page, gsac="light", lamp=None) == [] and page.run("gsac.levels.scene.share") == 0


@pytest.mark.parametrize(("message", "why"), [
    ({"gsac": "dance"}, "expected hello, play"), ({"gsac": "constructor"}, "expected hello"),
    ({"gsac": "play", "name": "jump"}, "jump"), ({"gsac": "look", "at": 7}, "expected body"),
    ({"gsac": "express", "weights": {"jawOpne": 1}}, "jawOpne"), ({"gsac": "express"}, "weights"),
    ({"gsac": "turn", "turns": {"head": None}}, "head"), ({"gsac": "turn", "turns": [1]}, "turns"),
    ({"gsac": "view", "yaw": "left"}, "degrees"), ({"gsac": "view", "target": [1, 2]}, "three numbers"),
    ({"gsac": "light", "lamp": "bright"}, "two angles")], ids=str)
def test_a_wrong_message_is_answered_in_a_sentence_and_changes_nothing(page, message, why):
    state = "[gsac.playing, gsac.expression, gsac.turned, gsac.near, gsac.levels.lit, gsac.levels.scene.share]"
    before = page.run(state)
    (answer,) = say(page, **message)
    assert answer["gsac"] == "error" and why in answer["text"]
    assert page.run(state) == before and page.errors == []


@pytest.mark.parametrize("message", ["play", None, 3, [], {"play": "wave"}, {"gsac": 3}], ids=str)
def test_what_is_no_message_of_ours_is_left_alone(page, message):
    page.run(f"heard.length = 0, say({json.dumps(message)}), say({{ gsac: 'hello' }})")
    page.until("heard.length > 0")
    assert [one["gsac"] for one in page.run("heard")] == ["ready"] and page.errors == []


def test_an_end_of_a_motion_that_does_not_loop_is_told(page):
    page.run("gsac.avatar.clips.wave.loop = false, heard.length = 0, say({ gsac: 'play', name: 'wave' })")
    page.until("gsac.playing.clip === 'wave'")
    page.run("gsac.clock = gsac.length - 0.01, 0")
    page.until("heard.some(({ gsac }) => gsac === 'end')")


def test_another_origin_neither_steers_nor_hears_unless_it_is_allowed(browser, sites):
    one, other = sites
    page = embed(browser, one, f"{other}/everybody.html#draw=software")
    page.until("heard.some(({ gsac }) => gsac === 'ready')")
    (answer,) = say(page, gsac="play", name="jump")
    assert answer["origin"] == other
    for name in ("own", "nobody"):
        page = embed(browser, one, f"{other}/{name}.html#draw=software")
        page.run("""new Promise((done) => { const asking = setInterval(() => say({ gsac: "hello" }), 100);
                    setTimeout(() => { clearInterval(asking); done(0); }, 4000); })""")
        assert page.run("heard") == [], name


def test_a_window_other_than_the_one_around_is_not_heard(page):
    page.run("""(() => {
      const stranger = document.body.appendChild(document.createElement("iframe"));
      stranger.contentWindow.eval("parent.frames[0].postMessage({ gsac: 'play', name: 'wave' }, '*')");
    })()""")
    assert say(page, gsac="hello") == []
    assert page.run("gsac.playing") == {"clip": "walk"}
