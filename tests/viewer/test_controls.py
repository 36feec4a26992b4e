"""The controls of viewer.html: time, joints, face, picture, rate, and a headset that this file plays."""

import base64
import math

import cv2
import numpy as np
import pytest

from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.benchmarks.viewer import browser as chromium
from gsac.viewer.page import page_bytes
from support.page_modules import expose

pytestmark = [pytest.mark.slow,
              pytest.mark.skipif(chromium.find_chromium() is None, reason="needs the Debian package chromium")]
SIZE = 400

HEADSET = """
window.Headset = { views: [], height: 1.6, views0: null };
const inverse = (m) => {
  const r = [m[0], m[4], m[8], 0, m[1], m[5], m[9], 0, m[2], m[6], m[10], 0], t = [m[12], m[13], m[14]];
  return new Float32Array([...r, ...[0, 1, 2].map((i) => -(r[i] * t[0] + r[4 + i] * t[1] + r[8 + i] * t[2])), 1]);
};
class Session extends EventTarget {
  requestAnimationFrame(act) { this.next = act; return 1; }
  async updateRenderState() {}
  async requestReferenceSpace(kind) { return { kind }; }
  async end() { this.next = null; this.ended = true; this.dispatchEvent(new Event('end')); }
  show() { this.next(performance.now(), { getViewerPose: () => Headset.pose }); }
}
window.XRWebGLLayer = class { constructor() { this.framebuffer = null; } getViewport(view) { return view.box; } };
WebGL2RenderingContext.prototype.makeXRCompatible = async () => {};
Headset.at = (x, y, z, boxes, projection) => {
  const matrix = (dx) => new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x + dx, y, z, 1]);
  const transform = (dx) => ({ matrix: matrix(dx), inverse: { matrix: inverse(matrix(dx)) } });
  Headset.pose = { transform: transform(0), views: boxes.map((box, i) => ({ box, transform: transform(i ? 0.2 : -0.2),
    projectionMatrix: new Float32Array(projection[i]) })) };
};
Object.defineProperty(navigator, 'xr', { value: {
  isSessionSupported: async (mode) => mode === 'immersive-vr',
  requestSession: async () => (Headset.session = new Session()) } });
"""


