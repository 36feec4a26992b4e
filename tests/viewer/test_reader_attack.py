"""The page's readers of what a user or a stranger brings, run by node: no file ends one, none holds the page up or fills it."""

import base64
import json
import os
import re
import shutil
import struct
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import support
from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.avatar.motion.source import Motion
from gsac.stages.export.fbx import avatar_fbx
from gsac.stages.export.fbx_file import MAGIC, Long, Node, fbx_bytes
from gsac.stages.export.glb import glb_bytes
from gsac.stages.export.stage import pose_gaussians
from gsac.stages.export.texture import paint_surface
from support import dances, hostile
from support.page_modules import copy_modules

pytestmark = pytest.mark.skipif(not shutil.which("node"), reason="needs the Debian package nodejs")

ATTACK = Path(support.__file__).with_name("attack_readers.mjs")
MUTANTS = int(os.environ.get("GSAC_READER_MUTANTS", "400"))
"""Of all readers together; a long run asks for more."""
LONGEST_S = 10
MOST_MB = 1024

OPEN = """
import { readFileSync } from "node:fs";
import { GsacError } from "./container.js";
import { MotionError } from "./motion.js";
import { addMotions } from "./motion_files.js";
import { readAvatar } from "./reader.js";
console.error = () => {};
const [own, ...paths] = process.argv.slice(2), read = (path) => readAvatar(new Uint8Array(readFileSync(path)).buffer);
const peak = () => Number(readFileSync("/proc/self/status", "latin1").match(/VmHWM:\\s*(\\d+)/)[1]) / 1024;
for (const path of paths) {
  const name = path.split("/").at(-1), start = process.cpuUsage();
  let said = "taken";
  try {
    if (path.endsWith(".gsac")) read(path);
    else await addMotions(read(own), [new File([readFileSync(path)], name)]);
  } catch (error) {
    said = error instanceof MotionError || error instanceof GsacError ? error.message : `uncaught: ${error.stack}`;
  }
  const { user, system } = process.cpuUsage(start);
  console.log(JSON.stringify({ said, seconds: (user + system) / 1e6, mb: peak() }));
}
"""


@pytest.fixture(scope="module")
def modules(tmp_path_factory):
    folder = copy_modules(tmp_path_factory.mktemp("modules"))
    shutil.copy(ATTACK, folder)
    (folder / "open.mjs").write_text(OPEN)
    return folder


@pytest.fixture(scope="module")
def whole(figure, tmp_path_factory):
    """Reader -> whole files of its kind."""
    folder = tmp_path_factory.mktemp("whole")
    figure = replace(figure, clips={name: replace(clip, rotation=clip.rotation[:4], transl=clip.transl[:4])
                                    for name, clip in figure.clips.items()})
    gaussians = pose_gaussians(figure, figure.pose("T"))
    surface = paint_surface(figure, *gaussians)
    rng, skeleton = np.random.default_rng(0), dances.Skeleton(figure.joint_names, figure.parents, figure.joints)
    dance = Motion(24.0, (rng.normal(size=(5, 55, 3)) * .3).astype(np.float32), np.zeros((5, 3), np.float32))
    contents = {"gsac": avatar_bytes(figure), "bvh": dances.bvh_text(skeleton, dance).encode(),
                "gltf": glb_bytes(figure, surface, *gaussians), "fbx": avatar_fbx(figure, surface)}
    for kind, content in contents.items():
        (folder / f"whole.{kind}").write_bytes(content)
    return {kind: folder / f"whole.{kind}" for kind in contents}


