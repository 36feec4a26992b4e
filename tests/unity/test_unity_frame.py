"""A frame as the package's C# asks for it, done on a software GPU: vertices, gaussians, order and picture against the trainer."""

import numpy as np
import pytest

from gsac.avatar.binding import bind, face_frames
from gsac.avatar.camera import Camera
from gsac.avatar.draw_rule import DARKEST, PIXEL
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.light import shade
from gsac.avatar.raster import render
from gsac.avatar.skinning import joint_transforms, skin
from gsac.benchmarks.unity.frame import EVEN
from gsac.benchmarks.unity.gpu import Painting, projection
from gsac.benchmarks.unity.packing import pack_avatar
from gsac.benchmarks.unity.shaders import KERNELS

pytestmark = pytest.mark.slow

MIRROR = np.diag([-1.0, 1, 1])
SIZE = 256


@pytest.fixture(scope="module")
def draw(play, mono, files, gpu, kernels, tmp_path_factory):
    """What the scripts ask of the GPU for one frame, done there: (their arrays, buffers). shape: what alone a clip moves."""
    return lambda *shape: draw_frame(play, mono, files, gpu, kernels, tmp_path_factory.mktemp("frame") / "frame", *shape)


@pytest.fixture(scope="module")
def frame(draw):
    return draw()


def draw_frame(play, mono, files, gpu, kernels, path, *shape):
    play("frame", files / "person.gsac", files / "person.txt", path, *shape)
    asked = mono.arrays(path)
    for name, array in asked.items():
        if name.startswith("Gsac"):
            gpu.put(name, array)
    jobs = []
    for row in asked["steps"].reshape(-1, 26):
        names = ("GsacVertexCount", "GsacSplatCount", "GsacIndexBits", "GsacSortStage", "GsacSortShift", "GsacSortStrides")
        parameters = EVEN | dict(zip(names, map(int, row[2:8]), strict=True))
        parameters |= {"GsacDepthRange": row[8:10], "GsacDepthRow": row[10:14]}
        parameters |= {f"GsacLight{name}": row[14 + 4 * c:18 + 4 * c] for c, name in enumerate(("Red", "Green", "Blue"))}
        jobs.append((kernels[KERNELS[int(row[0])]], parameters, int(row[1])))
    gpu.run(jobs)
    return asked, {name: gpu.get(name) for name in ("GsacPosed", "GsacSplats")} | {"GsacKeys": gpu.get("GsacKeys", np.uint32)}


@pytest.fixture(scope="module")
def truth(given):
    return pose_as_the_trainer(*given("person"))


def pose_as_the_trainer(avatar, pose, transl, weights):
    """(vertices turned to Unity's axes, bound gaussians, factors of their colours) of that frame in the avatar's own space."""
    rest = avatar.vertices.copy()
    for e, w in enumerate(weights):
        span = slice(avatar.expression_start[e], avatar.expression_start[e + 1])
        rest[avatar.expression_vertex[span]] += w * avatar.expression_delta[span]
    bones = joint_transforms(pose[None], avatar.joints, avatar.parents)[0]
    vertices = skin(rest, bones, avatar.skin_index, avatar.skin_weight) + transl - (0, avatar.ground, 0)
    g = avatar.gaussians
    frames = face_frames(vertices, avatar.faces)
    bound = bind(frames, g.face, g.mu, g.quat, g.log_scale)
    return vertices @ MIRROR, bound, shade(g.light, frames.R[g.face, :, 1])


def test_a_frame_of_the_scripts_skins_as_the_trainer_does(frame, truth):
    assert abs(frame[1]["GsacPosed"].reshape(-1, 4)[:, :3] - truth[0]).max() < 1e-5


def test_a_frame_of_the_scripts_binds_as_the_trainer_does_though_mirrored(frame, truth):
    bound = truth[1]
    splats = frame[1]["GsacSplats"].reshape(-1, 12)
    assert abs(splats[:, :3] - bound.means @ MIRROR).max() < 2e-5
    half = MIRROR @ bound.rotations * bound.scales[:, None]
    covariance = half @ half.transpose(0, 2, 1)
    error = abs(splats[:, [3, 6, 7, 6, 4, 8, 7, 8, 5]].reshape(-1, 3, 3) - covariance).max((1, 2)) / bound.scales.max(1) ** 2
    assert np.quantile(error, .99) < 2e-4 and error.max() < 5e-2, "posed in float32: a sliver's normal is as uncertain as its area"


def test_a_frame_of_the_scripts_lights_each_face_as_the_trainer_does_though_mirrored(frame, truth):
    factor = frame[1]["GsacSplats"].reshape(-1, 12)[:, 9:]
    error = abs(factor - truth[2]).max(1)
    assert np.ptp(truth[2], axis=0).min() > .5 and (truth[2] == np.float32(DARKEST)).any()
    assert np.quantile(error, .99) < 1e-4 and error.max() < 2e-2, "a sliver's normal is as uncertain as its area"