@pytest.fixture(scope="module")
def address(figure, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "viewer.html"
    path.write_bytes(page_bytes(avatar_bytes(figure)))
    return path.as_uri()


@pytest.fixture(scope="module")
def page(address):
    it = chromium.Browser(SIZE, SIZE)
    it.open(address)
    yield it
    it.close()


def click(page, name):
    page.run(f"document.getElementById('{name}').click()")


def slide(page, name, value):
    """Moves the slider with this label."""
    page.run(f"(() => {{ const slider = document.querySelector('[aria-label=\"{name}\"]'); slider.value = {value};"
             "slider.dispatchEvent(new Event('input')); })()")


def vertices(page):
    return np.array(page.run("gsac.step(0), Array.from(gsac.skin.vertices)")).reshape(-1, 3)


def red(picture):
    picture = picture.astype(int)
    return picture[..., 0] > picture[..., 1:].max(-1) + 60


def test_a_joint_turns_by_its_sliders_and_back(page, figure):
    page.run("location.hash = 'pose=A'")
    page.until("gsac.playing.pose === 'A'")
    click(page, "show-joints")
    assert page.run("document.getElementById('joints').hidden") is False
    page.run("document.getElementById('joint').value = 'right_elbow'")
    page.run("document.getElementById('joint').dispatchEvent(new Event('change'))")
    slide(page, "y, degrees", 80)
    pose = figure.pose("A")
    pose[figure.joint_names.index("right_elbow")] = (0, math.radians(80), 0)
    np.testing.assert_allclose(vertices(page), figure.posed(pose), atol=1e-5)
    click(page, "zero-joints")
    np.testing.assert_allclose(vertices(page), figure.posed(figure.pose("A")), atol=1e-5)
    assert page.run("document.querySelector('[aria-label=\"y, degrees\"]').value") == "0"
    assert page.errors == []


def test_a_turn_by_hand_comes_on_top_of_a_motion_and_from_the_address(page, figure):
    page.run("location.hash = 'clip=walk&t=0.25&joints=head:0,40,0;left_elbow:0,-60,10&still'")
    page.until("gsac.still")
    clip = figure.clips["walk"]
    from scipy.spatial.transform import Rotation
    pose = np.zeros((55, 3))
    pose[[figure.joint_names.index(j) for j in clip.joints]] = clip.rotation[5]
    for joint, degrees in (("head", (0, 40, 0)), ("left_elbow", (0, -60, 10))):
        j = figure.joint_names.index(joint)
        pose[j] = (Rotation.from_rotvec(pose[j]) * Rotation.from_rotvec(np.radians(degrees))).as_rotvec()
    want = figure.posed(pose.astype(np.float32)) + clip.transl[5]
    np.testing.assert_allclose(vertices(page), want, atol=1e-5)


def test_several_expressions_at_once_move_what_each_moves(page, figure):
    page.run("location.hash = 'pose=T'")
    page.until("!gsac.still && gsac.playing.pose === 'T'")
    click(page, "show-faces")
    assert page.run("document.getElementById('joints').hidden && !document.getElementById('faces').hidden")
    slide(page, "jaw open", 0.5)
    slide(page, "brow inner up", 1)
    assert page.run("gsac.expression") == {"jawOpen": 0.5, "browInnerUp": 1}
    moved = vertices(page) - figure.vertices
    span = slice(figure.expression_start[0], figure.expression_start[1])
    np.testing.assert_allclose(moved[figure.expression_vertex[span]], 0.5 * figure.expression_delta[span], atol=1e-5)
    click(page, "zero-faces")
    np.testing.assert_allclose(vertices(page), figure.vertices, atol=1e-6)
    presets = "[...document.querySelectorAll('#presets button')].map((b) => b.textContent)"
    assert page.run(presets) == ["Neutral"], "no preset of actions that the avatar lacks"
    click(page, "show-faces")
    assert page.run("document.getElementById('faces').hidden")


def test_time_stands_still_on_pause_goes_where_the_slider_is_and_on(page):
    page.run("location.hash = 'clip=wave'")
    page.until("gsac.clock > 0.1")
    click(page, "pause")
    clock = page.run("gsac.clock")
    page.run("new Promise((done) => setTimeout(done, 300))")
    assert page.run("gsac.clock") == clock and page.run("document.getElementById('pause').textContent") == "Play"
    slide(page, "Place in the motion", 0.75)
    assert page.run("gsac.clock") == pytest.approx(0.75 * page.run("gsac.length"), abs=0.01)
    click(page, "pause")
    page.until(f"gsac.clock !== {page.run('gsac.clock')}")
    page.run("location.hash = 'pose=A'")
    page.until("document.getElementById('timeline').hidden")


def test_the_page_opens_on_a_slow_turn_in_a_pose_until_something_is_picked(page, address):
    page.call("Page.navigate", url="about:blank")
    page.open(address)
    assert page.run("gsac.playing") == {"pose": "A"}
    page.until("gsac.camera.yaw > 3")
    page.run("document.querySelector('[data-clip=walk]').click()")
    page.until("!gsac.turntable && Math.abs(gsac.camera.place()[5]) < 1e-3")
    assert page.run("gsac.camera.yaw") == 0, "the walk is seen from the front"
    for words in ("pose=T", "clip=walk", "yaw=0", "still", "turntable=off"):
        page.run(f"location.hash = '{words}'")
        page.until("!gsac.turntable")
        page.run("location.hash = ''")
        page.until("gsac.turntable")
    page.run("location.hash = 'clip=wave&turntable'")
    page.until("gsac.playing.clip === 'wave'")
    page.run("document.querySelector('[data-clip=walk]').click()")
    assert page.run("gsac.turntable"), "it was asked to turn"


PLACES = """JSON.stringify([...document.querySelectorAll('#panel button, #top button')].filter((b) => b.offsetParent)
  .map((b) => [b.textContent, b.getBoundingClientRect().left, b.getBoundingClientRect().top]))"""


def press(page, key, **more):
    page.run("document.activeElement.blur()")
    page.call("Input.dispatchKeyEvent", type="keyDown", key=key, text=key if len(key) == 1 else "", **more)
    page.call("Input.dispatchKeyEvent", type="keyUp", key=key, **more)


def test_no_button_moves_under_the_pointer_when_another_is_pressed(page):
    for size in ((1440, 900), (390, 844)):
        page.resize(*size)
        page.run(f"document.body.classList.remove('folded'); location.hash = 'clip=walk&{size[0]}'")
        page.until("gsac.playing.clip === 'walk'")
        places = page.run(PLACES)
        for press_it in ("[data-pose=A]", "[data-clip=wave]", "#light", "#turntable", "#pause", "#pause", "#light"):
            page.run(f"document.querySelector('{press_it}').click()")
            assert page.run(PLACES).replace("Play", "Pause") == places, press_it
    page.resize(SIZE, SIZE)


def test_the_page_is_named_after_the_folder_it_lies_in(page, figure, tmp_path):
    for folder, name in (("Ada & Co-avatar/export", "Ada & Co"), ("me", "me"), ("0123456789abcdef0123456789abcdef", "GSAC avatar")):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "viewer.html").write_bytes(page_bytes(avatar_bytes(figure)))
        page.open((tmp_path / folder / "viewer.html").as_uri())
        assert page.run("document.getElementById('name').textContent") == name
        assert page.run("document.title") == (name if name == "GSAC avatar" else f"{name} · GSAC avatar")