@pytest.mark.parametrize("kind", ["bvh", "fbx", "gltf", "gsac"])
def test_fuzz_any_damage_is_a_sentence_or_is_read_within_time_and_memory(modules, whole, kind):
    count = MUTANTS // 4
    done = subprocess.run(["node", ATTACK.name, kind, str(count), "17", whole["gsac"], whole[kind]], cwd=modules,
                          capture_output=True, text=True, timeout=max(60, count))
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    print(done.stdout)
    assert not found["uncaught"], found["uncaught"][0]
    assert found["mutants"] == count and found["read"] > 0 < found["refused"]
    assert found["slow"] == 0 and found["slowest_s"] < LONGEST_S and found["peak_mb"] < MOST_MB


def open_files(modules, whole, folder, contents):
    """What the page says to each file, name -> content, one after the other: {said, seconds, mb}."""
    for name, content in contents.items():
        (folder / name).write_bytes(content if isinstance(content, bytes) else json.dumps(content).encode())
    done = subprocess.run(["node", "--max-old-space-size=700", "open.mjs", whole["gsac"], *(folder / name for name in contents)],
                          cwd=modules, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr[-2000:]
    return dict(zip(contents, map(json.loads, done.stdout.splitlines()), strict=True))


def assert_said(answers, words):
    for name, answer in answers.items():
        assert words[name] in answer["said"] and (name.endswith(".gsac") or answer["said"].startswith(name)), (name, answer)
        assert answer["seconds"] < LONGEST_S and answer["mb"] < MOST_MB, (name, answer)
        assert len(answer["said"]) < 1000


def changed(document, *keys, to):
    """The document with another value at a place."""
    copy = json.loads(json.dumps(document))
    holder = copy
    for key in keys[:-1]:
        holder = holder[key]
    holder[keys[-1]] = to
    return copy


@pytest.fixture(scope="module")
def document(whole):
    """A .gltf with its buffer inside."""
    content = whole["gltf"].read_bytes()
    end = 20 + struct.unpack_from("<I", content, 12)[0]
    found = json.loads(content[20:end])
    found["buffers"] = [{"byteLength": len(content) - end - 8,
                         "uri": "data:;base64," + base64.b64encode(content[end + 8:]).decode()}]
    return found


def test_what_is_odd_in_a_gltf_is_said_by_name(modules, whole, document, tmp_path):
    odd = {
        "nodes.gltf": (changed(document, "nodes", to={}), "nodes is not a list"),
        "joints.gltf": (changed(document, "skins", 0, "joints", to=None), "it holds no skeleton"),
        "far.gltf": (changed(document, "skins", 0, "joints", to=[10 ** 6]), "skins[0].joints names a node that is not there"),
        "percent.gltf": (changed(document, "buffers", 0, "uri", to="%"), "buffers[0] lies in %, which is no file's name"),
        "letters.gltf": (changed(document, "buffers", 0, "uri", to="data:;base64,?"), "buffers[0] is not base64"),
        "child.gltf": (changed(document, "nodes", 0, "children", to=["length"]), "nodes[0] has a child that is not there"),
        "children.gltf": (changed(document, "nodes", 0, "children", to="0"), "nodes[0].children is not a list"),
        "channel.gltf": (changed(document, "animations", 0, "channels", to=[None]), "animations[0] turns no joint"),
        "sampler.gltf": (changed(document, "animations", 0, "samplers", to="abc"), "animations[0].samplers is not a list"),
        "nothing.gltf": (changed(document, "animations", 0, to=None), "animations[0] is missing"),
        "input.gltf": (changed(document, "animations", 0, "samplers", 0, "input", to={"toString": 1}), "accessors[?] is missing"),
    }
    accessor = document["animations"][0]["samplers"][0]["input"]
    view = document["accessors"][accessor]["bufferView"]
    for key, value in (("componentType", {"toString": 1}), ("type", ["SCALAR"]), ("count", 1e7), ("count", -1), ("count", 1.5)):
        odd[f"{key} {value}.gltf".replace('"', "")] = (changed(document, "accessors", accessor, key, to=value),
                                                        f"accessors[{accessor}] ")
    for key, value in (("byteStride", 1e-7), ("byteStride", 1), ("byteOffset", "0"), ("byteOffset", {"toString": 1})):
        odd[f"{key} {value}.gltf"] = (changed(document, "bufferViews", view, key, to=value),
                                      f"accessors[{accessor}] has an odd offset or byteStride")
    assert_said(open_files(modules, whole, tmp_path, {name: content for name, (content, _) in odd.items()}),
                {name: words for name, (_, words) in odd.items()})


def named(count, **more):
    """A .gltf of that many nodes."""
    return {"asset": {}, "nodes": [{"name": f"n{i}", **more} for i in range(count)], "animations": [{}]}


def test_what_a_gltf_asks_for_has_a_bound(modules, whole, document, tmp_path):
    chain = named(3000)
    for i, node in enumerate(chain["nodes"][1:]):
        node["children"] = [i]
    animation = document["animations"][0]
    times = document["accessors"][animation["samplers"][0]["input"]]
    late = changed(document, "buffers", 0, "uri", to="data:;base64," + base64.b64encode(
        b"".join(struct.pack("<f", i * 1e30) for i in range(1, 100_000))).decode())
    late["accessors"] = [{**times, "bufferView": 0, "byteOffset": 0}, {**times, "bufferView": 0, "byteOffset": 0, "type": "VEC4"}]
    late["bufferViews"] = [{"buffer": 0}]
    late["animations"] = [{"samplers": [{"input": 0, "output": 1}],
                           "channels": [{"sampler": 0, "target": {"node": document["skins"][0]["joints"][0], "path": "rotation"}}]}]
    del late["skins"][0]["inverseBindMatrices"]
    bad = {
        "chain.gltf": (chain, "its nodes are not a tree"),
        "ring.gltf": (changed(named(2), "nodes", to=[{"children": [1]}, {"children": [0]}]), "its nodes are not a tree"),
        "nodes.gltf": (named(20_000), "1 frames of 20000 joints are more than this page takes"),
        "animations.gltf": (document | {"animations": [{}] * 5000}, "it holds 5000 animations; at most 256 are taken"),
        "parts.gltf": (b"[" + b"[]," * 1_000_000 + b"0]", "its JSON has more than 2000000 parts"),
        "deep.gltf": (b"[" * 1_900_000, "it is not glTF"),
        "channels.gltf": (document | {"animations": [animation | {"channels": animation["channels"] * 50}] * 2}, "taken"),
        "base64.gltf": (changed(document, "buffers", 0, "uri", to="data:;base64," + "A" * (16 << 20)), "taken"),
        "far away.gltf": (changed(document, "buffers", 0, "uri", to="x" * (4 << 20)), "it needs xxxxx"),
        "late.gltf": (late, "frames of "),
    }
    answers = open_files(modules, whole, tmp_path, {name: content for name, (content, _) in bad.items()})
    for name in ("channels.gltf", "base64.gltf"):
        assert answers[name]["said"] == "taken", "many channels that turn one joint cost no more than one, nor do letters"
        answers[name]["said"] = f"{name}: taken"
    assert_said(answers, {name: words for name, (_, words) in bad.items()})


def test_what_a_bvh_asks_for_has_a_bound(modules, whole, tmp_path):
    text = whole["bvh"].read_bytes()
    head, motion = text.split(b"MOTION")
    begin = head + b"MOTION\nFrames: 9\nFrame Time: 0.1\n"
    bad = {
        "lines.bvh": (b"\n" * (12 << 20), "the file ends where HIERARCHY is expected"),
        "words.bvh": (b"HIERARCHY ROOT " + b"a " * (4 << 20), "a joint's name has more than 100 words"),
        "name.bvh": (b"HIERARCHY ROOT " + b"aB" * (4 << 20), "the file ends where more is expected"),
        "known.bvh": (text.replace(b"left_hip", b"aB1" * (4 << 20)), "no joint for left_hip"),
        "row.bvh": (begin + b"1 " * (4 << 20), "more numbers; the skeleton has 168 channels"),
        "frames.bvh": (begin.replace(b"Frames: 9", b"Frames: 900000") + b"0 " * (4 << 20), "900000 frames of 55 joints"),
        "deep.bvh": (b"HIERARCHY ROOT a {" + b"JOINT a { " * 100_000, "more than 1000 joints or 200 generations"),
        "far.bvh": (re.sub(rb"OFFSET \S+", b"OFFSET 1e308", head) + b"MOTION" + motion, "somewhere that is not finite"),
    }
    assert_said(open_files(modules, whole, tmp_path, {name: content for name, (content, _) in bad.items()}),
                {name: words for name, (_, words) in bad.items()})


def test_what_an_fbx_asks_for_has_a_bound(modules, whole, tmp_path):
    count = 2_100_000
    values = MAGIC + struct.pack("<IIIIB", 7400, 27 + 13 + 7 + 2 * count, count, 2 * count, 7) + b"Objects" + b"C\0" * count
    objects = Node("Objects")
    for i in range(300):
        objects.add("AnimationStack", Long(i), f"{i}", "")
    bad = {"values.fbx": (values, "more than 2000000 nodes and values"),
           "stacks.fbx": (fbx_bytes([objects]), "it holds 300 animations; at most 256 are taken")}
    assert_said(open_files(modules, whole, tmp_path, {name: content for name, (content, _) in bad.items()}),
                {name: words for name, (_, words) in bad.items()})


def test_what_an_avatar_asks_for_has_a_bound(modules, whole, tmp_path):
    head, body = hostile.parts(whole["gsac"].read_bytes())
    again = {f"x{i}": {"offset": 0, "dtype": "f16", "shape": [4 << 20]} for i in range(900)}
    odd = json.loads(json.dumps(head))
    odd["blocks"]["gaussian.mu"]["dtype"] = {"toString": 1}
    bad = {"again.gsac": (hostile.built(head | {"blocks": again}, body + bytes(8 << 20)), "overlap"),
           "levels.gsac": (hostile.built(head | {"levels": head["levels"][:1] * 10_000}, body), "levels is empty or too long"),
           "odd.gsac": (hostile.built(odd, body), "block gaussian.mu has an unknown type")}
    assert_said(open_files(modules, whole, tmp_path, {name: content for name, (content, _) in bad.items()}),
                {name: words for name, (_, words) in bad.items()})


def test_an_avatar_with_other_joints_takes_no_motion_and_says_so(modules, whole, tmp_path):
    head, body = hostile.parts(whole["gsac"].read_bytes())
    other = json.loads(json.dumps(head).replace('"left_hip"', '"constructor"'))
    (tmp_path / "other.gsac").write_bytes(hostile.built(other, body))
    (answer,) = open_files(modules, {"gsac": tmp_path / "other.gsac"}, tmp_path, {"it.bvh": whole["bvh"].read_bytes()}).values()
    assert answer["said"] == "it.bvh: this avatar has no joint left_hip that a motion could turn"


def test_whatever_else_ends_a_reader_is_a_sentence_too_and_no_clip_is_left(modules, whole, tmp_path):
    script = """
        import { readFileSync } from "node:fs";
        import { addMotions } from "./motion_files.js";
        const avatar = { names: null, clips: {} }, file = new File([readFileSync(process.argv[1])], "it.bvh");
        await addMotions(avatar, [file]).catch((error) => console.log(error.constructor.name, error.message));
        console.log(Object.keys(avatar.clips).length);
    """
    done = subprocess.run(["node", "--input-type=module", "-e", script, whole["bvh"]], cwd=modules, capture_output=True, text=True)
    said, clips = done.stdout.splitlines()
    assert said.startswith("MotionError it.bvh: it cannot be read (") and clips == "0"
    assert "TypeError" in done.stderr, "the browser's console has the rest"
