"""avatar.vrm by the rules of VRM 1.0, by Khronos' validator, and posed by three-vrm."""

import json
import struct
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from gsac.avatar.artifacts import ArtifactError
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.stages.export.stage import pose_gaussians
from gsac.stages.export.texture import paint_surface
from gsac.stages.export.vrm import BONES, PRESETS, vrm_bytes

VALIDATOR = "gltf-validator@2.0.0-dev.3.10"
THREE_VRM = "@pixiv/three-vrm@3.5.5 three@0.180.0"
NEEDED = {"hips", "spine", "head", *(side + bone for side in ("left", "right") for bone in (
    "UpperLeg", "LowerLeg", "Foot", "UpperArm", "LowerArm", "Hand"))}
"""Bones without which a file is no VRM."""
OWN = {"happy", "angry", "sad", "relaxed", "surprised", "aa", "ih", "ou", "ee", "oh", "blink", "blinkLeft", "blinkRight",
       "lookUp", "lookDown", "lookLeft", "lookRight"}
LOOK = """
import * as THREE from 'three';
import { GLTFLoader } from 'three/examples/jsm/loaders/GLTFLoader.js';
import { VRMLoaderPlugin } from '@pixiv/three-vrm';
import fs from 'fs';
globalThis.self = globalThis;
const bytes = fs.readFileSync('avatar.vrm'), loader = new GLTFLoader();
loader.register((parser) => new VRMLoaderPlugin(parser));
const { vrm } = (await loader.parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length), '')).userData;
let mesh = null;
vrm.scene.traverse((o) => { if (o.isSkinnedMesh) mesh = o; });
const hand = () => vrm.humanoid.getRawBoneNode('leftHand').getWorldPosition(new THREE.Vector3()).toArray();
const weights = () => Object.fromEntries(Object.entries(mesh.morphTargetDictionary)
  .map(([name, i]) => [name, mesh.morphTargetInfluences[i]]).filter(([, w]) => w > 0));
vrm.update(0);
const out = { version: vrm.meta.metaVersion, meta: vrm.meta, rest: hand(), said: {},
  bones: Object.keys(vrm.humanoid.humanBones), expressions: Object.keys(vrm.expressionManager.expressionMap) };
vrm.humanoid.getNormalizedBoneNode('leftUpperArm').rotation.z = -Math.PI / 2;
vrm.update(0);
out.hanging = hand();
for (const name of ['happy', 'blinkLeft', 'jawOpen']) {
  vrm.expressionManager.resetValues();
  vrm.expressionManager.setValue(name, 1);
  vrm.update(0);
  out.said[name] = weights();
}
vrm.expressionManager.resetValues();
const target = new THREE.Object3D();
target.position.set(-5, out.rest[1], 5);
target.updateMatrixWorld();
vrm.lookAt.target = target;
vrm.update(0);
out.glance = weights();
console.log(JSON.stringify(out));
"""


@pytest.fixture(scope="module")
def avatar(exported):
    return RiggedAvatar.read(exported / "avatar.gsac")


@pytest.fixture(scope="module")
def surface(avatar):
    return paint_surface(avatar, *pose_gaussians(avatar, avatar.pose("T")))


@pytest.fixture(scope="module")
def vrm(avatar, surface):
    return vrm_bytes(avatar, surface)


@pytest.fixture(scope="module")
def document(vrm):
    return json.loads(vrm[20:20 + struct.unpack_from("<I", vrm, 12)[0]])


def test_all_bones_that_vrm_needs_are_there_once_and_hang_together_as_the_joints_do(avatar, document):
    bones = {bone: row["node"] for bone, row in document["extensions"]["VRMC_vrm"]["humanoid"]["humanBones"].items()}
    assert bones.keys() >= NEEDED and len(set(bones.values())) == len(bones) == 55
    assert {avatar.joint_names[node]: bone for bone, node in bones.items()} == BONES
    nodes = document["nodes"]
    for parent, child in (("leftUpperArm", "leftLowerArm"), ("leftHand", "leftThumbMetacarpal"), ("hips", "rightUpperLeg")):
        assert bones[child] in nodes[bones[parent]]["children"]
    assert not any("rotation" in nodes[node] for node in bones.values())