def test_the_keys_turn_zoom_pause_and_tell_themselves(page, address):
    page.open(address + "#pose=A&keys")
    press(page, "ArrowRight")
    assert page.run("gsac.camera.yaw") == pytest.approx(10)
    press(page, "ArrowUp")
    assert page.run("gsac.camera.pitch") == pytest.approx(14)
    far = page.run("gsac.camera.distance")
    press(page, "+")
    assert page.run("gsac.camera.distance") == pytest.approx(0.9 * far)
    press(page, "-")
    assert page.run("gsac.camera.distance") == pytest.approx(far)
    press(page, "r")
    assert page.run("gsac.camera.yaw") == 0
    page.run("document.querySelector('[data-clip=walk]').click()")
    press(page, " ")
    assert page.run("gsac.paused")
    press(page, "f")
    page.until("document.fullscreenElement !== null")
    press(page, "F")
    page.until("document.fullscreenElement === null")
    press(page, "?")
    assert page.run("document.getElementById('help').open")
    page.run("document.querySelector('#help button').click()")
    assert not page.run("document.getElementById('help').open")
    page.run("document.body.classList.remove('folded')")  # a small frame folds the slider away
    before = page.run("document.getElementById('time').focus(), document.getElementById('time').value")
    assert page.run("document.activeElement.id") == "time"
    page.call("Input.dispatchKeyEvent", type="rawKeyDown", key="ArrowRight", code="ArrowRight", windowsVirtualKeyCode=39)
    page.until(f"document.getElementById('time').value !== '{before}'")
    assert page.run("gsac.camera.yaw") == 0, "a slider that has the focus keeps its keys"
    assert page.errors == []


def test_a_click_on_a_limb_opens_its_joint_and_a_drag_or_a_click_beside_does_not(page, address):
    page.open(address + "#pose=T&limb")
    expose(page, "pickJoint")
    assert page.run("pickJoint(gsac, 3, 3)") is None

    def mouse(kind, x, y):
        page.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)
    mouse("mousePressed", 5, 200)
    mouse("mouseReleased", 5, 200)
    page.run("new Promise((done) => setTimeout(done, 400))")
    assert page.run("document.getElementById('joints').hidden")
    place = page.run("""(() => {
      const { view, focal, centre } = gsac.camera.eye(gsac.canvas.width, gsac.canvas.height);
      const j = gsac.avatar.names.indexOf('right_knee'), p = gsac.avatar.joints.subarray(3 * j, 3 * j + 3);
      const c = [0, 4, 8].map((r) => view[r] * p[0] + view[r + 1] * p[1] + view[r + 2] * p[2] + view[r + 3]);
      return [focal[0] * c[0] / c[2] + centre[0] + SIZE / 2, focal[1] * c[1] / c[2] + centre[1] + SIZE / 2];
    })()""".replace("SIZE", str(SIZE)))
    mouse("mousePressed", *place)
    mouse("mouseMoved", place[0] + 30, place[1])
    mouse("mouseReleased", place[0] + 30, place[1])
    page.run("new Promise((done) => setTimeout(done, 400))")
    assert page.run("document.getElementById('joints').hidden") and page.run("gsac.camera.yaw") != 0
    page.run("gsac.camera.yaw = 0")
    mouse("mousePressed", *place)
    mouse("mouseReleased", *place)
    page.until("document.getElementById('joints').hidden === false")
    assert page.run("document.getElementById('joint').value") == "right_knee"
    page.run("document.querySelector('#joints .close').click()")
    assert page.run("document.getElementById('joints').hidden") and page.errors == []


