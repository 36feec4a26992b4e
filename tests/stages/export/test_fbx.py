"""avatar.fbx read back by three independent readers: ufbx, assimp and three's loader, which also poses it."""

import io
import json
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from gsac.stages.export.fbx import avatar_fbx
from gsac.stages.export.stage import pose_gaussians
from gsac.stages.export.texture import paint_surface

UFBX = """
import json, sys
import ufbx
scene = ufbx.load_file(sys.argv[1])
mesh = scene.meshes[0]
skin = mesh.skin_deformers[0]
xyz = lambda v: [v.x, v.y, v.z]
print(json.dumps(QUESTION), flush=True)
"""
QUESTIONS = {
    "vertices": "[xyz(mesh.vertices[i]) for i in range(mesh.num_vertices)]",
    "faces": "[mesh.vertex_indices[i] for i in range(mesh.num_indices)]",
    "uv": "[[v.x, v.y] for i in range(mesh.num_indices) for v in [mesh.vertex_uv.values[mesh.vertex_uv.indices[i]]]]",
    "picture": "list(bytes(scene.materials[0].fbx.diffuse_color.texture.content))",
    "normals": "[xyz(mesh.vertex_normal.values[mesh.vertex_normal.indices[i]]) for i in range(mesh.num_indices)]",
    "clusters": "{c.bone_node.name: [list(c.vertices), list(c.weights)] for c in skin.clusters}",
    "to_bone": "{c.bone_node.name: xyz(c.geometry_to_bone.c3) for c in skin.clusters}",
    "places": "{n.name: xyz(n.local_transform.translation) for n in scene.nodes}",
    "rests": "[n.local_transform.rotation.w for n in scene.nodes]",
    "metres": "scene.settings.unit_meters",
    "expressions": "{c.name: c.keyframes[0].shape.num_offsets for c in mesh.blend_deformers[0].channels}",
    "takes": "{t.name: [t.time_begin, t.time_end] for t in scene.anim_stacks}",
}

THREE = "three@0.180.0"
LOOK = """
import * as THREE from 'three';
import { FBXLoader } from 'three/examples/jsm/loaders/FBXLoader.js';
import fs from 'fs';
globalThis.window = globalThis;
globalThis.document = { createElementNS: () => new EventTarget() };  // node decodes no pictures
const bytes = fs.readFileSync('avatar.fbx'), times = JSON.parse(process.argv[2]);
const scene = new FBXLoader().parse(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length), '');
let mesh = null;
scene.traverse((o) => { if (o.isSkinnedMesh) mesh = o; });
const corners = () => {
  scene.updateMatrixWorld(true);
  mesh.skeleton.update();
  const p = mesh.geometry.attributes.position, out = [];
  for (let i = 0; i < p.count; i++) {
    out.push(mesh.getVertexPosition(i, new THREE.Vector3()).applyMatrix4(mesh.matrixWorld).toArray());
  }
  return out;
};
const out = { unit: scene.userData.unitScaleFactor, rest: corners(), clips: {},
  parents: Object.fromEntries(mesh.skeleton.bones.map((b) => [b.name, b.parent.isBone ? b.parent.name : null])) };
mesh.morphTargetInfluences[mesh.morphTargetDictionary.jawOpen] = 1;
out.jawOpen = corners();
mesh.morphTargetInfluences.fill(0);
const mixer = new THREE.AnimationMixer(scene);
for (const clip of scene.animations) {
  const action = mixer.clipAction(clip);
  action.play();
  out.clips[clip.name] = times.map((t) => { mixer.setTime(t); return corners(); });
  action.stop();
}
console.log(JSON.stringify(out));
"""
KEYS = (0, 4, 9)


@pytest.fixture(scope="module")
def surface(figure):
    return paint_surface(figure, *pose_gaussians(figure, figure.pose("T")))


@pytest.fixture(scope="module")
def fbx(figure, surface):
    return avatar_fbx(figure, surface)


@pytest.fixture(scope="module")
def path(fbx, tmp_path_factory):
    path = tmp_path_factory.mktemp("fbx") / "avatar.fbx"
    path.write_bytes(fbx)
    return path


@pytest.fixture(scope="module")
def read(path):
    """What ufbx finds; each question in a process of its own, because its binding crashes after some."""
    pytest.importorskip("ufbx", reason="needs the package ufbx (pip install ufbx)")

    def ask(question):
        script = UFBX.replace("QUESTION", question)
        done = subprocess.run([sys.executable, "-c", script, path], capture_output=True, text=True)
        assert done.stdout, (question, done.returncode, done.stderr)
        return json.loads(done.stdout)

    return {name: ask(question) for name, question in QUESTIONS.items()}


