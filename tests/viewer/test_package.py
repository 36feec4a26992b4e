"""The npm package: the element in pages of others, and the object of three.js."""

import importlib.metadata
import json
import shutil
import subprocess
import time

import numpy as np
import pytest

from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.benchmarks.viewer import browser as chromium
from gsac.benchmarks.viewer.frame_rate import serve
from gsac.viewer.package import IMPORTED, main, package_files, write_package

NEEDS_BROWSER = pytest.mark.skipif(chromium.find_chromium() is None, reason="needs the Debian package chromium")
SIZE, THREE = 400, "three@0.180.0"
HOST = """<!doctype html><html lang="en"><head><title>A page of others</title><link rel="icon" href="data:,">
<style>body { margin: 0; background: #fff; } gsac-avatar { width: %spx; height: %spx; }</style></head>
<body><main><h1 style="position: absolute; left: 700px">Page</h1><gsac-avatar src="avatar.gsac" %s></gsac-avatar></main>
<script type="module" src="gsac-avatar.js"></script><script type="module">
const it = document.querySelector("gsac-avatar");
window.told = [];
for (const event of ["load", "error", "note", "change", "pick", "end"]) {
  it.addEventListener(event, (e) => told.push([event, e.detail]));
}
window.it = it;
window.gsac = it.viewer;
</script></body></html>"""
SCENE = """<!doctype html><html lang="en"><head><title>three</title>
<link rel="icon" href="data:,"><style>body { margin: 0; }</style>
<script type="importmap">{"imports": {"three": "./node_modules/three/build/three.module.js"}}</script></head><body>
<script type="module">
import * as THREE from "three";
import { GsacObject } from "./three.js";
const renderer = new THREE.WebGLRenderer({ antialias: false });
renderer.setSize(400, 400);
document.body.append(renderer.domElement);
const scene = new THREE.Scene(), camera = new THREE.PerspectiveCamera(30, 1, 0.1, 100);
scene.background = new THREE.Color("#a0b0c0");
const avatar = new GsacObject(await (await fetch("avatar.gsac")).arrayBuffer());
scene.add(avatar);
const yaw = 20 * Math.PI / 180, pitch = 10 * Math.PI / 180, ground = avatar.ground;
camera.position.set(3.4 * Math.sin(yaw) * Math.cos(pitch), 3.4 * Math.sin(pitch) - ground, 3.4 * Math.cos(yaw) * Math.cos(pitch));
camera.lookAt(0, -ground, 0);
const wall = new THREE.Mesh(new THREE.PlaneGeometry(4, 4), new THREE.MeshBasicMaterial({ color: "#ff00ff" }));
wall.position.set(0, 0, 0.5);
wall.visible = false;
scene.add(wall);
window.show = (turn) => {
  avatar.play("wave");
  avatar.expression = { jawOpen: 1 };
  avatar.turned = { head: [0, 30, 0] };
  avatar.update(0.5);
  wall.visible = turn === "wall behind" || turn === "wall before";
  wall.position.z = turn === "wall before" ? 0.8 : -0.8;
  renderer.render(scene, camera);
};
document.documentElement.dataset.ready = "yes";
</script></body></html>"""