def test_a_link_shows_what_is_seen_and_the_avatar_is_saved_as_its_own_file(page, address, figure):
    page.open(address + "#clip=walk&t=0.3&yaw=35&bg=203040&joints=head:0,20,0&expression=jawOpen:0.5&light=off&share")
    page.run("gsac.paused = true")
    page.run("Object.defineProperty(navigator, 'clipboard', { value: { writeText: async (text) => { window.link = text; } } })")
    click(page, "share")
    page.until("document.getElementById('note').textContent.includes('clipboard')")
    link = page.run("link")
    for words in ("clip=walk", "t=0.", "yaw=35", "bg=203040", "joints=head:0,20,0", "expression=jawOpen:0.5", "light=off"):
        assert words in link
    state = "JSON.stringify([gsac.playing, gsac.camera.yaw, gsac.background, gsac.turned, gsac.expression, gsac.levels.lit])"
    before = page.run(state)
    page.open(link)
    assert page.run(state) == before
    page.run("URL.createObjectURL = (blob) => { window.saved = blob; return 'data:,'; };"
             "HTMLAnchorElement.prototype.click = function () { window.savedName = this.download; }")
    click(page, "save")
    data = page.run("saved.arrayBuffer().then((b) => btoa([...new Uint8Array(b)].map((c) => String.fromCharCode(c)).join('')))")
    assert base64.b64decode(data) == avatar_bytes(figure) and page.run("savedName").endswith(".gsac")


def test_on_a_phone_all_but_the_motions_folds_away(page, address):
    page.resize(390, 844, 1, True)
    page.call("Emulation.setTouchEmulationEnabled", enabled=True)
    page.call("Page.navigate", url="about:blank")
    page.open(address + "#pose=A&fold")
    top = "document.getElementById('panel').getBoundingClientRect().top"
    assert page.run(top) > 0.85 * 844 and page.run("document.getElementById('tools').offsetParent") is None
    click(page, "fold")
    assert page.run(top) < 0.8 * 844 and page.run("document.getElementById('fold').textContent") == "Fewer controls"
    page.call("Emulation.setTouchEmulationEnabled", enabled=False)
    page.resize(SIZE, SIZE)
    page.call("Page.navigate", url="about:blank")
    page.open(address)


def test_the_rate_is_frames_over_time_and_the_95th_slowest_frame(page):
    expose(page, "FrameRate")
    told = page.run("""(() => {
      const rate = new FrameRate(), told = [];
      let now = 1000;
      for (let i = 0; i < 100; i++) { now += i % 20 === 7 ? 60 : 10; told.push(rate.frame(now)); }
      return told.filter(Boolean).at(-1);
    })()""")
    assert 70 < told["fps"] < 90 and told["p95"] == 10
    text = "document.getElementById('fps').textContent"
    page.until(f"{text}.includes('p95')")
    assert "gaussians" in page.run(text)


def test_a_picture_is_the_canvas_as_png(page):
    page.run("location.hash = 'pose=A&yaw=20&bg=3a6080'")
    page.until("gsac.playing.pose === 'A' && gsac.fade === 1")
    page.run("window.saved = null; URL.createObjectURL = (blob) => { window.saved = blob; return 'data:,'; };"
             "HTMLAnchorElement.prototype.click = function () { window.savedName = this.download; }")
    click(page, "picture")
    page.until("window.saved instanceof Blob")
    data = page.run("saved.arrayBuffer().then((b) => btoa(String.fromCharCode(...new Uint8Array(b))))")
    image = cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1]
    name = page.run("document.getElementById('name').textContent")
    assert page.run("savedName") == f"{name} A-pose.png" and image.shape == (SIZE, SIZE, 3)
    assert np.abs(image[3, 3].astype(int) - (0x3A, 0x60, 0x80)).max() <= 1 and red(image).any()


def test_a_picture_that_the_browser_does_not_give_is_said(page):
    page.run("{ const { canvas } = gsac; canvas.toBlob = (done) => { delete canvas.toBlob; done(null); }; }")
    click(page, "picture")
    page.until("document.getElementById('note').textContent === 'the browser gave no picture'")
    page.run("document.getElementById('note').hidden = true")


