"""The light of a scene on an avatar in Unity: what the scripts make of probes and sun, and what the kernel does with it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gsac.avatar.binding import face_frames
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.light import shade
from gsac.benchmarks.unity import colours
from gsac.benchmarks.unity.frame import EVEN, SCENE, index_bits
from gsac.benchmarks.unity.packing import pack_avatar

pytestmark = pytest.mark.slow

GAMMA = 2.2
MIRROR = np.array([-1.0, 1, 1])
SUN = np.array([.9, .7, .4])
RANDOM = np.random.default_rng(4)
NORMALS = RANDOM.normal(size=(400, 3))
NORMALS /= np.linalg.norm(NORMALS, axis=1, keepdims=True)


def to_rows(terms, share=1.0):
    """Seven rows (7, 4) of the light that is a polynomial (9, 3) of unit normals: 1, x, y, z, xy, yz, zz, zx, xx - yy."""
    one, x, y, z, xy, yz, zz, zx, rest = terms
    return np.concatenate([np.array([x, y, z, one]).T, np.array([xy, yz, zz, zx]).T, [[*rest, share]]])


def basis(n):
    x, y, z = n.T
    return np.stack([np.ones(len(n)), x, y, z, x * y, y * z, z * z, z * x, x * x - y * y], 1)


def on(rows, n):
    """(N, 3): the light of seven rows on normals (N, 3)."""
    x, y, z = n.T
    one, two = np.c_[n, np.ones(len(n))], np.stack([x * y, y * z, z * z, z * x], 1)
    return one @ rows[:3].T + two @ rows[3:6].T + np.outer(x * x - y * y, rows[6, :3])


@pytest.fixture(scope="module")
def told(play, files):
    """(moment -> seven rows (7, 4); the numbers that were given)."""
    numbers = np.r_[RANDOM.normal(size=27) * .3, SUN, 1.3, 40, 25, 10, 130, -20, .7, 1.2]
    lines = play("scene", files / "figure.gsac", " ".join(map(repr, numbers.tolist()))).splitlines()
    return {what: np.array(row.split(), float).reshape(-1, 4) for what, row in (line.split(":") for line in lines)}, numbers


def probe_light(sh, n):
    """As Unity's shaders evaluate an ambient probe (3, 9) on normals (N, 3)."""
    x, y, z = n.T
    terms = np.stack([np.ones(len(n)), y, z, x, x * y, y * z, 3 * z * z - 1, z * x, x * x - y * y], 1)
    return terms @ sh.T


def test_the_rows_are_probe_and_sun_on_the_mirrored_and_turned_normals(told):
    moments, numbers = told
    turned = Rotation.from_euler("YXZ", numbers[[34, 33, 35]], degrees=True).apply(NORMALS * MIRROR)
    to_sun = -Rotation.from_euler("YX", numbers[[32, 31]], degrees=True).apply([0, 0, 1])
    linear = np.where(SUN > .04045, ((SUN + .055) / 1.055) ** 2.4, SUN / 12.92)
    ambient = probe_light(numbers[:27].reshape(3, 9), turned)
    cosine = turned @ to_sun
    lobe = 1 / 4 + cosine / 2 + 5 / 32 * (3 * cosine ** 2 - 1)
    assert abs(lobe - np.maximum(cosine, 0)).max() < .1
    inwards = -NORMALS * MIRROR
    np.testing.assert_allclose(on(moments["no sun"], inwards), 1.2 * ambient, atol=1e-5)
    np.testing.assert_allclose(on(moments["sun"], inwards), 1.2 * (ambient + 1.3 * lobe[:, None] * linear), atol=1e-5)
    assert abs(moments["sun"][6, 3] - .7) < 1e-6 and not moments["of itself"].any()


def test_what_stands_between_the_person_and_the_sun_takes_its_light_away_in_some_frames(told):
    moments = told[0]
    np.testing.assert_array_equal(moments["without shadows"], moments["sun"])
    np.testing.assert_array_equal(moments["a hand before the eyes"], moments["sun"], "no shadow of her own colliders")
    np.testing.assert_allclose(moments["in the shade"], moments["no sun"], atol=1e-6)
    np.testing.assert_array_equal(moments["begins in the shade"], moments["in the shade"])
    far = abs(moments["sun"] - moments["no sun"]).max()
    assert 0 < abs(moments["stepped into the shade"] - moments["sun"]).max() < .2 * far
    assert moments["still there"].size == 0, "nothing is bound anew"
    assert not moments["clip again"].any()


