"""The GLB is read by a reader written here from the specification, by trimesh, and by Khronos' validator."""

import io
import json
import struct
import subprocess

import numpy as np
import pytest
import trimesh
from PIL import Image
from scipy.spatial.transform import Rotation

from gsac.avatar.binding import bind, face_frames
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.stages.export.glb import glb_bytes, splats_glb_bytes
from gsac.stages.export.stage import pose_gaussians
from gsac.stages.export.texture import paint_surface

VALIDATOR = "gltf-validator@2.0.0-dev.3.10"
KNOWN_FALSE = {f"/meshes/1/primitives/0/attributes/KHR_gaussian_splatting:{n}"
               for n in ("ROTATION", "SCALE", "OPACITY", "SH_DEGREE_0_COEF_0")}
"""The validator does not know the extension and calls its attributes badly named."""
TYPES = {5126: "<f4", 5123: "<u2", 5125: "<u4", 5121: "u1"}
WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


@pytest.fixture(scope="module")
def rest(figure):
    return pose_gaussians(figure, figure.pose("T"))


@pytest.fixture(scope="module")
def surface(figure, rest):
    return paint_surface(figure, *rest)


@pytest.fixture(scope="module")
def glb(figure, surface, rest):
    return glb_bytes(figure, surface, *rest)


class Gltf:
    def __init__(self, data):
        magic, version, size = struct.unpack_from("<4sII", data)
        assert (magic, version, size) == (b"glTF", 2, len(data))
        length = struct.unpack_from("<I", data, 12)[0]
        self.doc, self.bin = json.loads(data[20:20 + length]), data[28 + length:]
        self.node = {n["name"]: i for i, n in enumerate(self.doc["nodes"])}

    def array(self, accessor):
        a = self.doc["accessors"][accessor]
        start = self.doc["bufferViews"][a["bufferView"]]["byteOffset"]
        width = WIDTH[a["type"]]
        flat = np.frombuffer(self.bin, TYPES[a["componentType"]], a["count"] * width, start)
        return flat.reshape(-1, width) if width > 1 else flat

    def sparse(self, accessor):
        """Rows and values (n, 3) of an accessor that is zero elsewhere."""
        parts = self.doc["accessors"][accessor].get("sparse", {"count": 0})
        if not parts["count"]:
            return np.empty(0, int), np.empty((0, 3), np.float32)
        start = {name: self.doc["bufferViews"][parts[name]["bufferView"]]["byteOffset"] for name in ("indices", "values")}
        rows = np.frombuffer(self.bin, TYPES[parts["indices"]["componentType"]], parts["count"], start["indices"])
        return rows, np.frombuffer(self.bin, "<f4", 3 * parts["count"], start["values"]).reshape(-1, 3)

    def attributes(self, mesh):
        return {k: self.array(v) for k, v in self.doc["meshes"][mesh]["primitives"][0]["attributes"].items()}

    def skinned(self, mesh, rotations, translations):
        """Positions of a mesh by glTF's own rules; rotations, translations: node -> override of the rest."""
        world = {}

        def walk(i, parent):
            node = self.doc["nodes"][i]
            local = np.eye(4)
            local[:3, 3] = translations.get(i, node.get("translation", (0, 0, 0)))
            local[:3, :3] = Rotation.from_quat(rotations.get(i, node.get("rotation", (0, 0, 0, 1)))).as_matrix()
            world[i] = parent @ local
            for child in node.get("children", []):
                walk(child, world[i])

        for root in self.doc["scenes"][0]["nodes"]:
            walk(root, np.eye(4))
        skin = self.doc["skins"][0]
        inverse = self.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
        bones = np.stack([world[j] for j in skin["joints"]]) @ inverse
        a = self.attributes(mesh)
        points = np.concatenate([a["POSITION"], np.ones((len(a["POSITION"]), 1))], 1)
        blend = (a["WEIGHTS_0"][..., None, None] * bones[a["JOINTS_0"]]).sum(1)
        return np.einsum("nij,nj->ni", blend, points)[:, :3]