def test_another_size_of_the_page_frames_the_figure_again_unless_it_was_moved_by_hand(page):
    page.resize(700, 700)
    page.run("location.hash = 'pose=T&again'")
    page.until("gsac.playing.pose === 'T' && !gsac.camera.moved && gsac.canvas.width === 700")
    wide = page.run("gsac.camera.distance")
    page.resize(320, 700)
    page.until("gsac.canvas.width === 320")
    assert page.run("gsac.camera.distance") > 1.2 * wide
    page.call("Input.dispatchMouseEvent", type="mouseWheel", x=100, y=100, deltaX=0, deltaY=-100)
    page.until("gsac.camera.moved")
    near = page.run("gsac.camera.distance")
    page.resize(SIZE, SIZE)
    page.until(f"gsac.canvas.width === {SIZE}")
    assert page.run("gsac.camera.distance") == near
    assert page.errors == []


def test_a_figure_at_rest_is_drawn_once_and_again_after_each_change(page):
    page.run("location.hash = 'pose=A&rest'")
    page.until("gsac.playing.pose === 'A' && gsac.fade === 1")
    page.run("(() => { const draw = gsac.draw.bind(gsac); gsac.draw = () => { draw(); window.drawn++; }; })()")
    soon = "new Promise((done) => setTimeout(done, 250))"
    page.run(soon)
    for change in ("expression = { jawOpen: 1 }", "turned = { left_elbow: [0, -40, 0] }", "background = '#102030'",
                   "camera.yaw += 10", "camera.zoom(0.9)", "levels.lit = !gsac.levels.lit", "choose({ pose: 'T' })"):
        page.until("(() => { const now = gsac.state, still = window.before === now; window.before = now; return still; })()")
        page.run("window.drawn = 0")
        page.run(soon)
        assert page.run("window.drawn") == 0, "nothing changes"
        page.run(f"gsac.{change}")
        page.until("window.drawn > 0")
    page.run("delete gsac.draw")
    assert page.errors == []


def test_a_motion_that_leaps_stays_in_the_picture_unless_the_camera_was_moved_by_hand(page):
    page.run("location.hash = 'pose=A&leap'")
    page.until("gsac.playing.pose === 'A' && !gsac.camera.moved")
    near = page.run("gsac.camera.distance")
    page.run("""(() => {
      const rotation = new Float32Array(3 * 3), transl = Float32Array.from([0, 0, 0, 0, 0.9, 0, 3, 0, 0]);
      gsac.avatar.clips.leap = { fps: 2, loop: false, joints: [0], keys: 3, rotation, transl };
      gsac.choose({ clip: 'leap' });
      gsac.seek(0.5);
      gsac.paused = true;
      gsac.step(5);
    })()""")
    expose(page, "bounds")
    tops = page.run("""[0, 1].map((k) => {
      if (k) gsac.camera.distance = %s;
      const { view, focal, centre } = gsac.camera.eye(SIZE, SIZE), p = [0, bounds(gsac.skin.vertices)[1][1], 0];
      const c = [4, 8].map((r) => view[r] * p[0] + view[r + 1] * p[1] + view[r + 2] * p[2] + view[r + 3]);
      return focal[1] * c[0] / c[1] + centre[1] + SIZE / 2;
    })""".replace("SIZE", str(SIZE)) % near)
    assert tops[0] > 0 > tops[1], "as near as for a pose it would leave the picture"
    page.run("gsac.camera.moved = true; gsac.camera.distance = 2; gsac.choose({ pose: 'T' })")
    assert page.run("gsac.camera.distance") == 2 and page.errors == []
    page.run("delete gsac.avatar.clips.leap")