def test_a_frame_of_the_scripts_sorts_from_far_to_near_for_the_camera(frame):
    asked, got = frame
    draw, ahead, place = asked["draw"], *asked["camera"].reshape(3, 4).T[2:]
    model, bits = draw[:12].reshape(3, 4), int(draw[16])
    means = got["GsacSplats"].reshape(-1, 12)[:, :3]
    world = means @ model[:, :3].T + model[:, 3]
    depth = (world - place) @ ahead
    low, per_metre = asked["steps"].reshape(-1, 26)[-1, 8:10]
    assert low <= depth.min() and depth.max() <= low + 1 / per_metre, "no depth falls out of the keys' range"
    order = got["GsacKeys"][:len(means)] & ((1 << bits) - 1)
    assert sorted(order) == list(range(len(means)))
    assert (np.diff(depth[order]) <= 1 / per_metre / (2.0 ** (32 - bits) - 1) * 1.01 + 2e-6).all()
    centre, size = draw[17:20], draw[20:23]
    assert (abs(world - centre) <= size / 2).all(), "the bounds that Unity culls by hold every gaussian"


def test_the_draw_is_two_triangles_a_gaussian_with_the_files_blending_made_linear(frame, files):
    asked, _ = frame
    N = len(RiggedAvatar.read(files / "person.gsac").gaussians)
    assert int(asked["draw"][-1]) == 6 * N
    np.testing.assert_allclose(asked["draw"][12:16], [PIXEL.px2, .999, 1 / 255, 1], rtol=1e-6)
    assert asked["keeps_energy"] == 1
    corners = asked["indices"].view(np.uint32)[:6 * N].reshape(N, 6)
    np.testing.assert_array_equal(corners, np.arange(N)[:, None] * 4 + [0, 1, 2, 2, 1, 3])


def test_what_is_uploaded_is_what_the_kernels_were_tested_with(frame, files):
    asked, _ = frame
    expected = pack_avatar(RiggedAvatar.read(files / "person.gsac"))
    flips = {"GsacRest": (-1, 1, 1, 1), "GsacMoves": (-1, 1, 1, 1), "GsacLocal": (1, -1, 1, 1, -1, 1, -1, 1, 1, 1, 1, 1)}
    for name, array in expected.items():
        got = asked[name].view(array.dtype).reshape(len(array), -1)
        np.testing.assert_allclose(got, array.reshape(len(array), -1) * flips.get(name, 1), rtol=1e-6, atol=1e-9, err_msg=name)


def test_the_picture_of_a_frame_of_the_scripts_is_the_trainers_at_55_db(gpu, frame, truth, passes, given):
    asked, _ = frame
    camera, g, bound = Camera((230.0, 230.0), (128.0, 128.0), SIZE, SIZE), given("person")[0].gaussians, truth[1]
    model, (right, up, ahead, place) = asked["draw"][:12].reshape(3, 4).astype(float), asked["camera"].reshape(3, 4).T.astype(float)
    view = np.eye(4)
    view[:3, :3] = right, up, -ahead
    view[:3, 3] = -view[:3, :3] @ place
    screen = np.array([SIZE, SIZE, 0, 0])
    parameters = {"unity_MatrixV": view.T, "glstate_matrix_projection": projection(camera).T, "_ScreenParams": screen,
                  "GsacBlend": [*asked["draw"][12:15], 0], "GsacKeepsEnergy": int(asked["keeps_energy"][0]),
                  "GsacTint": [1, 1, 1, 1], "GsacFog": 0, "GsacNumber": 0,
                  "GsacIndexBits": int(asked["draw"][16]),
                  **{f"GsacModel{r}": model[r] for r in range(3)}}
    gpu.put("GsacLatest", np.zeros(1, np.uint32))
    got = Painting(gpu, *passes[""], SIZE, SIZE, len(bound.means)).draw(parameters)

    size = np.linalg.norm(model[:, 0])
    total = np.diag([1.0, -1, -1]) @ view[:3, :3] @ model[:, :3] @ MIRROR  # canonical -> the trainer's camera
    centre = np.diag([1.0, -1, -1]) @ (view[:3, :3] @ model[:, 3] + view[:3, 3])
    assert np.linalg.det(total) > 0
    want = render((bound.means @ total.T + centre).astype(np.float32), (total / size @ bound.rotations).astype(np.float32),
                  (bound.scales * size).astype(np.float32), g.rgb * truth[2], g.opacity, camera)
    want = np.concatenate([want.rgb, want.alpha[..., None]], 2)
    assert (want[..., 3] > .5).mean() > .05, "the figure is in the picture"
    assert -10 * np.log10(((got - want) ** 2).mean()) > 55


def test_a_clip_of_unitys_that_moves_a_blend_shape_moves_the_gaussians_as_the_trainers_expression_does(draw, given):
    avatar, pose, transl, weights = given("person")
    said = avatar.jaw_actions @ pose[22]
    said[avatar.expression_names.index("jawOpen")] += .6
    bound, still = (pose_as_the_trainer(avatar, pose, transl, w)[1] for w in (said, avatar.jaw_actions @ pose[22]))
    splats = draw("jawOpen")[1]["GsacSplats"].reshape(-1, 12)
    assert abs(splats[:, :3] - bound.means @ MIRROR).max() < 1e-4
    assert abs(bound.means - still.means).max() > 3e-3, "the jaw moves"
