"""Motion files dropped on viewer.html: the page's readers and retargeting give what Python's give, and it plays."""

import base64
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.avatar.motion.bvh import read_bvh
from gsac.avatar.motion.files import read_motion
from gsac.avatar.motion.names import match
from gsac.avatar.motion.retarget import retarget
from gsac.avatar.motion.source import Motion
from gsac.benchmarks.viewer import browser as chromium
from gsac.stages.export.fbx import avatar_fbx
from gsac.stages.export.glb import glb_bytes
from gsac.stages.export.stage import pose_gaussians
from gsac.stages.export.texture import paint_surface
from gsac.viewer.page import page_bytes
from support import dances
from support.page_modules import expose

FOOTAGE = Path(__file__).parents[3] / "shared" / "footage" / "motion"


pytestmark = [pytest.mark.slow,
              pytest.mark.skipif(chromium.find_chromium() is None, reason="needs the Debian package chromium")]


@pytest.fixture(scope="module")
def browser():
    it = chromium.Browser(480, 480)
    yield it
    it.close()


@pytest.fixture(scope="module")
def page(browser, figure, tmp_path_factory):
    """The small figure: software GL draws it many times a second."""
    path = tmp_path_factory.mktemp("page") / "viewer.html"
    path.write_bytes(page_bytes(avatar_bytes(figure)))
    browser.open(path.as_uri())
    return browser


@pytest.fixture(scope="module")
def skeleton(figure):
    return dances.Skeleton(figure.joint_names, figure.parents, figure.joints)


def dance(figure, T=12):
    """Starts in the T-pose, moves every joint, then goes to the left; the right arm more than the left."""
    rng, phase = np.random.default_rng(3), np.linspace(0, 1, T)[:, None, None]
    rotation = rng.normal(size=(1, 55, 3)) * .3 * np.sin(np.pi * phase)
    rotation[:, figure.joint_names.index("right_shoulder"), 2] -= 1.2 * phase[:, 0, 0]
    return Motion(24.0, rotation.astype(np.float32), (phase[:, 0] * (.4, 0, .2)).astype(np.float32))


def drop(page, *paths):
    page.run("document.getElementById('note').hidden = true")
    data = {"items": [], "files": [str(path) for path in paths], "dragOperationsMask": 1}
    for kind in ("dragEnter", "dragOver", "drop"):
        page.call("Input.dispatchDragEvent", type=kind, x=200, y=150, data=data)
    page.until("!document.getElementById('note').hidden && document.getElementById('drop').hidden")
    assert page.errors == []
    return page.run("document.getElementById('note').textContent")


def clip_of(page, name):
    """A dropped clip as a Motion."""
    fps, rotation, transl = page.run(
        f"(({{fps, rotation, transl}}) => [fps, Array.from(rotation), Array.from(transl)])(gsac.avatar.clips[{json.dumps(name)}])")
    return Motion(fps, np.array(rotation).reshape(-1, 55, 3), np.array(transl).reshape(-1, 3))


def assert_same(got, want, degrees=0.05, metres=2e-4):
    assert got.fps == pytest.approx(want.fps, rel=1e-6)
    turn = Rotation.from_rotvec(got.rotation.reshape(-1, 3)).inv() * Rotation.from_rotvec(want.rotation.reshape(-1, 3))
    assert np.degrees(turn.magnitude()).max() < degrees
    np.testing.assert_allclose(got.transl, want.transl, atol=metres)


def onto(figure, source):
    return retarget(source, figure.joint_names, figure.parents, figure.joints)


@pytest.mark.parametrize(("unit", "world", "name"), [
    (1, None, str), (100, dances.Z_UP, dances.mixamo), (39.37, Rotation.from_rotvec([0, 2, 0]), dances.mixamo)])
def test_a_dropped_bvh_plays_as_python_retargets_it(page, figure, skeleton, tmp_path, unit, world, name):
    text = dances.bvh_text(skeleton, dance(figure), [name(n) for n in figure.joint_names], unit, world=world)
    path = tmp_path / f"dance {unit}.bvh"
    path.write_text(text)
    assert drop(page, path) == f"dance {unit}: put on this avatar"
    assert page.run("gsac.playing.clip") == f"dance {unit}"
    assert_same(clip_of(page, f"dance {unit}"), onto(figure, read_bvh(path)))
    page.until("gsac.clock > 0.1")
    assert page.run("document.querySelector('#poses button[aria-pressed=true]').textContent") == f"dance {unit}"