def test_the_camera_glides_to_another_clips_place_and_does_not_jump(page):
    page.run("location.hash = 'pose=A&glide'")
    page.until("gsac.playing.pose === 'A' && !gsac.camera.moved && gsac.fade === 1")
    ways = page.run("""(() => {
      const rotation = new Float32Array(3 * 3), transl = Float32Array.from([0, 0, 0, 0, 0.9, 0, 3, 0, 0]), { camera } = gsac;
      gsac.avatar.clips.leap = { fps: 2, loop: false, joints: [0], keys: 3, rotation, transl };
      gsac.paused = true;
      const seen = [camera.place()[4]];
      gsac.choose({ clip: 'leap' });
      seen.push(camera.place()[4]);
      for (let n = 0; n < 200; n++) {
        gsac.step(1 / 60);
        seen.push(camera.place()[4]);
      }
      return [seen, camera.distance];
    })()""")
    distances, goal = np.array(ways[0]), ways[1]
    assert goal > 1.2 * distances[0] and distances[1] == pytest.approx(distances[0])
    assert distances[-1] == goal and np.diff(distances).max() < 0.1 * (goal - distances[0])
    page.run("gsac.paused = false; gsac.choose({ pose: 'T' }); delete gsac.avatar.clips.leap")
    assert page.errors == []


def test_the_open_drawer_leaves_the_buttons_free(page):
    for size in (SIZE, 1100):
        page.resize(size, 700)
        page.run("document.getElementById('faces').hidden = false; for (let i = 0; i < 40; i++)"
                 "document.getElementById('face-rows').append(document.querySelector('#face-rows .row').cloneNode(true))")
        page.until(f"gsac.canvas.clientWidth === {size} && parseInt(getComputedStyle(document.documentElement)"
                   ".getPropertyValue('--panel')) > 0")
        page.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        bottom, top = page.run("[document.getElementById('faces').getBoundingClientRect().bottom,"
                               "document.getElementById('poses').getBoundingClientRect().top]")
        assert bottom <= top
    page.run("document.getElementById('faces').hidden = true;"
             "document.querySelectorAll('#face-rows .row').forEach((row, i) => i > 1 && row.remove())")
    page.resize(SIZE, SIZE)


def test_on_a_phone_the_open_drawer_is_inside_the_screen_and_leaves_room_for_the_figure(page):
    page.resize(390, 844, 1, True)
    page.run("location.hash = 'pose=A&phone'")
    click(page, "show-faces")
    page.until("gsac.canvas.width === 390")
    page.run("new Promise((done) => setTimeout(done, 300))")
    box = page.run("(({left, top, right, bottom}) => [left, top, right, bottom])"
                   "(document.getElementById('faces').getBoundingClientRect())")
    assert box[0] >= 0 and box[2] <= 390 and box[3] <= 844 and box[1] > 300
    small = page.run("[...document.querySelectorAll('button')].filter((b) => b.offsetParent)"
                     ".map((b) => b.getBoundingClientRect().height)")
    assert min(small) >= 34, "a finger hits it"
    assert page.run("document.documentElement.scrollWidth") <= 390
    click(page, "show-faces")
    page.resize(SIZE, SIZE)


def test_no_headset_no_button_and_each_eye_sees_the_avatar_from_its_place(address):
    page = chromium.Browser(SIZE, SIZE)
    try:
        page.open(address)
        assert page.run("document.getElementById('xr-vr')") is None
        page.call("Page.addScriptToEvaluateOnNewDocument", source=HEADSET)
        page.open(address + "?headset#pose=T&bg=204060&draw=webgl")
        assert page.run("document.getElementById('xr-ar')") is None
        click(page, "xr-vr")
        page.until("gsac.session !== null && Headset.session.next instanceof Function")
        assert page.run("document.getElementById('xr-vr').getAttribute('aria-pressed')") == "true"
        half = SIZE // 2
        f = 1.2
        eye = [f, 0, 0, 0, 0, f * half / SIZE, 0, 0, 0, 0, -1, -1, 0, 0, -0.1, 0]
        shifted = list(eye)
        shifted[8] = 0.25
        seen = []
        for second in (eye, shifted):
            page.run(f"Headset.at(0, 1.0, 0, [{{x: 0, y: 0, width: {half}, height: {SIZE}}},"
                     f"{{x: {half}, y: 0, width: {half}, height: {SIZE}}}], [{eye}, {second}])")
            page.run("Headset.session.show(), Headset.session.show()")
            page.run("document.body.classList.add('bare')")
            seen.append(page.picture().astype(int))
        for picture in seen:
            assert np.abs(picture[2, [2, half + 2]] - (0x20, 0x40, 0x60)).max() <= 1
        body = [np.abs(p - (0x20, 0x40, 0x60)).max(-1) > 30 for p in seen]
        left, right = (np.flatnonzero(body[0][:, s].any(0)).mean() for s in (slice(0, half), slice(half, SIZE)))
        assert left - right == pytest.approx(0.4 / 1.6 * f * half / 2, abs=4), "from the left eye it is further right"
        moved = np.flatnonzero(body[1][:, half:].any(0)).mean() - right
        assert moved == pytest.approx(-0.25 * half / 2, abs=6), "the axis of a projection off its middle"
        assert red(seen[0])[:, :half].any() and np.nonzero(red(seen[0])[:, :half])[1].mean() > left, "its left hand at our right"
        rows = np.flatnonzero(body[0][:, :half].any(1))
        assert rows.max() < SIZE - 5 and rows.min() > 5
        page.run("Headset.session.end()")
        page.until("gsac.session === null && gsac.clock >= 0")
        assert page.errors == []
    finally:
        page.close()


