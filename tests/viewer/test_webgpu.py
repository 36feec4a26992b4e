"""viewer.html on WebGPU: its shaders are Unity's, it is taken where there is a graphics card, and what stops is followed up."""

import re
import shutil

import numpy as np
import pytest

from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.benchmarks.viewer import browser as chromium
from gsac.viewer import wgsl
from gsac.viewer.page import page_bytes

SIZE = 300
needs_chromium = pytest.mark.skipif(chromium.find_chromium() is None, reason="needs the Debian package chromium")
CARD = """(() => {
  if (!window.GPUAdapter) return;
  const info = Object.getOwnPropertyDescriptor(GPUAdapter.prototype, 'info').get;
  Object.defineProperty(GPUAdapter.prototype, 'info', { get() { info.call(this); return { vendor: 'acme', architecture: 'one',
    description: 'a card', isFallbackAdapter: false }; } });
})()"""
"""Makes the software adapter say that it is a graphics card."""


def test_the_shaders_are_of_the_present_hlsl():
    assert wgsl.hash_sources() in wgsl.WRITTEN.read_text(), "run `make shaders`"


@pytest.mark.slow
def test_the_hlsl_gives_these_very_shaders(node_package):
    if not shutil.which("glslangValidator"):
        pytest.skip("needs the Debian package glslang-tools")
    written = wgsl.WRITTEN.read_text()
    if f"glslang {wgsl.glslang_version()}," not in written:
        pytest.skip("shaders.js was written with another version of glslang")
    assert wgsl.format_script(wgsl.translate(node_package(wgsl.NAGA) / "node_modules")) == written


@pytest.mark.slow
def test_the_other_browsers_compiler_takes_them_too():
    """naga, which Firefox has; chromium has tint."""
    wgpu = pytest.importorskip("wgpu", reason="needs the package wgpu (pip install gsac[dev])")
    adapters = wgpu.gpu.enumerate_adapters_sync()
    if not adapters:
        pytest.skip("needs a Vulkan device (Debian package mesa-vulkan-drivers)")
    device = adapters[0].request_device_sync()
    shaders = re.findall(r"^  (\w+): \{ bindings.*?code: `\n(.*?)` \},$", wgsl.WRITTEN.read_text(), re.DOTALL | re.MULTILINE)
    assert [entry for entry, _ in shaders] == list(wgsl.ENTRIES)
    for entry, code in shaders:
        module = device.create_shader_module(code=code)
        if wgsl.ENTRIES[entry] == "comp":
            device.create_compute_pipeline(layout="auto", compute={"module": module, "entry_point": entry})


def test_parameters_stand_where_wgsl_lays_them():
    text = "struct P {\n a: u32,\n b: vec2<f32>,\n c1_: vec4<f32>,\n}\n@group(0) @binding(3) \nvar<uniform> unnamed: P;\n" \
           "@group(0) @binding(1) \nvar<storage, read_write> Keys_1: Keys;"
    assert wgsl.parse_places(text) == ({"parameters": 3, "Keys": 1}, {"a": 0, "b": 8, "c1": 16})


@pytest.fixture(scope="module")
def page():
    it = chromium.Browser(SIZE, SIZE, chromium.WEBGPU)
    yield it
    it.close()


@pytest.fixture(scope="module")
def address(figure, tmp_path_factory):
    path = tmp_path_factory.mktemp("gpu") / "viewer.html"
    path.write_bytes(page_bytes(avatar_bytes(figure)))
    return path.as_uri()


def picture(page, script):
    page.run(script)
    page.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert page.errors == []
    return page.picture().astype(int)


@needs_chromium
@pytest.mark.slow
def test_a_software_adapter_is_left_alone(page, address):
    page.open(f"{address}#pose=A")
    assert page.run("gsac.renderer.kind") == "software" and page.errors == []