def test_a_motion_that_is_called_as_a_pose_leaves_the_poses_button_alone(page, figure, skeleton, tmp_path):
    (tmp_path / "A.bvh").write_text(dances.bvh_text(skeleton, dance(figure)))
    assert drop(page, tmp_path / "A.bvh") == "A 2: put on this avatar"
    page.run("document.querySelector('#poses [data-pose=A]').click()")
    assert page.run("gsac.playing") == {"pose": "A"}


@pytest.mark.footage
@pytest.mark.parametrize("name", ["dab", "jumping_jacks", "wave_hello"])
def test_a_recorded_motion_plays_as_python_retargets_it(page, figure, name):
    path = FOOTAGE / f"{name}.bvh"
    if not path.is_file():
        pytest.skip("the recorded motions are not here")
    drop(page, path)
    assert_same(clip_of(page, name), onto(figure, read_bvh(path)), degrees=0.1)


def test_the_mesh_stands_where_python_puts_it_and_a_raised_right_arm_is_at_the_left(page, figure, skeleton, tmp_path):
    moved = dance(figure)
    path = tmp_path / "arm.bvh"
    path.write_text(dances.bvh_text(skeleton, moved, unit=100))
    drop(page, path)
    page.run("gsac.seek(11 / 24), gsac.paused = true, gsac.step(0), gsac.frame(), gsac.draw();"
             "for (const id of ['note', 'status']) document.getElementById(id).hidden = true")
    got = np.array(page.run("Array.from(gsac.skin.vertices)")).reshape(-1, 3)
    want = onto(figure, read_bvh(path))
    np.testing.assert_allclose(got, figure.posed(want.rotation[11]) + want.transl[11], atol=2e-4)
    picture = page.picture()[:300].astype(int)
    blue = (picture[..., 2] > picture[..., :2].max(-1) + 60) & (picture[..., 1] < 90)
    red = picture[..., 0] > picture[..., 1:].max(-1) + 60
    assert blue.any() and red.any()
    (blue_y, blue_x), (red_y, red_x) = (np.array(np.nonzero(m)).mean(1) for m in (blue, red))
    assert blue_x < red_x and blue_y < red_y


def test_the_camera_goes_along_with_a_motion_that_walks_away(page, figure, skeleton, tmp_path):
    away = Motion(10.0, np.zeros((21, 55, 3)), np.linspace(0, 6, 21)[:, None] * (1, 0, 0))
    (tmp_path / "away.bvh").write_text(dances.bvh_text(skeleton, away))
    drop(page, tmp_path / "away.bvh")
    page.run("gsac.seek(2), gsac.paused = true; for (let i = 0; i < 40; i++) gsac.step(0.25); gsac.draw()")
    assert page.run("gsac.camera.walked[0]") == pytest.approx(6, abs=0.01)
    lit = np.abs(page.picture()[150].astype(int) - (0x2B, 0x30, 0x3B)).max(-1) > 40
    assert 200 < np.flatnonzero(lit).mean() < 280


def test_our_own_glb_dropped_gives_its_clips_back(page, figure, tmp_path):
    rest = pose_gaussians(figure, figure.pose("T"))
    (tmp_path / "own.glb").write_bytes(glb_bytes(figure, paint_surface(figure, *rest), *rest))
    assert drop(page, tmp_path / "own.glb") == "wave 2, walk 2: put on this avatar"
    for name in ("wave", "walk"):
        got, clip = clip_of(page, f"{name} 2"), figure.clips[name]
        seconds = np.arange(0, len(clip.rotation), 2) / clip.fps
        at = np.rint(seconds * got.fps).astype(int)
        assert np.abs(at / got.fps - seconds).max() < 1e-6, "every second key of 20 a second is every third of 30"
        want = np.zeros((len(at), 55, 3))
        want[:, [figure.joint_names.index(j) for j in clip.joints]] = clip.rotation[::2]
        turn = (Rotation.from_rotvec(got.rotation[at, 1:].reshape(-1, 3)).inv()
                * Rotation.from_rotvec(want[:, 1:].reshape(-1, 3)))
        assert np.degrees(turn.magnitude()).max() < 0.1