def test_where_the_page_draws_without_webgl_the_headset_gets_one_of_its_own(address):
    page = chromium.Browser(SIZE, SIZE)
    try:
        page.call("Page.addScriptToEvaluateOnNewDocument", source=HEADSET)
        page.open(address + "?own#pose=T&bg=204060&draw=software")
        click(page, "xr-vr")
        page.until("gsac.session !== null && Headset.session.next instanceof Function")
        eye = [1.2, 0, 0, 0, 0, 1.2, 0, 0, 0, 0, -1, -1, 0, 0, -0.1, 0]
        page.run(f"Headset.at(0, 1.0, 0, [{{x: 0, y: 0, width: 150, height: 150}}], [{eye}])")
        pixels = np.array(page.run("""(() => {
          Headset.session.show();
          const { gl } = gsac.headset, pixels = new Uint8Array(150 * 150 * 4);
          gl.readPixels(0, 0, 150, 150, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
          return Array.from(pixels);
        })()""")).reshape(150, 150, 4)[..., :3]
        assert np.abs(pixels[2, 2] - (0x20, 0x40, 0x60)).max() <= 1 and red(pixels).any()
        page.run("Headset.session.end()")
        page.until("gsac.session === null")
        assert page.errors == []
    finally:
        page.close()


def test_a_headset_that_cannot_be_drawn_is_left_again_and_it_is_said(address):
    page = chromium.Browser(SIZE, SIZE)
    try:
        page.call("Page.addScriptToEvaluateOnNewDocument", source=HEADSET)
        page.open(address + "?none#pose=T&draw=software")
        page.run("HTMLCanvasElement.prototype.getContext = () => null")
        click(page, "xr-vr")
        page.until("document.getElementById('note').textContent.startsWith('VR did not start: this browser offers no WebGL2')")
        assert page.run("[Headset.session.ended, gsac.session]") == [True, None]
        assert page.errors == []
    finally:
        page.close()


@pytest.mark.parametrize("place", [
    "yaw=20&pitch=12", "yaw=-70&pitch=30&dist=1.4&target=0,-0.8,0", "yaw=0&pitch=40&dist=0.9&target=0,-1,0.5"])
def test_without_a_graphics_card_the_picture_and_its_shadow_are_the_same(page, address, shadowed, place):
    seen = []
    for draw in ("webgl", "software"):
        page.call("Page.navigate", url="about:blank")
        page.open(f"{address}#pose=A&bg=a0b0c0&draw={draw}&{place}")
        page.run(shadowed)
        page.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        seen.append(page.picture().astype(int))
    webgl, software = seen
    assert np.abs(webgl - software).max() <= 4 and np.abs(webgl - software).mean() < 0.5
    grey = webgl[..., 0] * (0xC0 / 0xA0) - webgl[..., 2]
    assert ((np.abs(grey) < 3) & (webgl[..., 2] < 0xC0 - 20)).sum() > 100, "a part of the floor is in the shadow"
    assert page.errors == []


def test_a_device_without_webgl_draws_by_itself(address):
    page = chromium.Browser(SIZE, SIZE)
    try:
        none = "HTMLCanvasElement.prototype.getContext = ((get) => function (kind, ...rest) {" \
               "return kind === 'webgl2' ? null : get.call(this, kind, ...rest); })(HTMLCanvasElement.prototype.getContext)"
        page.call("Page.addScriptToEvaluateOnNewDocument", source=none)
        page.open(address + "#pose=A&still")
        assert red(page.picture()).any() and page.errors == []
    finally:
        page.close()
