"""viewer.html in headless Chromium with software GL: what it shows is what the trainer's renderer gives."""

import base64
import math

import numpy as np
import pytest

from gsac.avatar.body import Body, BodyParams
from gsac.avatar.camera import Camera
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.avatar.raster import render_bound
from gsac.benchmarks.viewer import browser as chromium
from gsac.stages.export.animations import add_motion
from gsac.stages.export.stage import rig_avatar
from gsac.viewer.page import page_bytes
from support.page_modules import expose

pytestmark = [pytest.mark.slow,
              pytest.mark.skipif(chromium.find_chromium() is None, reason="needs the Debian package chromium")]
SIZE, FOV, BACKGROUND = 512, 30, (0x3A, 0x60, 0x80)


@pytest.fixture(scope="module")
def browser():
    it = chromium.Browser(SIZE, SIZE, chromium.WEBGPU)
    yield it
    it.close()


@pytest.fixture(scope="module", params=["webgpu", "webgl", "software"])
def page(request, browser, exported):
    """The page drawn by WebGPU, by WebGL2 and by its own software."""
    browser.call("Page.navigate", url="about:blank")
    browser.requests.clear()
    browser.open(f"{(exported / 'viewer.html').as_uri()}#draw={request.param}")
    if request.param == "webgpu" and not browser.has_webgpu():
        pytest.skip("this chromium has no WebGPU")
    assert browser.run("gsac.renderer.kind") == request.param
    return browser


@pytest.fixture(scope="module")
def trained(person):
    """The avatar before it was quantised for the container."""
    avatar = rig_avatar(Body.load(), BodyParams.read(person["train/body.npz"]), Gaussians.read(person["train/avatar.npz"]))
    add_motion(avatar, ("wave", "walk"))
    return avatar


def show(page, words):
    """Picture of a fixed frame, (H, W, 3) in 0..1."""
    page.run(f"location.hash = '{words}&still'")
    page.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert page.errors == []
    return page.picture() / 255


def expected(avatar, vertices, yaw, pitch, distance, target):
    y, p = math.radians(yaw), math.radians(pitch)
    back = np.array([math.sin(y) * math.cos(p), math.sin(p), math.cos(y) * math.cos(p)])
    right = np.array([math.cos(y), 0, -math.sin(y)])
    R = np.stack([right, np.cross(-back, right), -back])
    eye = np.array(target) + distance * back
    f = SIZE / 2 / math.tan(math.radians(FOV / 2))
    out = render_bound(((vertices - eye) @ R.T).astype(np.float32), avatar.faces, avatar.gaussians,
                       Camera((f, f), (SIZE / 2, SIZE / 2), SIZE, SIZE))
    image = out.rgb + (1 - out.alpha[..., None]) * np.array(BACKGROUND) / 255
    return np.clip(image, 0, 1), out.alpha > 0.02


def psnr(a, b):
    return -10 * math.log10(max(((a - b) ** 2).mean(), 1e-12))


@pytest.mark.parametrize(("play", "yaw", "pitch", "distance", "target"), [
    ("pose=T", 0, 0, 3.8, (0, 0, 0)), ("pose=A", 30, 10, 3.4, (0, 0, 0)), ("pose=A", 205, -8, 3.4, (0, 0, 0)),
    ("pose=T", -60, 15, 1.0, (0, .5, 0)), ("clip=wave&t=0.35", 15, 5, 3.4, (0, 0, 0)),
    ("clip=walk&t=0.6", 100, 0, 3.6, (0, 0, 0))])
def test_the_person_looks_as_the_trainers_renderer_shows(page, trained, play, yaw, pitch, distance, target):
    place = ",".join(map(str, target))
    got = show(page, f"{play}&yaw={yaw}&pitch={pitch}&dist={distance}&fov={FOV}&target={place}&bg=3a6080")
    pose, transl = trained.pose("A"), 0
    if play.startswith("pose"):
        pose = trained.pose(play[-1])
    else:
        name, t = play[5:].split("&t=")
        clip = trained.clips[name]
        key = round(float(t) * clip.fps)
        pose = np.zeros((55, 3), np.float32)
        pose[[trained.joint_names.index(j) for j in clip.joints]] = clip.rotation[key]
        transl = clip.transl[key]
    want, person = expected(trained, trained.posed(pose) + transl, yaw, pitch, distance, target)
    assert person.mean() > 0.03
    assert psnr(got[person], want[person]) >= 45
    assert np.abs(got[~person] - want[~person]).max() < 0.03


def test_an_expression_moves_the_face_as_the_body_does(page, trained, person):
    body, params = Body.load(), BodyParams.read(person["train/body.npz"])
    weights = np.zeros(52, np.float32)
    weights[body.expression_names.index("jawOpen")] = 1
    show(page, "pose=T&expression=jawOpen:1")
    got = np.array(page.run("Array.from(gsac.skin.vertices)")).reshape(-1, 3)
    want, _ = body.rest(params.betas, weights, params.joint_offset)
    assert np.linalg.norm(want - trained.vertices, axis=1).max() > 0.01
    assert np.linalg.norm(got - want, axis=1).max() < 3e-4


def test_the_left_hand_is_red_and_at_the_pictures_right(page):
    picture = show(page, "pose=T&yaw=0&pitch=0&bg=3a6080")
    red = (picture[..., 0] > 0.6) & (picture[..., 1] < 0.25) & (picture[..., 2] < 0.25)
    assert red.sum() > 50
    assert np.flatnonzero(red.any(0)).min() > SIZE * 0.6


