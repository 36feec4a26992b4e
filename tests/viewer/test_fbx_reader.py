"""The page's reader of FBX, run by node: what it makes of a file is what ufbx makes of it, and no file ends it."""

import json
import shutil
import struct
import subprocess

import numpy as np
import pytest

from gsac.avatar.motion.fbx import read_fbx
from gsac.stages.export.fbx import SECOND, avatar_fbx
from gsac.stages.export.fbx_file import MAGIC, Long, Node, _property, fbx_bytes
from gsac.stages.export.stage import pose_gaussians
from gsac.stages.export.texture import paint_surface
from support.page_modules import copy_modules

pytest.importorskip("ufbx")
pytestmark = pytest.mark.skipif(not shutil.which("node"), reason="needs the Debian package nodejs")

READ = """
import { readFileSync } from "node:fs";
import { createInterface } from "node:readline";
import { readFbx } from "./fbx.js";
import { MotionError } from "./motion.js";
for await (const path of createInterface({ input: process.stdin })) {
  try {
    const motions = await readFbx(new Uint8Array(readFileSync(path)), path.split("/").at(-1));
    console.log(JSON.stringify(motions.map(({ name, source }) => ({
      name, names: source.names, parents: source.parents, fps: source.fps, rest: [source.restTurns, source.restPlaces],
      turns: Array.from(source.turnData), places: Array.from(source.placeData) }))));
  } catch (error) {
    console.log(JSON.stringify(error instanceof MotionError ? error.message : { crash: error.stack }));
  }
}
"""
CONSTANT, LINEAR, CUBIC = 0x2, 0x4, 0x8
AUTO, USER, CLAMP, PROGRESSIVE, EVEN_TIME, WEIGHTED = 0x100, 0x400, 0x1000, 0x4000, 0x2000, 0x3000000


@pytest.fixture(scope="module")
def read(tmp_path_factory):
    """Files -> what the page's reader makes of each: its motions, or the sentence that it says."""
    folder = copy_modules(tmp_path_factory.mktemp("modules"))
    (folder / "read.mjs").write_text(READ)

    def answer(*paths):
        done = subprocess.run(["node", "--max-old-space-size=256", "read.mjs"], cwd=folder, capture_output=True, text=True,
                              input="\n".join(map(str, paths)), timeout=60)
        assert done.returncode == 0, done.stderr
        answers = [json.loads(line) for line in done.stdout.splitlines()]
        assert len(answers) == len(paths) and not [a for a in answers if "crash" in a]
        return answers

    return answer


def angle(got, want):
    """Largest angle, degrees, between quaternions (..., 4)."""
    return np.degrees(2 * np.arccos(np.minimum(np.abs((np.asarray(got) * want).sum(-1)), 1))).max()


def assert_as_ufbx(motion, path, degrees=0.1):
    want, P = read_fbx(path), len(motion["names"])
    order = [motion["names"].index(name) for name in want.names]
    assert [order[p] if p >= 0 else -1 for p in want.parents] == [motion["parents"][j] for j in order]
    turns, places = (np.array(motion[name]).reshape(-1, P, n)[:, order] for name, n in (("turns", 4), ("places", 3)))
    assert motion["fps"] == want.fps and turns.shape == want.turns.shape
    size = np.abs(want.places).max()
    assert angle(turns, want.turns) < degrees and np.abs(places - want.places).max() < 1e-3 * size
    rest_turns, rest_places = (np.array(a)[order] for a in motion["rest"])
    assert angle(rest_turns, want.rest_turns) < degrees and np.abs(rest_places - want.rest_places).max() < 1e-5 * size