@pytest.fixture(scope="module")
def folder(figure, tmp_path_factory):
    """The package's files, an avatar, and pages that use them."""
    where = tmp_path_factory.mktemp("package")
    write_package(where)
    (where / "avatar.gsac").write_bytes(avatar_bytes(figure))
    (where / "poster.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg"/>')
    for width, height in ((300, 250), (480, 360)):
        (where / f"{width}.html").write_text(HOST % (width, height, 'controls clip="walk" poster="poster.svg" bg="304050"'))
    (where / "wrong.html").write_text(HOST.replace("avatar.gsac", "none.gsac") % (SIZE, SIZE, "controls"))
    return where


@pytest.fixture(scope="module")
def site(folder):
    with serve(folder) as address:
        yield address


@pytest.fixture(scope="module")
def page():
    it = chromium.Browser(800, 600)
    yield it
    it.close()


def show(page, address):
    page.call("Page.navigate", url="about:blank")
    page.requests.clear()
    page.call("Page.navigate", url=address)
    page.until("window.told?.some(([event]) => event === 'load')")


def key(page, name):
    for kind in ("keyDown", "keyUp"):
        page.call("Input.dispatchKeyEvent", type=kind, key=name, code=name, text=name if len(name) == 1 else "",
                  windowsVirtualKeyCode={"Tab": 9, "ArrowRight": 39}.get(name, 0))


def test_a_question_for_help_is_answered_and_makes_no_folder(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["package.py", "--help"])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 0 and "FOLDER" in capsys.readouterr().out and not list(tmp_path.iterdir())


def test_the_package_holds_every_module_that_it_imports_and_bears_the_programs_version():
    files = package_files()
    for name, content in files.items():
        assert {home for home in IMPORTED.findall(content.decode()) if name.endswith(".js")} <= set(files), name
    about = json.loads(files["package.json"])
    assert about["version"] == importlib.metadata.version("gsac") and about["license"] == "Apache-2.0"
    assert {about["main"], about["types"]} <= set(files)
    assert all(target.removeprefix("./") in files for each in about["exports"].values()
               for target in (each.values() if isinstance(each, dict) else [each]))
    assert not any("://" in content.decode() for name, content in files.items() if name.endswith(".js")), "it asks nobody"


@pytest.mark.slow
def test_npm_packs_it_and_a_server_may_read_it(folder):
    if not shutil.which("npm"):
        pytest.skip("needs npm (Debian package npm)")
    packed = subprocess.run(["npm", "pack", "--dry-run", "--json"], cwd=folder, capture_output=True, text=True, check=True)
    assert {"index.js", "element.js", "three.js", "gsac-avatar.js", "README.md"} <= {
        file["path"] for file in json.loads(packed.stdout)[0]["files"]}
    read = subprocess.run(["node", "-e", "import('./index.js').then((all) => console.log(Object.keys(all)))"], cwd=folder,
                          capture_output=True, text=True)
    assert read.stdout == "[ 'GsacAvatar' ]\n", read.stderr


@pytest.mark.slow
@NEEDS_BROWSER
@pytest.mark.parametrize(("width", "height"), [(300, 250), (480, 360)])
def test_in_a_page_of_others_the_person_stands_whole_above_the_bar_and_axe_finds_nothing(page, site, axe, width, height):
    show(page, f"{site}/{width}.html")
    assert set(page.requests) == {f"{site}/{name}" for name in (f"{width}.html", "gsac-avatar.js", "avatar.gsac", "poster.svg")}
    page.until("gsac.clock > 0.1")
    picture = page.picture().astype(int)[:height, :width]
    person = (np.abs(picture - (0x30, 0x40, 0x50)).max(-1) > 25)[: height - 50]
    rows, columns = np.flatnonzero(person.any(1)), np.flatnonzero(person.any(0))
    assert np.ptp(rows) > 0.6 * height and 2 < rows.min() < rows.max() < height - 52
    assert 5 < columns.min() < columns.max() < width - 5
    bar = page.run("(({top, left, right, bottom}) => [top, left, right, bottom])"
                   "(it.shadowRoot.getElementById('bar').getBoundingClientRect())")
    assert bar[0] >= height - 54 and bar[1] >= 0 and bar[2] <= width and bar[3] <= height
    assert axe(page) == [] and page.errors == []


@pytest.mark.slow
@NEEDS_BROWSER
def test_the_keyboard_alone_reaches_the_avatar_and_its_bar(page, site):
    show(page, f"{site}/480.html")
    reached = []
    for _ in range(7):
        key(page, "Tab")
        reached.append(page.run("it.shadowRoot.activeElement?.id ?? null"))
    assert reached[:6] == ["stage", "toggle", "motion", "time", "face", "full"]
    page.run("it.shadowRoot.getElementById('stage').focus()")
    key(page, "ArrowRight")
    assert page.run("gsac.camera.yaw") == 10
    key(page, " ")
    assert page.run("it.paused")


@pytest.mark.slow
@NEEDS_BROWSER
def test_methods_attributes_and_events_do_what_they_say(page, site):
    show(page, f"{site}/300.html")
    assert page.run("[it.clips, it.poses, it.expressions, it.joints.length]") == [
        ["wave", "walk"], ["A", "T"], ["jawOpen", "browInnerUp"], 55]
    page.run("it.pause(), it.currentTime = 0.5")
    assert page.run("[it.paused, it.currentTime, it.duration > 0.5]") == [True, 0.5, True]
    page.run("it.play('T'), it.express({ jawOpen: 0.5 }), it.turn({ head: [0, 20, 0] })")
    assert page.run("[gsac.playing, gsac.expression, gsac.turned]") == [{"pose": "T"}, {"jawOpen": 0.5}, {"head": [0, 20, 0]}]
    for wrong in ("it.play('dance')", "it.express({ jaw: 1 })", "it.turn({ head: [1] })", "it.look('tail')"):
        said = page.run(f"(() => {{ try {{ {wrong}; }} catch (error) {{ return error.message; }} }})()")
        assert said and ("expected" in said or "this avatar has" in said)
    assert "pose=T" in page.run("it.view") and "expression=jawOpen:0.5" in page.run("it.view")
    page.run("it.setAttribute('pose', 'A'), it.removeAttribute('clip'), it.setAttribute('yaw', '40')")
    assert page.run("[gsac.playing, gsac.camera.yaw]") == [{"pose": "A"}, 40]
    page.run("it.look('face')")
    assert page.run("gsac.near") == "face"
    page.run("it.setAttribute('yaw', 'abc')")
    assert "yaw=abc" in page.run("told.findLast(([event]) => event === 'note')[1]")
    png = page.run("it.picture().then((blob) => [blob.type, blob.size])")
    assert png[0] == "image/png" and png[1] > 2000
    page.run("it.play('wave'), document.body.append(it)")
    page.until("gsac.clock > 0.2")
    page.run("it.remove()")
    page.until("gsac.renderer === null")
    page.run("document.body.append(it)")
    page.until("gsac.renderer !== null && gsac.running !== null")
    assert page.errors == []


@pytest.mark.slow
@NEEDS_BROWSER
def test_a_film_is_a_video_of_the_time_that_was_asked_for(page, site):
    show(page, f"{site}/300.html")
    kind, size, seconds, width = page.run("""it.film(1).then(async (blob) => {
      const video = Object.assign(document.createElement("video"), { src: URL.createObjectURL(blob), muted: true });
      await new Promise((done, fail) => { video.onloadeddata = done; video.onerror = () => fail(video.error.message); });
      video.currentTime = 1e6;
      await new Promise((done) => { video.ontimeupdate = done; });
      return [blob.type, blob.size, video.currentTime, video.videoWidth];
    })""")
    assert kind == "video/webm" and size > 3000 and 0.5 < seconds < 2.5 and width == 300
    assert page.run("gsac.filmed") is False and page.errors == []


@pytest.mark.slow
@NEEDS_BROWSER
def test_a_file_that_is_not_there_is_said_in_the_element(page, site):
    page.call("Page.navigate", url=f"{site}/wrong.html")
    for _ in range(50):
        if page.run("window.it?.shadowRoot.getElementById('message').checkVisibility() ?? false"):
            break
        time.sleep(0.1)
    page.errors.clear()
    assert "404" in page.run("it.shadowRoot.getElementById('message').textContent")


@pytest.mark.slow
@NEEDS_BROWSER
def test_threes_scene_shows_what_the_element_shows_and_what_is_nearer_hides_it(folder, site, page, node_package):
    modules = node_package(THREE) / "node_modules"
    if not (folder / "node_modules").exists():
        (folder / "node_modules").symlink_to(modules)
    (folder / "scene.html").write_text(SCENE)
    look = "clip=wave&t=0.5&yaw=20&pitch=10&dist=3.4&target=0,0,0&expression=jawOpen&joints=head:0,30,0&draw=webgl".split("&")
    words = " ".join('{}="{}"'.format(*(each.split("=") + [""])[:2]) for each in look)
    (folder / "same.html").write_text(HOST % (SIZE, SIZE, words + " still bg=a0b0c0"))
    page.resize(SIZE, SIZE)
    show(page, f"{site}/same.html")
    want = page.picture().astype(int)
    page.open(f"{site}/scene.html")
    seen = {}
    for wall in ("none", "wall behind", "wall before"):
        page.run(f"show('{wall}')")
        seen[wall] = page.picture().astype(int)
    page.resize(800, 600)
    person = np.abs(want - (0xA0, 0xB0, 0xC0)).max(-1) > 30
    assert person.mean() > 0.03
    assert np.abs(seen["none"] - want).max() <= 2
    core = np.abs(seen["wall behind"] - (255, 0, 255)).max(-1) > 60
    assert (core & person).sum() > 0.8 * person.sum()
    assert np.abs(seen["wall before"][person] - (255, 0, 255)).max() <= 2
    assert page.errors == []


def test_a_folder_with_files_of_another_is_never_written_over_and_an_earlier_package_is(tmp_path):
    write_package(tmp_path / "mine")
    write_package(tmp_path / "mine")
    for name in ("package.json", "notes.txt"):
        theirs = tmp_path / name.partition(".")[0]
        theirs.mkdir()
        (theirs / name).write_text("theirs")
        with pytest.raises(FileExistsError, match="holds files of others"):
            write_package(theirs)
        assert [path.name for path in theirs.iterdir()] == [name] and (theirs / name).read_text() == "theirs"
