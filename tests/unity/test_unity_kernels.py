"""The HLSL kernels of the Unity package, run on a software GPU, against the trainer's own skinning and binding."""

from dataclasses import replace

import numpy as np
import pytest

from gsac.avatar import rotation
from gsac.avatar.binding import bind, face_frames
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.skinning import joint_transforms, skin
from gsac.benchmarks.unity.frame import EVEN, index_bits, sort_steps
from gsac.benchmarks.unity.packing import pack_avatar

pytestmark = pytest.mark.slow
UNSORTED = EVEN | {"GsacSplatCount": 0, "GsacIndexBits": 0, "GsacSortStage": 0, "GsacSortShift": 0, "GsacSortStrides": 0,
                   "GsacDepthRange": np.zeros(2), "GsacDepthRow": np.zeros(4)}
"""Parameters of a kernel that does not sort; it still wants how many vertices there are."""


@pytest.fixture(scope="module")
def avatar(exported):
    return RiggedAvatar.read(exported / "avatar.gsac")


@pytest.fixture(scope="module")
def frame(avatar):
    """A pose, expression weights, and what Python makes of them."""
    rng = np.random.default_rng(5)
    pose = (rng.normal(size=(55, 3)) * .4).astype(np.float32)
    weights = (rng.random(len(avatar.expression_names)) * (rng.random(len(avatar.expression_names)) < .3)).astype(np.float32)
    rest = avatar.vertices.copy()
    for e, w in enumerate(weights):
        span = slice(avatar.expression_start[e], avatar.expression_start[e + 1])
        rest[avatar.expression_vertex[span]] += w * avatar.expression_delta[span]
    bones = joint_transforms(pose[None], avatar.joints, avatar.parents)[0]
    return {"weights": weights, "bones": bones, "vertices": skin(rest, bones, avatar.skin_index, avatar.skin_weight)}