class Scene:
    """A skeleton and its animations, made by hand."""

    def __init__(self, seconds=1.0):
        self.objects, self.connections, self.last = Node("Objects"), Node("Connections"), 10
        self.head, self.ticks, self.seconds = Node("FBXHeaderExtension"), SECOND, seconds

    def add(self, kind, name, what):
        self.last += 1
        return self.objects.add(kind, Long(self.last), f"{name}\0\x01{kind}", what)

    def connect(self, child, parent, at=None):
        above = Long(0) if parent is None else parent.values[0]
        self.connections.add("C", "OO" if at is None else "OP", child.values[0], above, *([] if at is None else [at]))

    def bone(self, name, parent, *properties):
        model = self.add("Model", name, "LimbNode")
        model.properties(*properties)
        self.connect(self.add("NodeAttribute", name, "LimbNode"), model)
        self.connect(model, parent)
        return model

    def take(self, name, begin=0.0):
        stack = self.add("AnimationStack", name, "")
        stack.properties(("LocalStart", "KTime", "Time", "", Long(round(begin * self.ticks))),
                         ("LocalStop", "KTime", "Time", "", Long(round((begin + self.seconds) * self.ticks))))
        layer = self.add("AnimationLayer", name, "")
        self.connect(layer, stack)
        return layer

    def curve(self, layer, model, track, axes, seconds, values, flags=LINEAR, data=None, again=None):
        """values: (K, number of axes); data: (K, 4) slopes and weights of keys that all have their own."""
        mover = self.add("AnimationCurveNode", track[4], "")
        mover.properties(*((f"d|{axis}", "Number", "", "A", 10.0 + k) for k, axis in enumerate("XYZ")))
        self.connect(mover, layer)
        self.connect(mover, model, track)
        times = np.rint(np.asarray(seconds) * self.ticks).astype(np.int64)
        for axis, row in zip(axes, np.transpose(values), strict=True):
            curve = self.add("AnimationCurve", "", "")
            attributes = np.zeros((1, 4)) if data is None else data
            for field, value in (("KeyTime", times), ("KeyValueFloat", row.astype(np.float32)),
                                 ("KeyAttrFlags", np.full(len(attributes), flags, np.int32)),
                                 ("KeyAttrDataFloat", attributes.astype(np.float32).reshape(-1)),
                                 ("KeyAttrRefCount", np.full(len(attributes), len(times) // len(attributes), np.int32))):
                curve.add(field, value)
            if again:
                curve.add("Post-Extrapolation").add("Type", ord(again))
            self.connect(curve, mover, f"d|{axis}")

    def bytes(self, wide=False):
        nodes = [self.head, Node("GlobalSettings"), self.objects, self.connections]
        return wide_bytes(nodes) if wide else fbx_bytes(nodes)


def wide_bytes(nodes):
    """A file of version 7.7, whose nodes have 64-bit heads."""
    out = bytearray(MAGIC + struct.pack("<I", 7700))

    def write(node):
        start, name, properties = len(out), node.name.encode(), b"".join(map(_property, node.values))
        out.extend(bytes(24) + bytes([len(name)]) + name + properties)
        for child in node.children:
            write(child)
        if node.children or not node.values:
            out.extend(bytes(25))
        struct.pack_into("<QQQ", out, start, len(out), len(node.values), len(properties))

    for node in nodes:
        write(node)
    return bytes(out + bytes(25))


def turn(name, *degrees):
    return (name, "Vector3D", "Vector", "", *map(float, degrees))


def arm(order=0):
    """Two bones that turn, the second about odd axes and pivots."""
    scene = Scene()
    hips = scene.bone("hips", None, turn("Lcl Translation", 0, 90, 0), turn("PreRotation", -90, 5, 0))
    hand = scene.bone("hand", hips, turn("Lcl Translation", 10, 0, 3), turn("Lcl Rotation", 20, -30, 70),
                      ("RotationOrder", "enum", "", "", order), turn("PreRotation", 10, 20, 30), turn("PostRotation", 5, -40, 8),
                      turn("RotationPivot", 1, 2, 3), turn("RotationOffset", 3, 0, 1), turn("ScalingPivot", 0, 2, 0),
                      turn("ScalingOffset", 0, 0, 1), turn("Lcl Scaling", 1.1, 1.2, 0.9))
    return scene, hips, hand


@pytest.fixture(scope="module")
def own(figure, tmp_path_factory):
    path = tmp_path_factory.mktemp("fbx") / "own.fbx"
    path.write_bytes(avatar_fbx(figure, paint_surface(figure, *pose_gaussians(figure, figure.pose("T")))))
    return path


def test_our_own_export_is_the_motion_that_ufbx_reads_the_longest_first(read, own, figure):
    (motions,) = read(own)
    assert [motion["name"] for motion in motions] == sorted(figure.clips, key=lambda name: -len(figure.clips[name].rotation))
    assert_as_ufbx(motions[0], own, 0.01)


@pytest.mark.parametrize("wide", [False, True], ids=["32 bits", "64 bits"])
def test_turns_in_any_order_before_after_and_about_pivots_are_as_ufbx_has_them(read, tmp_path, wide):
    paths, at = [], np.linspace(0, 1, 9)
    for order in range(6):
        scene, hips, hand = arm(order)
        layer = scene.take("turn")
        scene.curve(layer, hand, "Lcl Rotation", "XYZ", at, np.random.default_rng(order).uniform(-80, 80, (9, 3)))
        scene.curve(layer, hips, "Lcl Translation", "XZ", at, np.random.default_rng(9).uniform(-9, 9, (9, 2)))
        paths.append(tmp_path / f"order {order}.fbx")
        paths[-1].write_bytes(scene.bytes(wide))
    for path, motions in zip(paths, read(*paths), strict=True):
        assert [motion["name"] for motion in motions] == [path.stem], "the only motion of a file has the file's name"
        assert_as_ufbx(motions[0], path, 0.01)


@pytest.mark.parametrize("flags", [CONSTANT, CONSTANT | 0x100, LINEAR, CUBIC | USER, CUBIC | AUTO, CUBIC | AUTO | CLAMP,
                                   CUBIC | AUTO | PROGRESSIVE, CUBIC | AUTO | EVEN_TIME, CUBIC | USER | WEIGHTED, CUBIC | 0x200])
def test_a_curve_between_few_keys_is_as_ufbx_draws_it(read, tmp_path, flags):
    rng, scene = np.random.default_rng(4), arm()
    data = rng.uniform(-60, 60, (6, 4))
    if flags & 0x200:
        data = rng.uniform(-.5, .5, (6, 4))
    elif flags & AUTO:
        data[:] = 0
    data[:, 2] = np.full(6, 7000 << 16 | 1500, np.uint32).view(np.float32) if flags & WEIGHTED else data[:, 2]
    at, values = [.05, .2, .3, .6, .62, .9], rng.uniform(-60, 60, (6, 3))
    values[2] = values[1]
    scene[0].curve(scene[0].take("few"), scene[2], "Lcl Rotation", "XYZ", at, values, flags, data)
    (tmp_path / "few.fbx").write_bytes(scene[0].bytes())
    ((motion,),) = read(tmp_path / "few.fbx")
    assert_as_ufbx(motion, tmp_path / "few.fbx")


@pytest.mark.parametrize("again", "CKRAM")
def test_a_curve_goes_on_after_its_keys_as_ufbx_lets_it(read, tmp_path, again):
    scene, _, hand = arm()
    scene.curve(scene.take("again", 0.01), hand, "Lcl Rotation", "XY", [0.02, .17, .3], [[0, 1], [20, -15], [5, 9]], again=again)
    (tmp_path / "again.fbx").write_bytes(scene.bytes())
    ((motion,),) = read(tmp_path / "again.fbx")
    assert_as_ufbx(motion, tmp_path / "again.fbx")


def test_time_may_be_counted_in_the_new_ticks(read, tmp_path):
    scene, _, hand = arm()
    scene.ticks = 141120000
    scene.head.add("FBXHeaderVersion", 1004)
    scene.head.add("OtherFlags").add("TCDefinition", 0)
    scene.curve(scene.take("new"), hand, "Lcl Rotation", "X", [0, .5, 1], [[0], [60], [10]])
    (tmp_path / "new.fbx").write_bytes(scene.bytes())
    ((motion,),) = read(tmp_path / "new.fbx")
    assert_as_ufbx(motion, tmp_path / "new.fbx")
    assert len(motion["turns"]) == 31 * 2 * 4


def miscounted(times, count):
    """A file with a curve of these times, int64, whose packed array says that it holds `count`."""
    scene, _, hand = arm()
    scene.curve(scene.take("odd"), hand, "Lcl Rotation", "X", [0, 1], [[0], [1]])
    (field,) = (field for node in scene.objects.children for field in node.children if field.name == "KeyTime")
    field.values = [times]
    whole = bytearray(scene.bytes())
    at = whole.index(b"KeyTimel") + len("KeyTimel")
    assert struct.unpack_from("<II", whole, at) == (len(times), 1)
    struct.pack_into("<I", whole, at, count)
    return bytes(whole)


def layered():
    scene, _, hand = arm()
    layer = scene.take("two")
    other = scene.add("AnimationLayer", "more", "")
    scene.connect(other, next(node for node in scene.objects.children if node.name == "AnimationStack"))
    for one in (layer, other):
        scene.curve(one, hand, "Lcl Rotation", "X", [0, 1], [[0], [1]])
    return scene.bytes()


def oddly_named():
    scene, _, hand = arm()
    hand.add("constructor").add("toString", 1)
    return scene.bytes()


def ring():
    scene, hips, hand = arm()
    scene.curve(scene.take("ring"), hand, "Lcl Rotation", "X", [0, 1], [[0], [1]])
    scene.connect(hips, hand)
    return scene.bytes()


def long():
    scene, _, hand = arm()
    scene.seconds = 1e6
    scene.curve(scene.take("long"), hand, "Lcl Rotation", "X", [0, 1], [[0], [1]])
    return scene.bytes()


def test_what_is_wrong_with_a_file_is_one_sentence_and_a_small_one_takes_no_memory(read, tmp_path, own):
    whole = own.read_bytes()
    noise, zeros = np.random.default_rng(1).integers(0, 2**62, 40_000), np.zeros(4 << 20, np.int64)
    bad = {
        "empty.fbx": (b"", "it is not FBX"),
        "text.fbx": (b"; FBX 7.4.0 project file\nFBXHeaderExtension: {", "it is FBX as text"),
        "old.fbx": (MAGIC + struct.pack("<I", 6100) + bytes(99), "it is FBX of version 6.1; version 7 is read here"),
        "still.fbx": (arm()[0].bytes(), "it holds no animation"),
        "cut.fbx": (whole[:len(whole) // 2], "was the file cut off?"),
        "past.fbx": (MAGIC + struct.pack("<IIII", 7400, 2**31, 0, 0) + b"\0" * 50, "the node at byte 27 ends outside"),
        "values.fbx": (MAGIC + struct.pack("<IIIIB", 7400, 90, 2**32 - 1, 40, 7) + b"Objects" + b"C" * 99, "a value at byte "),
        "more.fbx": (miscounted(zeros, 2**31), "a curve's keys are not as many as it says"),
        "bomb.fbx": (miscounted(zeros, 100), "a curve's keys cannot be unpacked; is the file whole?"),
        "short.fbx": (miscounted(noise, 50_000), "a curve's keys cannot be unpacked; is the file whole?"),
        "huge.fbx": (miscounted(noise, 40_000_000), "its curves have more keys than this page takes"),
        "unequal.fbx": (miscounted(zeros[:100], 100), "the keys of a curve do not fit each other"),
        "names.fbx": (oddly_named(), "it holds no animation"),
        "layers.fbx": (layered(), "two is mixed from 2 layers; bake it to one"),
        "ring.fbx": (ring(), "its nodes are not a tree"),
        "long.fbx": (long(), "30000001 frames of 2 joints are more than this page takes"),
    }
    for name, (content, _) in bad.items():
        (tmp_path / name).write_bytes(content)
    for (name, (_, words)), said in zip(bad.items(), read(*(tmp_path / name for name in bad)), strict=True):
        assert isinstance(said, str), (name, said)
        assert said.startswith(f"{name}: ") and words in said, said


def test_fuzz_any_damage_to_an_fbx_is_a_sentence_or_a_motion(read, tmp_path):
    scene, hips, hand = arm()
    layer = scene.take("whole")
    scene.curve(layer, hand, "Lcl Rotation", "XYZ", np.linspace(0, 1, 20), np.random.default_rng(1).normal(size=(20, 3)))
    whole, rng, paths = scene.bytes(), np.random.default_rng(2), []
    for k in range(400):
        spoilt = bytearray(whole)
        for at in rng.integers(0, len(spoilt), rng.integers(1, 4)):
            spoilt[at] = rng.choice([0, 1, 127, 255, rng.integers(256)])
        paths.append(tmp_path / f"{k}.fbx")
        paths[-1].write_bytes(spoilt[:rng.integers(len(spoilt))] if k % 10 == 0 else spoilt)
    answers = read(*paths)
    assert {type(answer) for answer in answers} == {str, list}