@pytest.fixture(scope="module")
def gltf(glb):
    return Gltf(glb)


def test_joints_rest_without_rotation_and_inverse_bind_matrices_undo_them(figure, gltf):
    joints = gltf.doc["skins"][0]["joints"]
    assert [gltf.doc["nodes"][j]["name"] for j in joints] == figure.joint_names
    assert not any("rotation" in gltf.doc["nodes"][j] or "scale" in gltf.doc["nodes"][j] for j in joints)
    np.testing.assert_allclose(gltf.skinned(0, {}, {}), gltf.attributes(0)["POSITION"], atol=1e-6)


def test_every_key_of_every_clip_poses_the_mesh_as_the_avatar_does(figure, surface, gltf):
    for animation in gltf.doc["animations"]:
        clip = figure.clips[animation["name"]]
        for key in (0, len(clip.rotation) // 3, len(clip.rotation)):
            rotations, translations = {}, {}
            for channel in animation["channels"]:
                sampler = animation["samplers"][channel["sampler"]]
                into = rotations if channel["target"]["path"] == "rotation" else translations
                into[channel["target"]["node"]] = gltf.array(sampler["output"])[key]
                assert gltf.array(sampler["input"])[key] == pytest.approx(key / clip.fps)
            pose = np.zeros((55, 3), np.float32)
            pose[[figure.joint_names.index(j) for j in clip.joints]] = clip.rotation[key % len(clip.rotation)]
            expected = figure.posed(pose) + clip.transl[key % len(clip.rotation)] - (0, figure.ground, 0)
            np.testing.assert_allclose(gltf.skinned(0, rotations, translations), expected[surface.vertex], atol=2e-5)


def test_points_are_the_gaussians_in_linear_units(figure, gltf):
    a, g = gltf.attributes(1), figure.gaussians
    vertices = figure.vertices - np.float32([0, figure.ground, 0])
    bound = bind(face_frames(vertices, figure.faces), g.face, g.mu, g.quat, g.log_scale)
    np.testing.assert_allclose(a["POSITION"], bound.means, atol=1e-5)
    np.testing.assert_allclose(a["KHR_gaussian_splatting:SCALE"], bound.scales, rtol=1e-4)
    R = Rotation.from_quat(a["KHR_gaussian_splatting:ROTATION"]).as_matrix()
    np.testing.assert_allclose(R, bound.rotations, atol=1e-5)
    np.testing.assert_array_equal(a["KHR_gaussian_splatting:OPACITY"], g.opacity)
    np.testing.assert_array_equal(a["_GSAC_FACE"], g.face)


def test_points_keep_the_rules_of_the_extensions_release_candidate(figure, gltf):
    primitive = gltf.doc["meshes"][1]["primitives"][0]
    assert primitive["mode"] == 0 and gltf.doc["extensionsUsed"] == ["KHR_gaussian_splatting"]
    assert "extensionsRequired" not in gltf.doc, "tools without it show points"
    said = primitive["extensions"]["KHR_gaussian_splatting"]
    assert said == {"kernel": "ellipse", "colorSpace": "srgb_rec709_display", "projection": "perspective",
                    "sortingMethod": "cameraDistance"}
    kinds = {"ROTATION": "VEC4", "SCALE": "VEC3", "OPACITY": "SCALAR", "SH_DEGREE_0_COEF_0": "VEC3"}
    for name, kind in kinds.items():
        accessor = gltf.doc["accessors"][primitive["attributes"][f"KHR_gaussian_splatting:{name}"]]
        assert (accessor["type"], accessor["componentType"]) == (kind, 5126), name
    a = {name: gltf.attributes(1)[f"KHR_gaussian_splatting:{name}"] for name in kinds}
    np.testing.assert_allclose(np.linalg.norm(a["ROTATION"], axis=1), 1, atol=1e-5)
    assert a["SCALE"].min() >= 0 and a["OPACITY"].min() >= 0 and a["OPACITY"].max() <= 1
    np.testing.assert_allclose(a["SH_DEGREE_0_COEF_0"] * .2820947917738781 + .5, figure.gaussians.rgb, atol=1e-6)


def test_what_is_shown_is_one_person_and_the_gaussians_are_a_mesh_that_no_node_shows(gltf):
    assert len(gltf.doc["scenes"]) == 1, "PlayCanvas shows all scenes"
    assert [n["name"] for n in gltf.doc["nodes"] if "mesh" in n] == ["body"], "Blender shows nodes that are in no scene"
    assert [mesh["name"] for mesh in gltf.doc["meshes"]] == ["body", "gaussians"]


def test_a_file_of_the_gaussians_alone_holds_the_same_and_shows_them(figure, rest, gltf):
    alone = Gltf(splats_glb_bytes(figure, *rest))
    assert alone.doc["nodes"] == [{"name": "gaussians", "mesh": 0}] and alone.doc["scenes"][0]["nodes"] == [0]
    assert alone.doc["meshes"][0]["primitives"][0]["extensions"] == gltf.doc["meshes"][1]["primitives"][0]["extensions"]
    assert alone.doc["extensionsUsed"] == ["KHR_gaussian_splatting"]
    for name, values in gltf.attributes(1).items():
        np.testing.assert_array_equal(alone.attributes(0)[name], values)


def test_left_hand_is_on_the_left_and_red_in_mesh_and_points(gltf):
    for places, colours in (painted(gltf), (gltf.attributes(1)["POSITION"], gltf.attributes(1)["COLOR_0"])):
        hand = places[:, 0] > 0.72
        assert hand.any()
        mean = colours[hand, :3].mean(0)
        assert mean[0] > 0.5 and mean[1] < 0.15 and mean[2] < 0.15
    toes = gltf.attributes(0)["POSITION"][gltf.attributes(0)["POSITION"][:, 1] < 0.03]
    assert toes[:, 2].max() > 0.1, "faces +z"


def painted(gltf):
    """Centres of the mesh's faces, and the picture's linear colours there."""
    material = gltf.doc["materials"][gltf.doc["meshes"][0]["primitives"][0]["material"]]["pbrMetallicRoughness"]
    image = gltf.doc["images"][gltf.doc["textures"][material["baseColorTexture"]["index"]]["source"]]
    view = gltf.doc["bufferViews"][image["bufferView"]]
    raw = gltf.bin[view["byteOffset"]:view["byteOffset"] + view["byteLength"]]
    picture = np.asarray(Image.open(io.BytesIO(raw)).convert("RGB"), float) / 255
    corners = gltf.array(gltf.doc["meshes"][0]["primitives"][0]["indices"]).reshape(-1, 3)
    a = gltf.attributes(0)
    column, row = (a["TEXCOORD_0"][corners].mean(1) * picture.shape[:2]).astype(int).T
    return a["POSITION"][corners].mean(1), picture[row, column] ** 2.2


def test_the_mesh_is_coloured_by_its_picture_alone(gltf):
    assert "COLOR_0" not in gltf.attributes(0), "readers multiply vertex colours and picture"


def test_the_52_expressions_of_arkit_are_morph_targets_and_move_the_mesh_as_the_avatar_s_do(exported):
    avatar, gltf = RiggedAvatar.read(exported / "avatar.gsac"), Gltf((exported / "avatar.glb").read_bytes())
    mesh = gltf.doc["meshes"][0]
    vertex = paint_surface(avatar, *pose_gaussians(avatar, avatar.pose("T"))).vertex
    names, targets = mesh["extras"]["targetNames"], mesh["primitives"][0]["targets"]
    assert names == avatar.expression_names and len(names) == len(targets) == len(mesh["weights"]) == 52
    assert {"jawOpen", "eyeBlinkLeft", "mouthSmileRight", "tongueOut"} <= set(names)
    for e, target in enumerate(targets):
        rows, values = gltf.sparse(target["POSITION"])
        span = slice(*avatar.expression_start[e:e + 2])
        want = np.zeros_like(avatar.vertices)
        want[avatar.expression_vertex[span]] = avatar.expression_delta[span]
        got = np.zeros((len(vertex), 3))
        got[rows] = values
        np.testing.assert_allclose(got, want[vertex], atol=1e-5)
        assert (np.diff(rows.astype(int)) > 0).all(), "glTF wants ascending indices"
    assert "targets" not in gltf.doc["meshes"][1]["primitives"][0], "gaussians follow faces, which glTF cannot say"


def test_trimesh_opens_it(figure, glb):
    scene = trimesh.load(io.BytesIO(glb), file_type="glb")
    body, points = scene.geometry["body"], scene.geometry["gaussians"]
    assert body.faces.shape == figure.faces.shape
    assert points.vertices.shape == (len(figure.gaussians), 3)
    assert body.bounds[0][1] == pytest.approx(0, abs=1e-6), "feet at y = 0"


@pytest.mark.slow
def test_the_validator_finds_nothing_but_its_four_known_false_reports(glb, node_package):
    folder = node_package(VALIDATOR)
    (folder / "avatar.glb").write_bytes(glb)
    (folder / "validate.js").write_text(
        "const bytes = new Uint8Array(require('fs').readFileSync('avatar.glb'));"
        "require('gltf-validator').validateBytes(bytes, {maxIssues: 0})"
        ".then((report) => console.log(JSON.stringify(report.issues.messages)))")
    messages = json.loads(subprocess.run(["node", "validate.js"], cwd=folder, capture_output=True, check=True).stdout)
    wrong = {m["pointer"] for m in messages if m["severity"] == 0}
    assert wrong == KNOWN_FALSE
    assert [m["code"] for m in messages if m["severity"] == 1] == []


THREE = "three@0.180.0"
LOOK = """
import * as THREE from 'three';
import { GLTFLoader } from 'three/examples/jsm/loaders/GLTFLoader.js';
import fs from 'fs';
globalThis.self = globalThis;
const bytes = fs.readFileSync('avatar.glb');
const gltf = await new GLTFLoader().parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length), '');
let mesh = null;
gltf.scene.traverse((o) => { if (o.isSkinnedMesh && o.morphTargetDictionary) mesh = o; });
gltf.scene.updateMatrixWorld(true);
const places = () => Array.from({ length: mesh.geometry.attributes.position.count },
  (_, i) => mesh.getVertexPosition(i, new THREE.Vector3()).toArray());
const out = { names: mesh.morphTargetDictionary, rest: places() };
mesh.morphTargetInfluences[mesh.morphTargetDictionary.jawOpen] = 0.5;
out.jawOpen = places();
console.log(JSON.stringify(out));
"""


@pytest.mark.slow
def test_expressions_are_morph_targets_that_threes_loader_moves(figure, surface, glb, node_package):
    folder = node_package(THREE)
    (folder / "avatar.glb").write_bytes(glb)
    (folder / "morph.mjs").write_text(LOOK)
    done = subprocess.run(["node", "morph.mjs"], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    seen = json.loads(done.stdout.splitlines()[-1])
    assert seen["names"] == {name: e for e, name in enumerate(figure.expression_names)}
    rest = figure.vertices - np.float32([0, figure.ground, 0])
    np.testing.assert_allclose(seen["rest"], rest[surface.vertex], atol=1e-6)
    span = slice(figure.expression_start[0], figure.expression_start[1])
    rest[figure.expression_vertex[span]] += 0.5 * figure.expression_delta[span]
    np.testing.assert_allclose(seen["jawOpen"], rest[surface.vertex], atol=1e-6)