@pytest.fixture(scope="module")
def on_gpu(gpu, kernels, avatar, frame):
    """The device after skin and bind of that frame, and the kernels' parameters."""
    V, N = len(avatar.vertices), len(avatar.gaussians)
    for name, array in pack_avatar(avatar).items():
        gpu.put(name, array)
    gpu.put("GsacWeights", frame["weights"])
    gpu.put("GsacBones", frame["bones"].astype(np.float32))
    gpu.put("GsacPosed", np.zeros((V, 4), np.float32))
    gpu.put("GsacSplats", np.zeros((N, 12), np.float32))
    gpu.put("Parts", np.zeros((-(-N // 64) * 64, 20), np.float32))
    parameters = UNSORTED | {"GsacVertexCount": V, "GsacSplatCount": N}
    gpu.run([(kernels["Skin"], parameters, -(-V // 64)), (kernels["Bind"], parameters, -(-N // 64)),
             (kernels["BindParts"], parameters, -(-N // 64))])
    return parameters


@pytest.fixture(scope="module")
def bound(gpu, on_gpu, avatar):
    """The trainer's binding, in double precision, on the vertices that the skin kernel left."""
    g = avatar.gaussians
    vertices = gpu.get("GsacPosed").reshape(-1, 4)[:, :3].astype(np.float64)
    return bind(face_frames(vertices, avatar.faces), g.face, g.mu, g.quat, g.log_scale)


def test_skin_and_expression_agree_with_the_trainer(gpu, on_gpu, frame):
    posed = gpu.get("GsacPosed").reshape(-1, 4)[:, :3]
    assert abs(posed - frame["vertices"]).max() < 1e-5


def test_pose_correctives_move_the_rest_as_python_moves_it(gpu, kernels, bent_arm):
    avatar, V = bent_arm.avatar, len(bent_arm.avatar.vertices)
    turns = np.zeros((55, 12), np.float32)
    turns[:, :9] = (rotation.exp(bent_arm.pose.astype(float)) - np.eye(3)).reshape(-1, 9)
    pairs = np.concatenate([avatar.correctives.delta.reshape(-1, 27), avatar.correctives.joint[:, None]], 1)
    gpu.put("GsacRest", pack_avatar(avatar)["GsacRest"])
    gpu.put("GsacPairs", pairs.astype(np.float32).reshape(-1, 4))
    gpu.put("GsacFirst", avatar.correctives.start.astype(np.uint32))
    gpu.put("GsacTurns", turns.reshape(-1, 4))
    gpu.put("GsacBent", np.zeros((V, 4), np.float32))
    gpu.run([(kernels["Correct"], UNSORTED | {"GsacVertexCount": V}, -(-V // 64))])
    bent = gpu.get("GsacBent").reshape(-1, 4)
    np.testing.assert_allclose(bent[:, :3], avatar.vertices + avatar.correctives.move_rest(bent_arm.pose), atol=1e-6)
    assert (bent[:, 3] == 1).all()


def test_bound_means_rotations_and_scales_agree_with_the_trainer(gpu, bound, avatar):
    N = len(avatar.gaussians)
    parts = gpu.get("Parts").reshape(-1, 5, 4)[:N, :, :3]
    assert abs(parts[:, 0] - bound.means).max() < 1e-5
    assert abs(parts[:, 4] - bound.scales).max() < 1e-5
    assert np.quantile(abs(parts[:, 4] / bound.scales - 1), .99) < 1e-5
    error = abs(parts[:, 1:4].transpose(0, 2, 1) - bound.rotations).max((1, 2))
    assert np.quantile(error, .99) < 1e-5 and error.max() < 1e-3, "a sliver's normal is as uncertain as its area"


def test_covariances_agree_with_the_trainer(gpu, bound):
    half = bound.rotations * bound.scales[:, None]
    truth = half @ half.transpose(0, 2, 1)
    s = gpu.get("GsacSplats").reshape(-1, 12)
    got = s[:, [3, 6, 7, 6, 4, 8, 7, 8, 5]].reshape(-1, 3, 3)
    assert abs(s[:, :3] - bound.means).max() < 1e-5
    error = abs(got - truth).max((1, 2)) / bound.scales.max(1) ** 2
    assert np.quantile(error, .99) < 1e-5 and error.max() < 1e-3
    assert (s[:, 9:] == 1).all(), "in even light colours are as they are"


def test_a_face_without_area_gives_a_point_and_no_nan(gpu, kernels, figure):
    vertices = figure.vertices.copy()
    f = figure.faces[figure.gaussians.face[0]]
    vertices[f[1]] = vertices[f[0]]
    flat = pack_avatar(replace(figure, vertices=vertices))
    N = len(flat["GsacCorners"])
    for name in ("GsacCorners", "GsacLocal"):
        gpu.put(name, flat[name])
    gpu.put("GsacPosed", flat["GsacRest"])
    gpu.put("Parts", np.zeros((-(-N // 64) * 64, 20), np.float32))
    gpu.run([(kernels["BindParts"], {}, -(-N // 64))])
    parts = gpu.get("Parts").reshape(-1, 5, 4)[:N]
    assert np.isfinite(parts).all()
    assert (parts[0, 4] == 0).all() and abs(parts[0, 0, :3] - vertices[f].mean(0)).max() < 1e-6


def run_sort(gpu, kernels, means, row, near, far):
    N = len(means)
    total, steps = sort_steps(N)
    splats = np.zeros((N, 12), np.float32)
    splats[:, :3] = means
    gpu.put("GsacSplats", splats)
    gpu.put("GsacKeys", np.zeros(total, np.uint32))
    base = EVEN | {"GsacVertexCount": 0, "GsacSplatCount": N, "GsacIndexBits": index_bits(N),
                   "GsacDepthRange": np.array([near, 1 / (far - near)]), "GsacDepthRow": np.array(row, float)}
    gpu.run([(kernels[name], base | parameters, groups) for name, parameters, groups in steps])
    return gpu.get("GsacKeys", np.uint32), index_bits(N)


@pytest.mark.parametrize("N", [1, 2, 4095, 4096, 4097, 25000, 40000, 132000])
def test_the_sort_is_exact_stable_and_from_far_to_near(gpu, kernels, N):
    rng = np.random.default_rng(N)
    means = rng.normal(size=(N, 3)).astype(np.float32)
    means[N // 2:] = means[:N - N // 2]
    row = np.float32([.36, .48, .8, 3])
    near, far = -3.0, 9.0
    keys, bits = run_sort(gpu, kernels, means, row, near, far)
    order = keys[:N] & ((1 << bits) - 1)
    assert (np.diff(keys.astype(np.int64)) >= 0).all()
    assert sorted(order) == list(range(N)), "every gaussian once"
    depth = (means.astype(np.float64) @ row[:3].astype(np.float64) + row[3])[order]
    quantum = (far - near) / (2.0 ** (32 - bits) - 1)
    assert (np.diff(depth) <= quantum * 1.01 + 2e-6).all()
    same = np.diff(keys[:N] >> bits) == 0
    assert (np.diff(order.astype(np.int64))[same] > 0).all(), "equal depths keep their order"


def test_depths_outside_the_range_and_nans_are_still_a_permutation(gpu, kernels):
    means = np.random.default_rng(0).normal(size=(300, 3)).astype(np.float32) * 100
    means[7] = np.nan
    keys, bits = run_sort(gpu, kernels, means, (0, 0, 1, 0), 0.0, 1.0)
    assert sorted(keys[:300] & ((1 << bits) - 1)) == list(range(300))


def test_the_kernels_use_no_wave_operation_and_no_matrix_in_a_buffer(hlsl):
    for path in hlsl.CORE.iterdir():
        text = path.read_text()
        assert "Wave" not in text and "StructuredBuffer<float4x4>" not in text, path.name