def test_a_dropped_fbx_plays_as_render_plays_it(page, figure, tmp_path):
    pytest.importorskip("ufbx")
    path = tmp_path / "own.fbx"
    path.write_bytes(avatar_fbx(figure, paint_surface(figure, *pose_gaussians(figure, figure.pose("T")))))
    names = drop(page, path).removesuffix(": put on this avatar").split(", ")
    assert [name.split()[0] for name in names] == ["wave", "walk"] and page.run("gsac.playing.clip") == names[0]
    assert_same(clip_of(page, names[0]), read_motion(path, figure.joint_names, figure.parents, figure.joints), degrees=0.1)


def gltf_of(source, step="LINEAR"):
    """A .gltf with its buffer inside: nodes at the rest pose of a Source, one animation of all its rotations and the hips."""
    data, views, accessors = bytearray(), [], []

    def add(array, kind):
        raw = np.ascontiguousarray(array, "<f4")
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": raw.nbytes})
        accessors.append({"bufferView": len(views) - 1, "componentType": 5126, "count": len(raw), "type": kind})
        data.extend(raw.tobytes())
        return len(accessors) - 1

    P, T = len(source.names), len(source.turns)
    local = np.empty((T, P, 4))
    for j, p in enumerate(source.parents):
        turn = Rotation.from_quat(source.turns[:, j])
        local[:, j] = (turn if p < 0 else Rotation.from_quat(source.turns[:, p]).inv() * turn).as_quat()
    times = add(np.arange(T) / source.fps, "SCALAR")
    samplers = [{"input": times, "output": add(local[:, j], "VEC4"), "interpolation": step} for j in range(P)]
    samplers.append({"input": times, "output": add(source.places[:, 0], "VEC3"), "interpolation": step})
    channels = [{"sampler": j, "target": {"node": j, "path": "rotation"}} for j in range(P)]
    channels.append({"sampler": P, "target": {"node": 0, "path": "translation"}})
    rest = source.rest_places
    nodes = [{"name": n, "translation": (rest[j] - (rest[p] if p >= 0 else 0)).tolist(),
              **({"children": c} if (c := np.flatnonzero(source.parents == j).tolist()) else {})}
             for j, (n, p) in enumerate(zip(source.names, source.parents, strict=True))]
    uri = "data:application/octet-stream;base64," + base64.b64encode(bytes(data)).decode()
    return {"asset": {"version": "2.0"}, "nodes": nodes, "bufferViews": views, "accessors": accessors,
            "animations": [{"name": "dance", "samplers": samplers, "channels": channels}],
            "buffers": [{"byteLength": len(data), "uri": uri}]}


def test_a_gltf_is_the_same_motion_as_the_bvh(page, figure, skeleton, tmp_path):
    moved = dance(figure, 25)
    moved.fps = 30.0
    source = dances.read_text(dances.bvh_text(skeleton, moved, [dances.mixamo(n) for n in figure.joint_names]))
    (tmp_path / "it.gltf").write_text(json.dumps(gltf_of(source)))
    assert drop(page, tmp_path / "it.gltf") == "dance: put on this avatar"
    assert_same(clip_of(page, "dance"), onto(figure, source), degrees=0.1)


def test_a_gltf_whose_buffer_lies_beside_it_needs_both_files_dropped_together(page, figure, skeleton, tmp_path):
    document = gltf_of(dances.read_text(dances.bvh_text(skeleton, dance(figure))))
    (tmp_path / "it.bin").write_bytes(base64.b64decode(document["buffers"][0]["uri"].split(",")[1]))
    document["buffers"][0]["uri"] = "it.bin"
    (tmp_path / "it.gltf").write_text(json.dumps(document))
    assert "it needs it.bin; drop both files together" in drop(page, tmp_path / "it.gltf")
    assert "put on this avatar" in drop(page, tmp_path / "it.gltf", tmp_path / "it.bin")