def test_a_fixed_frame_is_the_same_picture_each_time(page):
    first = show(page, "clip=walk&t=0.4&yaw=20")
    show(page, "pose=A&yaw=120")
    np.testing.assert_array_equal(show(page, "clip=walk&t=0.4&yaw=20"), first)


def test_the_page_asks_for_nothing_but_itself(page, exported):
    assert set(page.requests) - {"data:,"} == {(exported / "viewer.html").as_uri()}


def test_it_plays_and_the_buttons_answer(page):
    page.run("location.hash = 'clip=walk'")
    page.until("gsac.clock > 0.2")
    page.until("document.getElementById('fps').textContent.includes('fps')")
    for text, playing in (("A-pose", {"pose": "A"}), ("T-pose", {"pose": "T"}), ("Wave", {"clip": "wave"})):
        page.run(f"[...document.querySelectorAll('#poses button')].find((b) => b.textContent === '{text}').click()")
        assert page.run("gsac.playing") == playing
        assert page.run("document.querySelector('#poses button[aria-pressed=true]').textContent") == text
    yaw = page.run("gsac.camera.yaw")
    page.run("document.getElementById('turntable').click()")
    page.until(f"gsac.camera.yaw > {yaw}")
    page.run("document.getElementById('reset').click()")
    page.run("document.getElementById('background').value = '#102030'")
    page.run("document.getElementById('background').dispatchEvent(new Event('input'))")
    page.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert np.abs(page.picture()[SIZE // 2, 3].astype(int) - (0x10, 0x20, 0x30)).max() <= 1
    assert page.errors == []


def test_on_a_phone_the_controls_are_inside_the_screen_below_the_feet_and_over_the_head(page):
    page.resize(390, 844, 2, True)
    page.run("location.hash = 'pose=A&x'")
    page.until("!gsac.still && gsac.playing.pose === 'A' && gsac.canvas.width === (gsac.renderer.kind === 'software' ? 390 : 780)")
    boxes = page.run("[...document.querySelectorAll('button, select, input')].filter((e) => e.offsetParent)"
                     ".map((e) => e.getBoundingClientRect()).map((r) => [r.left, r.top, r.right, r.bottom])")
    left, top, right, bottom = np.array(boxes).T
    assert left.min() >= 0 and right.max() <= 390 and bottom.max() <= 844
    view = np.array(page.run("Array.from(gsac.camera.view)")).reshape(3, 4)
    focal, covered = page.run("[gsac.camera.focal(844), gsac.camera.covered]")
    ends = [view @ (*page.run(f"[gsac.camera.target[0], gsac.{end}[1], 0]"), 1) for end in ("high", "low")]
    head, feet = (422 + focal * y / z - covered * 422 for _, y, z in ends)
    below = top > 422
    assert below.sum() > 5 and 422 < feet < top[below].min() and bottom[~below].max() < head
    page.resize(SIZE, SIZE)


def test_the_scripts_reader_names_what_is_wrong_with_a_file(page, figure):
    """The same faults as the Python reader, and never anything but a GsacError."""
    data = base64.b64encode(avatar_bytes(figure)).decode()
    expose(page, "readAvatar", "GsacError", "crc32")
    faults = page.run("const encoded = '" + data + "';" + """(() => {
      const whole = Uint8Array.from(atob(encoded), (c) => c.charCodeAt(0));
      const fault = (bytes) => {
        try { readAvatar(bytes.slice().buffer); return 'none'; }
        catch (e) { return e instanceof GsacError ? e.fault : 'crash: ' + e.stack; }
      };
      const seal = (bytes) => {
        new DataView(bytes.buffer).setUint32(24, crc32(bytes.subarray(32)), true);
        return bytes;
      };
      const changed = (at, value) => { const b = whole.slice(); b[at] = value; return b; };
      let seed = 1;
      const random = (n) => { seed = (seed * 48271) % 2147483647; return seed % n; };
      const fuzz = new Set();
      for (let i = 0; i < 400; i++) {
        const b = whole.slice();
        for (let k = 0; k <= random(4); k++) b[32 + random(6000)] = random(256);
        fuzz.add(fault(seal(b)));
      }
      return {
        whole: fault(whole), longer: fault(new Uint8Array([...whole, 0])), version: fault(changed(8, 9)),
        magic: fault(changed(0, 1)), flipped: fault(changed(whole.length - 5, whole[whole.length - 5] ^ 1)),
        head: fault(seal(changed(32, 0x78))),
        cut: [0, 4, 20, 40, 3000, whole.length - 1].map((n) => fault(whole.subarray(0, n))), fuzz: [...fuzz],
      };
    })()""")
    assert faults.pop("cut") == ["not_gsac"] + ["truncated"] * 5
    assert set(faults.pop("fuzz")) <= {"none", "head", "block", "value"}
    assert faults == {"whole": "none", "longer": "oversized", "version": "version", "magic": "not_gsac",
                      "flipped": "checksum", "head": "head"}


def test_a_damaged_avatar_gives_a_sentence_on_the_page(browser, figure, tmp_path):
    data = bytearray(avatar_bytes(figure))
    data[8] = 7
    (tmp_path / "viewer.html").write_bytes(page_bytes(bytes(data)))
    with pytest.raises(AssertionError, match="version"):
        browser.open((tmp_path / "viewer.html").as_uri())
    assert "version 7" in browser.run("document.getElementById('message').textContent")