def test_the_52_actions_are_expressions_by_their_names_and_vrm_s_own_are_made_of_them(avatar, document):
    said = document["extensions"]["VRMC_vrm"]["expressions"]
    mesh = next(n for n, node in enumerate(document["nodes"]) if "mesh" in node)
    assert said["custom"].keys() == set(avatar.expression_names) and len(said["custom"]) == 52
    assert said["preset"].keys() == OWN == PRESETS.keys()
    for name, row in (said["custom"] | said["preset"]).items():
        assert row["morphTargetBinds"], name
        for bind in row["morphTargetBinds"]:
            assert bind["node"] == mesh and 0 < bind["weight"] <= 1 and 0 <= bind["index"] < 52
    assert said["custom"]["jawOpen"]["morphTargetBinds"] == [
        {"node": mesh, "index": avatar.expression_names.index("jawOpen"), "weight": 1}]


def test_the_likeness_s_terms_are_carried_and_vrm_s_are_the_strictest(avatar, document):
    meta = document["extensions"]["VRMC_vrm"]["meta"]
    assert meta["copyrightInformation"] == avatar.licence["avatar"] and meta["thirdPartyLicenses"] == avatar.licence["body"]
    assert meta["name"] and meta["authors"] and meta["licenseUrl"] == "https://vrm.dev/licenses/1.0/"
    assert (meta["avatarPermission"], meta["commercialUsage"]) == ("onlySeparatelyLicensedPerson", "personalNonProfit")
    assert (meta["modification"], meta["creditNotation"]) == ("prohibited", "required")
    assert not any(meta[name] for name in meta if name.startswith("allow"))


def test_same_input_same_bytes_and_an_avatar_with_other_actions_or_joints_is_a_file_or_refused(figure, avatar, surface, vrm):
    assert vrm_bytes(avatar, surface) == vrm
    few = vrm_bytes(figure, paint_surface(figure, *pose_gaussians(figure, figure.pose("T"))))
    said = json.loads(few[20:20 + struct.unpack_from("<I", few, 12)[0]])["extensions"]["VRMC_vrm"]["expressions"]
    assert said["preset"].keys() == {"aa"} and said["custom"].keys() == set(figure.expression_names)
    with pytest.raises(ArtifactError, match="no joint left_wrist"):
        vrm_bytes(replace(avatar, joint_names=["hand" if n == "left_wrist" else n for n in avatar.joint_names]), surface)


@pytest.mark.slow
def test_the_validator_finds_no_error_and_no_warning(vrm, node_package):
    folder = node_package(VALIDATOR)
    (folder / "avatar.vrm").write_bytes(vrm)
    (folder / "validate_vrm.js").write_text(
        "const bytes = new Uint8Array(require('fs').readFileSync('avatar.vrm'));"
        "require('gltf-validator').validateBytes(bytes, {maxIssues: 0})"
        ".then((report) => console.log(JSON.stringify(report.issues.messages)))")
    messages = json.loads(subprocess.run(["node", "validate_vrm.js"], cwd=folder, capture_output=True, check=True).stdout)
    assert [m for m in messages if m["severity"] < 2] == []


@pytest.mark.slow
def test_three_vrm_poses_its_humanoid_and_plays_its_expressions(avatar, vrm, node_package):
    folder = node_package(THREE_VRM)
    (folder / "avatar.vrm").write_bytes(vrm)
    (folder / "vrm.mjs").write_text(LOOK)
    done = subprocess.run(["node", "vrm.mjs"], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    seen = json.loads(done.stdout.splitlines()[-1])
    assert seen["version"] == "1" and seen["meta"]["copyrightInformation"] == avatar.licence["avatar"]
    assert set(seen["bones"]) == set(BONES.values())
    assert set(seen["expressions"]) == OWN | set(avatar.expression_names)
    place = {name: avatar.joints[avatar.joint_names.index(f"left_{name}")] - (0, avatar.ground, 0)
             for name in ("shoulder", "wrist")}
    np.testing.assert_allclose(seen["rest"], place["wrist"], atol=1e-5)
    x, y, z = place["wrist"] - place["shoulder"]
    np.testing.assert_allclose(seen["hanging"], place["shoulder"] + (y, -x, z), atol=1e-4)
    assert seen["said"]["jawOpen"] == {"jawOpen": 1} and seen["said"]["blinkLeft"] == {"eyeBlinkLeft": 1}
    assert seen["said"]["happy"].keys() > {"mouthSmileLeft", "mouthSmileRight"}
    glance = {"eyeLookInLeft", "eyeLookOutRight", "eyeLookDownLeft", "eyeLookDownRight"}
    assert seen["glance"].keys() == glance, "it looks to its right, which is -x, and down"