def test_mesh_weights_and_skeleton_are_exact(figure, read):
    ground = np.array([0, figure.ground, 0])
    np.testing.assert_allclose(read["vertices"], figure.vertices - ground, atol=1e-6)
    np.testing.assert_array_equal(np.reshape(read["faces"], (-1, 3)), figure.faces)
    weights = np.zeros((len(figure.vertices), 55))
    for name, (vertices, values) in read["clusters"].items():
        weights[vertices, figure.joint_names.index(name)] = values
    want = np.zeros_like(weights)
    np.add.at(want, (np.arange(len(want))[:, None], figure.skin_index), figure.skin_weight)
    np.testing.assert_allclose(weights, want, atol=1e-6)
    for j, name in enumerate(figure.joint_names):
        parent = figure.parents[j]
        offset = figure.joints[j] - (figure.joints[parent] if parent >= 0 else ground)
        np.testing.assert_allclose(read["places"][name], offset, atol=1e-6)
        np.testing.assert_allclose(read["to_bone"][name], ground - figure.joints[j], atol=1e-6)
    assert set(read["rests"]) == {1.0}, "joints rest without rotation"
    assert read["metres"] == 1


def test_the_left_hand_is_red_on_the_left_in_the_picture_inside_and_normals_look_outwards(figure, surface, read):
    assert bytes(read["picture"]) == surface.jpeg
    picture = np.asarray(Image.open(io.BytesIO(bytes(read["picture"]))).convert("RGB"), float)[::-1] / 255
    column, row = (np.reshape(read["uv"], (-1, 3, 2)).mean(1) * picture.shape[:2]).astype(int).T
    x, colours, normals = figure.vertices[figure.faces].mean(1)[:, 0], picture[row, column], np.array(read["normals"])
    assert colours[x > .74].mean(0)[0] > .6 > 4 * colours[x > .74].mean(0)[2]
    assert colours[x < -.74].mean(0)[2] > .6 > 4 * colours[x < -.74].mean(0)[0]
    v = figure.vertices[figure.faces]
    outward = np.cross(v[:, 1] - v[:, 0], v[:, 2] - v[:, 0])
    assert ((normals.reshape(-1, 3, 3).mean(1) * outward).sum(1) > 0).mean() > 0.99


def test_takes_are_as_long_as_the_clips(read):
    assert read["takes"] == {"wave": [0, pytest.approx(3.2)], "walk": [0, pytest.approx(1.15)]}


def test_expressions_are_blend_shapes_by_name(figure, read):
    assert read["expressions"] == {name: int(n) for name, n in zip(
        figure.expression_names, np.diff(figure.expression_start), strict=True)}


def test_assimp_opens_it_with_all_bones_and_takes(figure, surface, path):
    if not shutil.which("assimp"):
        pytest.skip("needs assimp (Debian package assimp-utils)")
    said = subprocess.run(["assimp", "info", path], capture_output=True, text=True, check=True).stdout
    found = dict(re.findall(r"^(Meshes|Animations|Vertices|Faces|Bones): +(\d+)", said, re.MULTILINE))
    assert 1 <= int(found.pop("Vertices")) / len(surface.vertex) < 1.02, "it joins corners that share all their values"
    assert found == {"Meshes": "1", "Animations": "2", "Faces": str(len(figure.faces)), "Bones": "55"}
    low, high = (np.array(re.search(rf"{which} point +\((.*)\)", said)[1].split(), float) for which in ("Minimum", "Maximum"))
    size = figure.vertices - (0, figure.ground, 0)
    np.testing.assert_allclose([low, high], [size.min(0), size.max(0)], atol=1e-5)


@pytest.mark.slow
def test_threes_loader_poses_it_as_the_avatar(figure, fbx, node_package):
    folder = node_package(THREE)
    (folder / "avatar.fbx").write_bytes(fbx)
    (folder / "look.mjs").write_text(LOOK)
    times = [k / figure.clips["wave"].fps for k in KEYS]
    done = subprocess.run(["node", "look.mjs", json.dumps(times)], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    seen, ground, corners = json.loads(done.stdout), np.array([0, figure.ground, 0]), figure.faces.reshape(-1)
    assert seen["unit"] == 100
    assert seen["parents"] == {name: figure.joint_names[p] if p >= 0 else None
                               for name, p in zip(figure.joint_names, figure.parents, strict=True)}
    np.testing.assert_allclose(seen["rest"], (figure.vertices - ground)[corners], atol=1e-5)
    moved = figure.vertices - ground
    span = slice(figure.expression_start[0], figure.expression_start[1])
    moved[figure.expression_vertex[span]] += figure.expression_delta[span]
    np.testing.assert_allclose(seen["jawOpen"], moved[corners], atol=1e-5)
    for name, clip in figure.clips.items():
        for key, got in zip(KEYS, seen["clips"][name], strict=True):
            pose = np.zeros((55, 3), np.float32)
            pose[[figure.joint_names.index(j) for j in clip.joints]] = clip.rotation[key]
            want = figure.posed(pose) + clip.transl[key] - ground
            np.testing.assert_allclose(got, want[corners], atol=2e-4)


def test_same_input_same_bytes_and_no_expression_no_clip_is_a_file_too(figure, surface, fbx):
    from dataclasses import replace
    assert avatar_fbx(figure, surface) == fbx
    bare = replace(figure, expression_names=[], expression_start=np.zeros(1, np.int32), expression_vertex=np.empty(0, np.int32),
                   expression_delta=np.empty((0, 3), np.float32), jaw_actions=np.empty((0, 3), np.float32), clips={})
    assert b"BlendShape" not in avatar_fbx(bare, surface) and len(avatar_fbx(bare, surface)) < len(fbx)
