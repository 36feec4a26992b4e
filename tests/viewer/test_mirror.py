"""Mirror me: what a face and a body network see of the user, the avatar does as in a mirror, and nothing leaves the page."""

import base64
import gzip
import io
import json
import subprocess
import tarfile

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.benchmarks.viewer import browser as chromium
from gsac.viewer.page import page_bytes
from support.figure import skeleton
from support.page_modules import copy_modules

SIZE = 400
CAMERA = ["--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream"]
BUNDLE = """
const kind = (answer) => class {
  static async createFromOptions(set, options) {
    if (!set.wasmBinaryPath.endsWith("/vision_wasm_internal.wasm")) throw new Error("MediaPipe's loader asks for the name");
    const loaded = await Promise.all([fetch(set.wasmLoaderPath), fetch(set.wasmBinaryPath)]);
    window.asked = [...(window.asked ?? []), [...await Promise.all(loaded.map((it) => it.text())),
      new TextDecoder().decode(options.baseOptions.modelAssetBuffer), options.runningMode]];
    return new this();
  }
  detectForVideo(video) {
    window.looked = [video.videoWidth, video.videoHeight];
    return answer;
  }
};
const points = Array.from({ length: 33 }, () => ({ x: 0, y: 0, z: 0, visibility: 0 }));
const put = (i, x, y, z) => { points[i] = { x, y, z, visibility: 1 }; };
put(11, 0.2, -0.5, 0); put(12, -0.2, -0.5, 0); put(23, 0.1, 0, 0); put(24, -0.1, 0, 0);
put(12 + 2, -0.2, -0.8, 0); put(12 + 4, -0.2, -1.1, 0);
export const FaceLandmarker = kind({ faceBlendshapes: [{ categories: [{ categoryName: "jawOpen", score: 0.8 }] }] });
export const PoseLandmarker = kind({ worldLandmarks: [points] });
"""
"""Stands in for MediaPipe's package: an open mouth, and the right arm straight up."""