@needs_chromium
@pytest.mark.slow
def test_what_stops_is_followed_by_the_next_way_with_the_same_picture(page, address, shadowed):
    got = page.call("Page.addScriptToEvaluateOnNewDocument", source=CARD)
    try:
        page.open(f"{address}?card#pose=A&bg=a0b0c0&yaw=20&pitch=12&joints=left_elbow:0,-40,0&expression=jawOpen:1")
        if not page.has_webgpu():
            pytest.skip("this chromium has no WebGPU")
        assert page.run("gsac.renderer.kind") == "webgpu", "a card is taken"
        seen = [picture(page, shadowed)]
        for stop, kind in (("gsac.renderer.device.destroy()", "webgl"),
                           ("gsac.renderer.gl.getExtension('WEBGL_lose_context').loseContext()", "software")):
            page.run(stop)
            page.until(f"gsac.renderer?.kind === '{kind}'")
            page.until("/now drawn/.test(document.getElementById('note').textContent)")
            seen.append(picture(page, shadowed))
        for other in seen[1:]:
            assert np.abs(seen[0] - other).max() <= 12 and np.abs(seen[0] - other).mean() < 0.5
        assert (np.abs(seen[0] - (0xA0, 0xB0, 0xC0)).max(-1) > 20).mean() > 0.03
    finally:
        page.call("Page.removeScriptToEvaluateOnNewDocument", identifier=got["identifier"])


@needs_chromium
@pytest.mark.slow
def test_a_webgpu_that_does_not_begin_gives_the_card_back(page, address):
    stops = "GPUDevice.prototype.createComputePipelineAsync = async () => { throw new Error('no such thing'); };" \
            "window.back = 0; GPUDevice.prototype.destroy = () => { back += 1; };"
    got = page.call("Page.addScriptToEvaluateOnNewDocument", source=f"if (window.GPU) {{ {CARD}; {stops} }}")
    try:
        page.open(f"{address}?back#pose=A&still")
        if not page.has_webgpu():
            pytest.skip("this chromium has no WebGPU")
        assert page.run("back") == 1 and page.errors == []
    finally:
        page.call("Page.removeScriptToEvaluateOnNewDocument", identifier=got["identifier"])


@needs_chromium
@pytest.mark.slow
@pytest.mark.parametrize("broken", [
    "GPUDevice.prototype.createComputePipelineAsync = async () => { throw new Error('no such thing'); }",
    "GPUAdapter.prototype.requestDevice = async () => { throw new Error('no device'); }",
    "GPU.prototype.requestAdapter = async () => null"])
def test_a_webgpu_that_does_not_begin_makes_room_for_webgl(page, address, broken):
    card = "HTMLCanvasElement.prototype.getContext = ((get) => function (...asked) { const gl = get.apply(this, asked);" \
              "if (asked[0] === 'webgl2') gl.getParameter = () => 'a card'; return gl; })(HTMLCanvasElement.prototype.getContext);"
    got = page.call("Page.addScriptToEvaluateOnNewDocument", source=f"if (window.GPU) {{ {CARD}; {broken}; }} {card}")
    try:
        page.open(f"{address}?{len(broken)}#pose=A&bg=a0b0c0&still")
        assert page.run("gsac.renderer.kind") == "webgl"
        assert (np.abs(page.picture().astype(int) - (0xA0, 0xB0, 0xC0)).max(-1) > 20).mean() > 0.03 and page.errors == []
    finally:
        page.call("Page.removeScriptToEvaluateOnNewDocument", identifier=got["identifier"])


@needs_chromium
@pytest.mark.slow
def test_the_correctives_of_a_bent_elbow_are_drawn_alike_with_and_without_a_graphics_card(page, bent_arm, tmp_path, shadowed):
    avatar, place = RiggedAvatar.read(bent_arm.file), "pose=A&bg=a0b0c0&dist=1.6&joints=left_elbow:0,-103,0;left_knee:90,0,0"
    avatar.gaussians.rgb = np.random.default_rng(0).random(avatar.gaussians.rgb.shape).astype(np.float32)
    avatar.correctives.delta = 3 * avatar.correctives.delta
    (tmp_path / "bent.html").write_bytes(page_bytes(avatar_bytes(avatar)))
    avatar.correctives = None
    (tmp_path / "plain.html").write_bytes(page_bytes(avatar_bytes(avatar)))
    seen = {}
    for name in ("bent", "plain"):
        for kind in ("webgpu", "webgl", "software"):
            page.open(f"{(tmp_path / name).as_uri()}.html?{kind}#draw={kind}&{place}")
            if kind == "webgpu" and not page.has_webgpu():
                pytest.skip("this chromium has no WebGPU")
            assert page.run("gsac.renderer.kind") == kind
            seen[name, kind] = picture(page, shadowed)

    def off(one, other):
        return np.abs(seen[one] - seen[other]).mean()

    for kind in ("webgl", "software"):
        assert off(("bent", "webgpu"), ("bent", kind)) < 1.5 * off(("plain", "webgpu"), ("plain", kind)) + 0.1
    assert off(("bent", "webgpu"), ("plain", "webgpu")) > 0.7, "they are seen"