@pytest.fixture(scope="module")
def lit(exported):
    """A person in a strong light of the clip, and her vertices as they are at rest."""
    avatar = RiggedAvatar.read(exported / "avatar.gsac")
    light = np.float32([[.8, .75, .7], [.3, .2, -.1], [.2, .1, .3], [.25, .4, .2]])
    return replace(avatar, gaussians=replace(avatar.gaussians, light=light))


@pytest.fixture(scope="module")
def factors(gpu, kernels, lit):
    """Light parameters -> factors (N, 3) of the colours that the kernel finds at rest."""
    N, V = len(lit.gaussians), len(lit.vertices)
    for name, array in pack_avatar(lit).items():
        gpu.put(name, array)
    gpu.put("GsacPosed", np.c_[lit.vertices, np.ones(V)].astype(np.float32))
    gpu.put("GsacSplats", np.zeros((N, 12), np.float32))
    usual = {"GsacVertexCount": V, "GsacSplatCount": N, "GsacIndexBits": index_bits(N), "GsacSortStage": 0, "GsacSortShift": 0,
             "GsacSortStrides": 0, "GsacDepthRange": np.zeros(2), "GsacDepthRow": np.zeros(4)}

    def bind(**more):
        gpu.run([(kernels["Bind"], EVEN | usual | more, -(-N // 64))])
        return gpu.get("GsacSplats").reshape(-1, 12)[:, 9:].copy()
    return bind


def of_clip(light):
    return {f"GsacLight{name}": light[[1, 2, 3, 0], c] for c, name in enumerate(("Red", "Green", "Blue"))}


def of_scene(terms, share):
    return dict(zip(SCENE, to_rows(terms, share).astype(np.float32), strict=True))


@pytest.fixture(scope="module")
def clip_terms(lit):
    """The clip's light as a scene's: linear, of the second order."""
    sphere = np.random.default_rng(0).normal(size=(20000, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    return np.linalg.lstsq(basis(sphere), shade(lit.gaussians.light.astype(float), sphere) ** GAMMA, rcond=None)[0]


def test_without_a_share_of_the_scene_the_clips_light_is_as_ever_to_the_bit(factors, lit, clip_terms):
    clip = of_clip(lit.gaussians.light)
    np.testing.assert_array_equal(factors(**clip, **of_scene(clip_terms, 0)), factors(**clip))


def test_the_scenes_light_is_linear_and_a_share_of_it_lies_between(factors, lit):
    terms = np.random.default_rng(1).normal(size=(9, 3)) * .1 + np.r_[.6, np.zeros(8)][:, None]
    n = face_frames(lit.vertices.astype(float), lit.faces).R[lit.gaussians.face, :, 1]
    wanted = np.clip(basis(n) @ terms, 1e-6, None) ** (1 / GAMMA)
    clip = of_clip(lit.gaussians.light)
    whole, half = factors(**clip, **of_scene(terms, 1)), factors(**clip, **of_scene(terms, .5))
    assert np.quantile(abs(whole - np.minimum(wanted, 2.5)), .99) < 1e-3
    np.testing.assert_allclose(half, (factors(**clip) + whole) / 2, atol=1e-5)


def test_in_its_own_light_as_the_scenes_the_person_looks_as_in_the_clip_at_35_db(factors, lit, clip_terms):
    clip = factors(**of_clip(lit.gaussians.light))
    scene = factors(**EVEN | of_scene(clip_terms, 1))
    shot, g = colours.make_shots(lit, 256, 1, seed=3)[0], lit.gaussians
    even = replace(g, light=None)
    a, b = (colours.trained_picture(shot, lit.faces, replace(even, rgb=g.rgb * factor)) for factor in (clip, scene))
    unlit = colours.trained_picture(shot, lit.faces, even)
    person = a[1] > colours.EDGE
    got, without = colours.decibels(b[0], a[0], person), colours.decibels(unlit[0], a[0], person)
    print(f"in the scene's light {got:.1f} dB, without light {without:.1f} dB")
    assert got > 35 > without + 10