def test_what_is_wrong_with_a_file_is_said_on_the_page_and_what_plays_goes_on(page, figure, skeleton, tmp_path):
    playing, text = page.run("gsac.playing"), dances.bvh_text(skeleton, dance(figure))
    lines = text.splitlines()
    document = gltf_of(dances.read_text(text))
    bad = {
        "odd.bvh": ("\n".join([*lines[:-2], "1 2 x"]), f"odd.bvh, line {len(lines) - 1}: 3 numbers; the skeleton has 168 channels"),
        "cut.bvh": (text[:len(text) // 2], "cut.bvh, line "),
        "dog.bvh": (text.replace("left_elbow", "left_paw"), "dog.bvh: no joint for left_elbow"),
        "picture.txt": ("x", "picture.txt: a motion is read from .bvh, .fbx, .glb, .gltf and .vrma"),
        "text.fbx": ("; FBX 7.4.0 project file", "text.fbx: it is FBX as text; binary FBX is read here"),
        "empty.glb": ("", "empty.glb: it is not glTF"),
        "still.gltf": (json.dumps({"asset": {"version": "2.0"}}), "still.gltf: it holds no animation"),
        "short.gltf": (json.dumps(document | {"buffers": [{"uri": "data:a;base64,AAAA"}]}), "accessors[0] ends after its buffer"),
        "loop.gltf": (json.dumps(document | {"nodes": [{"children": [0]}]}), "loop.gltf: its nodes are not a tree"),
        "table.gltf": (json.dumps(document | {"nodes": {}}), "table.gltf: nodes is not a list"),
        "percent.gltf": (json.dumps(document | {"buffers": [{"uri": "%"}]}), "percent.gltf: buffers[0] lies in %"),
    }
    for name, (content, words) in bad.items():
        (tmp_path / name).write_text(content)
        assert words in drop(page, tmp_path / name), name
    assert page.run("gsac.playing") == playing and page.errors == []


def test_fuzz_any_damage_to_a_motion_is_a_motion_error_or_a_motion(page, figure, skeleton):
    text = dances.bvh_text(skeleton, dance(figure, 2))
    document = gltf_of(dances.read_text(text))
    expose(page, "MotionError", "readBvh", "readGltf", "retarget")
    kinds = page.run(f"const bvhWhole = {json.dumps(text)}, gltfWhole = {json.dumps(json.dumps(document))};" + """(() => {
      let seed = 7;
      const random = (n) => { seed = (seed * 48271) % 2147483647; return seed % n; };
      const spoilt = (text) => {
        const at = random(text.length), glyphs = '{}[]"0-9e.:,xZ \\n';
        const noise = Array.from({ length: random(5) }, () => glyphs[random(glyphs.length)]).join('');
        return text.slice(0, at) + noise + text.slice(at + random(9));
      };
      const kind = (act) => {
        try { act(); return 'motion'; } catch (e) { return e instanceof MotionError ? 'named' : 'crash: ' + e.stack; }
      };
      const out = {};
      for (let i = 0; i < 250; i++) {
        const bvh = spoilt(bvhWhole), gltf = new TextEncoder().encode(spoilt(gltfWhole));
        for (const k of [kind(() => retarget(readBvh(bvh, 'a'), gsac.avatar, 'a')),
          kind(() => readGltf(gltf, 'b').map((m) => retarget(m.source, gsac.avatar, 'b')))]) out[k] = (out[k] || 0) + 1;
      }
      return out;
    })()""")
    assert set(kinds) == {"motion", "named"}


def test_names_are_matched_as_python_does(page, figure):
    expose(page, "matchNames")
    lists = [[dances.mixamo(n) for n in figure.joint_names], list(figure.joint_names),
             ["Bip01 L Thigh", "Bip01 L Calf", "J_Bip_L_UpperArm", "DEF-shin.L", "index_03_l", "LeftHandIndex1", "f_pinky.02.R",
              "leftThumbProximal", "lForearmBend", "Head", "Neck1", "hand_r"]]
    for names in lists:
        assert page.run(f"matchNames({json.dumps(names)})") == match(names)
