"""The person whose left hand is red comes out the right way round in every file that the stage writes.

Each file is opened by a reader that is not ours, and brought to the canonical axes as that format's rules say.
"""

import io
import shutil
import subprocess

import numpy as np
import pytest
import trimesh

from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.stages.export.ply import SH0

THREE = "three@0.180.0"
SHOW_GLB = """<!doctype html><link rel="icon" href="data:,"><style>html, body { margin: 0 }</style>
<script type="importmap">{ "imports": { "three": "./node_modules/three/build/three.module.js" } }</script>
<canvas id="c" width="300" height="300"></canvas>
<script type="module">
import * as THREE from "three";
import { GLTFLoader } from "./node_modules/three/examples/jsm/loaders/GLTFLoader.js";
const renderer = new THREE.WebGLRenderer({ canvas: document.getElementById("c") });
const scene = new THREE.Scene(), camera = new THREE.PerspectiveCamera(30, 1, 0.1, 20);
scene.background = new THREE.Color(0.2, 0.3, 0.2);
scene.add(new THREE.AmbientLight(0xffffff, 3));
camera.position.set(0, 0.9, 4.5);
const { scene: loaded } = await new GLTFLoader().loadAsync("avatar.glb");
loaded.traverse((o) => { if (o.isPoints) o.visible = false; });
scene.add(loaded);
renderer.render(scene, camera);
document.documentElement.dataset.ready = "yes";
</script>"""


def gsac(path):
    avatar = RiggedAvatar.read(path)
    corners = avatar.vertices[avatar.faces[avatar.gaussians.face]].mean(1)
    return corners, avatar.gaussians.rgb


def ply(path):
    """3DGS axes: y down, z away."""
    gsply = pytest.importorskip("gsply", reason="needs the package gsply (pip install gsply)")
    data = gsply.plyread(str(path))
    return data.means * (1, -1, -1), 0.5 + SH0 * np.squeeze(data.sh0)


def spz(path):
    """Right, up, back: the canonical axes."""
    gsply = pytest.importorskip("gsply", reason="needs the package gsply (pip install gsply)")
    data = gsply.read_spz(path)
    return data.means, 0.5 + SH0 * np.squeeze(data.sh0)


def glb_mesh(path):
    mesh = trimesh.load(io.BytesIO(path.read_bytes()), file_type="glb").geometry["body"]
    return mesh.vertices, mesh.visual.to_color().vertex_colors[:, :3] / 255


def glb_points(path):
    cloud = trimesh.load(io.BytesIO(path.read_bytes()), file_type="glb").geometry["gaussians"]
    return cloud.vertices, np.asarray(cloud.colors)[:, :3] / 255


def fbx(path):
    """assimp turns it into a glTF file with its picture inside."""
    if not shutil.which("assimp"):
        pytest.skip("needs assimp (Debian package assimp-utils)")
    out = path.with_name("from_fbx.glb")
    subprocess.run(["assimp", "export", path, out, "-fglb2"], check=True, capture_output=True)
    mesh = trimesh.load(out, process=False).to_geometry()
    return mesh.vertices, mesh.visual.to_color().vertex_colors[:, :3] / 255


@pytest.mark.slow
@pytest.mark.parametrize(("name", "read"), [
    ("avatar.gsac", gsac), ("avatar.ply", ply), ("avatar.spz", spz), ("avatar.glb", glb_mesh), ("avatar.glb", glb_points),
    ("avatar.fbx", fbx)])
def test_the_left_hand_is_red_and_on_the_left_the_toes_in_front_the_head_up(exported, tmp_path, name, read):
    shutil.copy(exported / name, tmp_path / name)
    places, colours = (np.asarray(x, float) for x in read(tmp_path / name))
    red = (colours[:, 0] > 0.6) & (colours[:, 1:].max(1) < 0.3)
    assert red.sum() > 20
    assert (places[red, 0] > 0.3).mean() > 0.98, "left is +x"
    low, high = places[:, 1].min(), places[:, 1].max()
    head, feet = places[places[:, 1] > high - 0.2], places[places[:, 1] < low + 0.06]
    assert np.ptp(head[:, 0]) < 0.35, "a head is narrow: it is at the top"
    assert feet[:, 2].max() - np.median(head[:, 2]) > 0.1, "toes look to +z"
    assert 1.4 < high - low < 2.2


@pytest.mark.slow
def test_threes_viewer_shows_the_glb_with_the_red_hand_at_the_right(exported, node_package):
    from gsac.benchmarks.viewer import browser as chromium
    from gsac.benchmarks.viewer.frame_rate import serve
    if chromium.find_chromium() is None:
        pytest.skip("needs the Debian package chromium")
    folder = node_package(THREE)
    shutil.copy(exported / "avatar.glb", folder / "avatar.glb")
    (folder / "show.html").write_text(SHOW_GLB)
    page = chromium.Browser(300, 300)
    try:
        with serve(folder) as address:
            page.open(f"{address}/show.html")
            picture = page.picture().astype(int)
    finally:
        page.close()
    red = (picture[..., 0] > 120) & (picture[..., 1:].max(-1) < 90)
    assert page.errors == [] and red.sum() > 20
    assert np.nonzero(red)[1].min() > 180, "the person faces us"
