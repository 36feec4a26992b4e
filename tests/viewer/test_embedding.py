"""viewer.html in small frames of other pages: the person is in sight and the controls leave room."""

import numpy as np
import pytest

from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.benchmarks.viewer import browser as chromium
from gsac.viewer.page import page_bytes

pytestmark = [pytest.mark.slow,
              pytest.mark.skipif(chromium.find_chromium() is None, reason="needs the Debian package chromium")]
SIZE = 400
FRAMES = [(300, 250), (480, 320), (480, 360), (844, 390)]
CONTROLS = """[...document.querySelectorAll('button, select, input, #status, #name')].filter((it) => it.checkVisibility())
  .map((it) => it.getBoundingClientRect()).map((box) => [box.left, box.top, box.right, box.bottom])"""
SEEN = """(p) => {
  const { view, focal, centre } = gsac.camera.eye(innerWidth, innerHeight);
  const c = [0, 4, 8].map((r) => view[r] * p[0] + view[r + 1] * p[1] + view[r + 2] * p[2] + view[r + 3]);
  return [focal[0] * c[0] / c[2] + centre[0] + innerWidth / 2, focal[1] * c[1] / c[2] + centre[1] + innerHeight / 2];
}"""
"""Where a point, m, is seen in the page, px."""
PERSON = f"""(() => {{
  const {{ vertices }} = gsac.skin, seen = [];
  for (let v = 0; v < vertices.length; v += 3) seen.push(({SEEN})(vertices.subarray(v, v + 3)));
  return [0, 1].flatMap((axis) => [Math.min, Math.max].map((end) => end(...seen.map((at) => at[axis]))));
}})()"""
"""Left, right, top and bottom of the person in the page, px."""


@pytest.fixture(scope="module")
def address(figure, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "viewer.html"
    path.write_bytes(page_bytes(avatar_bytes(figure)))
    return path.as_uri()


@pytest.fixture(scope="module")
def page(address):
    it = chromium.Browser(SIZE, SIZE)
    yield it
    it.close()


def open_in_frame(page, address, size, words="pose=A"):
    page.resize(*size)
    page.call("Page.navigate", url="about:blank")
    page.open(f"{address}#{words}")
    page.until(f"gsac.canvas.width === {size[0]} && gsac.fade === 1")
    page.run("gsac.move()")


@pytest.mark.parametrize("size", FRAMES, ids=str)
def test_in_a_small_frame_no_control_covers_the_person_and_all_of_them_only_the_lower_half(page, address, size):
    open_in_frame(page, address, size)
    left, right, top, bottom = page.run(PERSON)
    assert left >= 0 and right <= size[0] and top >= 0 and bottom - top > 0.55 * size[1]
    boxes = np.array(page.run(CONTROLS))
    over = (boxes[:, 0] < right) & (boxes[:, 2] > left) & (boxes[:, 1] < bottom) & (boxes[:, 3] > top)
    assert not over.any(), boxes[over]
    page.run("document.getElementById('fold').click()")
    page.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert page.run("document.getElementById('panel').getBoundingClientRect().top") >= 0.45 * size[1]
    assert page.run(PERSON)[3] <= page.run("document.getElementById('panel').getBoundingClientRect().top") + 1
    assert page.run("document.getElementById('picture').checkVisibility()"), "it is there, and is scrolled to"
    assert page.errors == []


@pytest.mark.parametrize("size", [(300, 250), (480, 360)], ids=str)
def test_axe_finds_nothing_serious_in_a_small_frame(page, address, size, axe):
    open_in_frame(page, address, size)
    found = axe(page)
    page.run("document.getElementById('fold').click()")
    assert [found, axe(page)] == [[], []]


def test_the_rate_is_for_who_asks_for_it(page, address):
    open_in_frame(page, address, (900, 700), "clip=walk")
    page.until("document.getElementById('fps').textContent.includes('fps')")
    shown = "document.getElementById('status').checkVisibility()"
    assert not page.run(shown)
    page.run("document.dispatchEvent(new KeyboardEvent('keydown', { key: 'i' }))")
    assert page.run(shown)
    open_in_frame(page, address, (900, 700), "clip=walk&rate")
    page.until(shown)


def test_fingers_hit_every_slider_and_button(page, address):
    page.call("Emulation.setTouchEmulationEnabled", enabled=True)
    try:
        open_in_frame(page, address, (390, 844))
        page.run("document.body.classList.remove('folded'), document.getElementById('show-joints').click()")
        small = page.run("[...document.querySelectorAll('button, select, input[type=range]')].filter((it) => it.checkVisibility()"
                         " && it.getBoundingClientRect().height < 34).map((it) => it.id || it.ariaLabel || it.textContent)")
        assert small == []
    finally:
        page.call("Emulation.setTouchEmulationEnabled", enabled=False)


def test_who_asked_for_less_motion_sees_none_until_it_is_asked_for(page, address):
    page.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-reduced-motion", "value": "reduce"}])
    try:
        open_in_frame(page, address, (480, 360), "clip=walk&turntable")
        before = page.run("[gsac.clock, gsac.camera.yaw]")
        page.run("new Promise((done) => setTimeout(done, 300))")
        assert page.run("[gsac.clock, gsac.camera.yaw]") == before == [0, 0]
        assert page.run("document.getElementById('pause').textContent") == "Play"
        page.run("document.querySelector('[data-clip=wave]').click()")
        page.until("gsac.clock > 0.1")
        page.run("document.getElementById('show-faces').click()")
        assert set(page.run("gsac.camera.behind")) == {0}, "the camera is there at once"
    finally:
        page.call("Emulation.setEmulatedMedia", features=[])


def test_the_face_is_seen_large_while_its_sliders_are_open_and_the_whole_figure_after(page, address):
    for size in ((390, 844), (1000, 700)):
        open_in_frame(page, address, size, "pose=A")
        far = page.run("gsac.camera.distance")
        page.run("document.getElementById('show-faces').click(), gsac.camera.settle(9)")
        page.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        assert page.run("gsac.camera.distance") < 0.5 * far
        x, y = page.run(f"({SEEN})(gsac.skin.place(gsac.avatar.names.indexOf('head')))")
        left, top, right, bottom = page.run("(({left, top, right, bottom}) => [left, top, right, bottom])"
                                            "(document.getElementById('faces').getBoundingClientRect())")
        assert not (left - 40 < x < right + 40 and top - 40 < y < bottom + 40) and 0 < x < size[0] and 0 < y < size[1]
        page.run("document.querySelector('#faces .close').click()")
        assert page.run("gsac.camera.distance") > 0.9 * far
    assert page.errors == []


def test_two_clicks_come_near_to_a_limb_and_two_more_go_back(page, address):
    open_in_frame(page, address, (700, 700), "pose=T")
    far = page.run("gsac.camera.distance")
    x, y = page.run(f"({SEEN})(gsac.skin.place(gsac.avatar.names.indexOf('left_wrist')))")

    def click_twice(x, y):
        for kind in ("mousePressed", "mouseReleased") * 2:
            page.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)
    click_twice(x, y)
    assert page.run("gsac.near") == "left_wrist" and page.run("gsac.camera.distance") < 0.4 * far
    click_twice(350, 300)
    assert page.run("gsac.near") is None
    page.run("document.dispatchEvent(new KeyboardEvent('keydown', { key: 'z' }))")
    assert page.run("gsac.near") == "face"
