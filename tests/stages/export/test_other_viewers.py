"""Splat viewers that are not ours show avatar.ply, avatar.glb and avatar.spz as viewer.html shows the avatar."""

import math
import shutil

import numpy as np
import pytest

from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.benchmarks.viewer import browser as chromium
from gsac.benchmarks.viewer.bench import CAMERA, PACKAGE, PAGE, pages
from gsac.benchmarks.viewer.frame_rate import serve

pytestmark = [pytest.mark.slow,
              pytest.mark.skipif(chromium.find_chromium() is None, reason="needs the Debian package chromium")]
SPARK = "@sparkjsdev/spark@2.2.0 three@0.180.0"
SHOW_SPZ = """<!doctype html><link rel="icon" href="data:,"><style>html, body { margin: 0 }</style>
<script type="importmap">{ "imports": { "three": "./node_modules/three/build/three.module.js",
  "three/addons/": "./node_modules/three/examples/jsm/" } }</script>
<canvas id="c" width="400" height="400"></canvas>
<script type="module">
import * as THREE from "three";
import { SparkRenderer, SplatMesh } from "./node_modules/@sparkjsdev/spark/dist/spark.module.min.js";
const renderer = new THREE.WebGLRenderer({ canvas: document.getElementById("c") });
const scene = new THREE.Scene(), camera = new THREE.PerspectiveCamera(30, 1, 0.1, 20);
scene.background = new THREE.Color(0x3a6080);
scene.add(new SparkRenderer({ renderer }));
const splats = new SplatMesh({ url: "avatar.spz" });
await splats.initialized;
scene.add(splats);
camera.position.set(0, HEIGHT, DISTANCE);
let frames = 0;
renderer.setAnimationLoop(() => {
  renderer.render(scene, camera);
  frames += 1;
  if (frames === 6) document.documentElement.dataset.ready = "yes";
  if (frames === 12) renderer.setAnimationLoop(null);
});
</script>"""
SIZE, BACKGROUND = 400, (0x3A, 0x60, 0x80)


def shown(address):
    page = chromium.Browser(SIZE, SIZE)
    try:
        page.open(address)
        page.run("new Promise((done) => setTimeout(done, 1000))")
        assert page.errors == []
        return page.picture().astype(float)
    finally:
        page.close()


def person(picture):
    return np.abs(picture - BACKGROUND).max(-1) > 12


@pytest.mark.parametrize("name", ["avatar.ply", "avatar.glb"])
def test_playcanvas_shows_what_our_page_shows(exported, node_package, name):
    folder = node_package(PACKAGE)
    for file in (exported / name, exported / "viewer.html", PAGE):
        shutil.copy(file, folder / file.name)
    ours, theirs = pages(RiggedAvatar.read(exported / "avatar.gsac")).values()
    pose = {"avatar.ply": "A", "avatar.glb": "T"}[name]
    with serve(folder) as address:
        got = shown(f"{address}/{theirs.replace('avatar.ply', name)}")
        want = shown(f"{address}/{ours.replace('clip=walk', f'pose={pose}')}&still")
    a, b = person(got), person(want)
    assert b.mean() > 0.03 and (a & b).sum() / (a | b).sum() > 0.95
    both = a & b
    assert -10 * math.log10((((got - want) / 255)[both] ** 2).mean()) > 26
    red = (got[..., 0] > 150) & (got[..., 1:].max(-1) < 100)
    assert np.nonzero(red)[1].min() > SIZE / 2


def test_spark_shows_the_spz_the_right_way_round(exported, node_package):
    folder = node_package(SPARK)
    avatar = RiggedAvatar.read(exported / "avatar.gsac")
    for file in ("avatar.spz", "viewer.html"):
        shutil.copy(exported / file, folder / file)
    height = (avatar.vertices[:, 1].max() - avatar.ground) / 2
    (folder / "show.html").write_text(SHOW_SPZ.replace("HEIGHT", f"{height:.4f}").replace("DISTANCE", str(CAMERA["dist"])))
    with serve(folder) as address:
        got = shown(f"{address}/show.html")
        want = shown(f"{address}/{pages(avatar)['software'].replace('clip=walk', 'pose=A')}&still")
    a, b = person(got), person(want)
    assert (a & b).sum() / (a | b).sum() > 0.93
    red = (got[..., 0] > 150) & (got[..., 1:].max(-1) < 110)
    assert np.nonzero(red)[1].min() > SIZE / 2