def ask(tmp_path, script):
    """What a script that imports the modules prints as JSON."""
    copy_modules(tmp_path)
    (tmp_path / "ask.js").write_text('import { mirrorArms, mirrorFace, mirrorHead } from "./mirror_pose.js";\n' + script)
    done = subprocess.run(["node", tmp_path / "ask.js"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.slow
def test_left_and_right_of_the_face_are_swapped_and_only_the_avatars_actions_are_taken(tmp_path):
    got = ask(tmp_path, """console.log(JSON.stringify(mirrorFace([{ categoryName: "_neutral", score: 1 },
      { categoryName: "eyeBlinkLeft", score: 0.7 }, { categoryName: "jawOpen", score: 0.2 },
      { categoryName: "mouthRight", score: 0.4 }, { categoryName: "tongueOut", score: 1 }],
      ["jawOpen", "eyeBlinkLeft", "eyeBlinkRight", "mouthLeft", "mouthRight"])));""")
    assert got == {"eyeBlinkRight": 0.7, "jawOpen": 0.2, "mouthLeft": 0.4}


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [(20, 0, 0), (0, 30, 0), (0, 0, 15), (10, -25, 5)])
def test_the_head_turns_as_its_mirror_image(tmp_path, degrees):
    turn = Rotation.from_rotvec(degrees, degrees=True)
    matrix = np.eye(4)
    matrix[:3, :3] = 7 * turn.as_matrix()
    got = ask(tmp_path, f"console.log(JSON.stringify(mirrorHead({matrix.T.ravel().tolist()})));")
    whole = Rotation.from_rotvec(got["neck"], degrees=True) * Rotation.from_rotvec(got["head"], degrees=True)
    flip = np.diag([-1, 1, 1])
    np.testing.assert_allclose(whole.as_matrix(), flip @ turn.as_matrix() @ flip, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("body", [0, 35, -50])
def test_the_arms_point_where_the_users_do_in_the_mirror_however_the_user_stands(tmp_path, figure, body):
    rng = np.random.default_rng(body % 7)
    names, _, joints = skeleton()
    points = np.zeros((33, 3))
    points[[11, 12, 23, 24]] = (.2, .5, 0), (-.2, .5, 0), (.1, 0, 0), (-.1, 0, 0)
    arms = {side: rng.normal(size=(2, 3)) for side in ("left", "right")}
    for (upper, fore), shoulder in zip(arms.values(), (11, 12), strict=True):
        points[shoulder + 2] = points[shoulder] + .3 * upper / np.linalg.norm(upper)
        points[shoulder + 4] = points[shoulder + 2] + .25 * fore / np.linalg.norm(fore)
    points = Rotation.from_euler("y", body, degrees=True).apply(points) * (1, -1, -1)
    seen = [dict(zip("xyz", p, strict=True), visibility=1) for p in points.tolist()]
    avatar = f"{{ names: {json.dumps(names)}, joints: Float32Array.from({joints.ravel().tolist()}) }}"
    got = ask(tmp_path, f"console.log(JSON.stringify(mirrorArms({json.dumps(seen)}, {avatar})));")
    pose = np.zeros((55, 3), np.float32)
    for joint, turn in got.items():
        pose[names.index(joint)] = np.radians(turn)
    from gsac.avatar.skinning import joint_transforms
    bones = joint_transforms(pose[None], figure.joints, figure.parents)[0]
    placed = np.einsum("jab,jb->ja", bones[:, :, :3], figure.joints) + bones[:, :, 3]
    for mine, theirs in (("left", "right"), ("right", "left")):
        at = [placed[names.index(f"{mine}_{joint}")] for joint in ("shoulder", "elbow", "wrist")]
        for (start, end), want in zip(((0, 1), (1, 2)), arms[theirs], strict=True):
            along = (at[end] - at[start]) / np.linalg.norm(at[end] - at[start])
            np.testing.assert_allclose(along, want / np.linalg.norm(want) * (-1, 1, 1), atol=1e-4)


@pytest.mark.slow
def test_an_arm_out_of_sight_is_left_out(tmp_path):
    got = ask(tmp_path, """const hidden = Array.from({ length: 33 }, () => ({ x: 1, y: 1, z: 1, visibility: 0.1 }));
      console.log(JSON.stringify([mirrorArms(hidden, {}), mirrorArms([], {})]));""")
    assert got == [{}, {}]


@pytest.fixture(scope="module")
def page(figure, tmp_path_factory):
    if chromium.find_chromium() is None:
        pytest.skip("needs the Debian package chromium")
    path = tmp_path_factory.mktemp("page") / "viewer.html"
    path.write_bytes(page_bytes(avatar_bytes(figure)))
    it = chromium.Browser(SIZE, SIZE, CAMERA)
    it.open(path.as_uri() + "#pose=A")
    yield it
    it.close()


def archive(files):
    """A .tgz as npm packs it."""
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w:gz", format=tarfile.USTAR_FORMAT) as tar:
        for name, data in files.items():
            info = tarfile.TarInfo(f"package/{name}")
            info.size = len(data)
            tar.addfile(info, io.BytesIO(data))
    return out.getvalue()


def give(page, files):
    """Gives the page files as the user chooses them."""
    encoded = json.dumps({name: base64.b64encode(data).decode() for name, data in files.items()})
    page.run(f"""(() => {{
      const held = new DataTransfer();
      for (const [name, data] of Object.entries({encoded})) {{
        held.items.add(new File([Uint8Array.from(atob(data), (c) => c.charCodeAt(0))], name));
      }}
      document.getElementById('kit-files').files = held.files;
      document.getElementById('kit-files').dispatchEvent(new Event('change'));
    }})()""")


@pytest.mark.slow
def test_the_page_says_which_file_is_missing(page):
    page.run("document.getElementById('mirror').click()")
    assert page.run("document.getElementById('kit').open"), "it asks before it takes a camera"
    give(page, {"mediapipe.tgz": archive({"vision_bundle.mjs": b"", "wasm/vision_wasm_internal.js": b""})})
    page.until("document.getElementById('note').textContent.includes('missing')")
    note = page.run("document.getElementById('note').textContent")
    assert "vision_wasm_internal.wasm, face_landmarker.task are missing" in note and "vision_bundle" not in note
    give(page, {"broken.tgz": b"no archive"})
    page.until("document.getElementById('note').textContent.includes('broken.tgz')")
    give(page, {"bomb.tgz": gzip.compress(bytes(300 << 20), 1)})
    page.until("document.getElementById('note').textContent.includes('unpacks to more than 268435456 bytes')")
    assert page.errors == [] and not page.run("document.getElementById('mirror').ariaPressed === 'true'")


@pytest.mark.slow
@pytest.mark.parametrize(("bundle", "why"), [
    ("export const nothing = 1;", "createFromOptions"),
    ("export const FaceLandmarker = { createFromOptions: () => Promise.reject(new Event('error')) };", "MediaPipe does not start")])
def test_networks_that_do_not_begin_are_said(page, bundle, why):
    give(page, {"tasks-vision.tgz": archive({"vision_bundle.mjs": bundle.encode(), "wasm/vision_wasm_internal.js": b"",
                                             "wasm/vision_wasm_internal.wasm": b""}), "face_landmarker.task": b""})
    page.until("!document.getElementById('note').textContent.includes('opening')")
    note = page.run("document.getElementById('note').textContent")
    assert note.startswith("Mirror: a network cannot be read (") and why in note and page.errors == []


@pytest.mark.slow
def test_with_the_files_that_the_user_gives_the_avatar_does_what_the_user_does_and_the_page_asks_for_nothing(page):
    before = len(page.requests)
    give(page, {"tasks-vision-0.10.tgz": archive({"vision_bundle.mjs": BUNDLE.encode(), "wasm/vision_wasm_internal.js": b"loader",
                                                  "wasm/vision_wasm_internal.wasm": b"binary"}),
                "face_landmarker.task": b"the face's", "pose_landmarker_lite.task": b"the body's"})
    page.until("gsac.expression.jawOpen > 0.79 && gsac.turned.left_shoulder?.[2] > 89")
    assert page.run("asked") == [["loader", "binary", "the face's", "VIDEO"], ["loader", "binary", "the body's", "VIDEO"]]
    assert page.run("looked") == [640, 480] and page.run("document.getElementById('mirror').ariaPressed") == "true"
    page.run("gsac.step(1)")
    hand, head = page.run("['left_wrist', 'head'].map((name) => gsac.skin.place(gsac.avatar.names.indexOf(name))[1])")
    assert hand > head + 0.2, "the user's right arm is up, in the mirror the avatar's left"
    assert all(address.startswith("blob:") for address in page.requests[before:]) and page.errors == []
    page.run("document.getElementById('mirror').click()")
    page.until("gsac.playing.pose === 'A' && Object.keys(gsac.expression).length === 0")
    assert page.run("Object.keys(gsac.turned)") == [] and page.run("document.getElementById('person').reflection") is None
