"""The shader that Unity draws splats with: it compiles for every render pipeline, and its picture is the trainer's."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gsac.avatar.binding import bind, face_frames
from gsac.avatar.camera import Camera
from gsac.avatar.draw_rule import ADDED, PIXEL
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.raster import render
from gsac.avatar.rotation import exp
from gsac.benchmarks.unity.frame import draw_rule
from gsac.benchmarks.unity.gpu import Painting, projection
from gsac.benchmarks.unity.packing import pack_avatar

pytestmark = pytest.mark.slow

PIPELINES = ["", "UniversalPipeline", "HDRenderPipeline"]
SIZE = 256


def test_every_render_pipeline_has_a_pass_that_compiles(passes):
    assert sorted(passes) == sorted([*PIPELINES, "stereo"])


@pytest.fixture(scope="module")
def scene(exported):
    """2,500 gaussians of an avatar in its own space, a turned and shifted root, an off-centre camera, and the truth."""
    avatar = RiggedAvatar.read(exported / "avatar.gsac")
    pick = np.arange(2500) * len(avatar.gaussians) // 2500
    avatar.gaussians = avatar.gaussians[pick]
    avatar.gaussians.log_scale = avatar.gaussians.log_scale + .4
    g = avatar.gaussians
    bound = bind(face_frames(avatar.posed(avatar.pose("A")), avatar.faces), g.face, g.mu, g.quat, g.log_scale)
    turn = exp(np.array([.1, .7, 0]))
    model = np.concatenate([turn, [[.3], [-.35], [.2]]], 1)
    view = np.concatenate([exp(np.array([.15, 0, .1])), [[.1], [-.1], [-2.6]]], 1)  # y up, -z ahead
    camera = Camera((240.0, 250.0), (119.0, 131.5), SIZE, SIZE)
    flip = np.diag([1.0, -1, -1])
    total = flip @ view[:, :3] @ model[:, :3]
    place = flip @ (view[:, :3] @ model[:, 3] + view[:, 3])
    scene = {"avatar": avatar, "bound": bound, "model": model, "view": view, "camera": camera, "total": total, "place": place}
    return scene | {"truth": true_picture(scene, PIXEL)}


def true_picture(scene, low_pass, camera=None, back=0):
    """back: m by which the camera stands farther away."""
    g, bound, total = scene["avatar"].gaussians, scene["bound"], scene["total"]
    means = bound.means @ total.T + scene["place"] + (0, 0, back)
    truth = render(means.astype(np.float32), (total @ bound.rotations).astype(np.float32), bound.scales, g.rgb, g.opacity,
                   camera or scene["camera"], low_pass=low_pass)
    return np.concatenate([truth.rgb, truth.alpha[..., None]], 2)


def picture(gpu, passes, scene, pipeline, matrix=None, linear=0, low_pass=PIXEL, size=None, screen=None, **more):
    """matrix: projection, the camera's if None; size, screen: width and height of the picture, and as told; more: parameters."""
    g, bound = scene["avatar"].gaussians, scene["bound"]
    N = len(g)
    half = bound.rotations * bound.scales[:, None]
    c = half @ half.transpose(0, 2, 1)
    splats = np.zeros((N, 12), np.float32)
    splats[:, :3], splats[:, 3:9], splats[:, 9:] = bound.means, c[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]], scene.get("shade", 1)
    order = np.argsort(-(bound.means @ scene["total"][2]), kind="stable").astype(np.uint32)
    gpu.put("GsacSplats", splats)
    gpu.put("GsacColours", pack_avatar(scene["avatar"])["GsacColours"])
    gpu.put("GsacKeys", order | np.uint32(5 << 13))
    gpu.put("GsacLatest", np.zeros(1, np.uint32))
    view = np.vstack([scene["view"], [0, 0, 0, 1]])
    eye = -scene["view"][:, :3].T @ scene["view"][:, 3]
    if pipeline == "HDRenderPipeline":
        view[:3, 3] = 0
    camera = scene["camera"]
    size = size or (camera.width, camera.height)
    screen = np.array([*(screen or size), 0, 0])
    matrix = projection(camera) if matrix is None else matrix
    parameters = {"unity_MatrixV": view.T, "glstate_matrix_projection": matrix.T,
                  "_ScreenParams": screen, "_ScaledScreenParams": screen, "_ScreenSize": screen,
                  "_WorldSpaceCameraPos": [*eye, 0], "TestFog": [0, 0, 0, 0], "_InvViewProjMatrix": np.eye(4),
                  "GsacIndexBits": 13, **draw_rule(low_pass, linear),
                  **{f"GsacModel{r}": scene["model"][r] for r in range(3)}, **more}
    return Painting(gpu, *passes[pipeline], *size, N).draw(parameters)


@pytest.mark.parametrize("pipeline", PIPELINES)
def test_the_picture_is_the_trainers_at_55_db(gpu, passes, scene, pipeline):
    got = picture(gpu, passes, scene, pipeline)
    assert (scene["truth"][..., 3] > .5).mean() > .05, "the figure is in the picture"
    mse = ((got - scene["truth"]) ** 2).mean()
    print(f"{pipeline or 'built-in'}: PSNR {-10 * np.log10(mse):.1f} dB, max {abs(got - scene['truth']).max():.4f}")
    assert -10 * np.log10(mse) > 55


@pytest.mark.parametrize("low_pass", [ADDED, PIXEL._replace(px2=1.0), PIXEL._replace(px2=0.0)], ids=["added", "wide", "none"])
def test_the_picture_is_the_trainers_by_whatever_low_pass_the_file_names(gpu, passes, scene, low_pass):
    wanted = true_picture(scene, low_pass)
    mse = ((picture(gpu, passes, scene, "", low_pass=low_pass) - wanted) ** 2).mean()
    print(f"{low_pass}: PSNR {-10 * np.log10(mse):.1f} dB")
    assert -10 * np.log10(mse) > 55 and abs(wanted - scene["truth"]).max() > .1


def reduced(picture, size):
    """(size, size, 4), each pixel the mean of those of a picture (n * size, n * size, 4)."""
    n = len(picture) // size
    return picture.reshape(size, n, size, n, 4).mean((1, 3))


@pytest.mark.parametrize(("low_pass", "alike"), [(PIXEL, True), (ADDED, False)], ids=["energy kept", "added"])
def test_with_energy_kept_the_person_looks_alike_at_half_and_at_two_and_four_times_the_size(gpu, passes, scene, low_pass, alike):
    sizes = SIZE // 2, SIZE, 2 * SIZE, 4 * SIZE
    pictures = {size: picture(gpu, passes, scene | {"camera": scene["camera"].scaled(size, size)}, "", low_pass=low_pass)
                for size in sizes}
    got = []
    for size in sizes:
        small, other = (reduced(pictures[s], min(size, SIZE)) for s in (size, SIZE))
        person = other[..., 3] > .02
        got.append(-10 * np.log10(((small - other)[person] ** 2).mean() + 1e-12))
    print(low_pass, [f"{x:.1f} dB" for x in got])
    assert (min(got) > 36) == alike


def test_a_projection_with_y_down_gives_the_same_picture_upside_down(gpu, passes, scene):
    got = picture(gpu, passes, scene, "", projection(scene["camera"], flipped=True))[::-1]
    assert psnr(got, scene["truth"]) > 55


@pytest.mark.parametrize("pipeline", PIPELINES)
def test_a_tint_multiplies_every_colour(gpu, passes, scene, pipeline):
    tint = np.array([.5, 1, .25, 1])
    assert psnr(picture(gpu, passes, scene, pipeline, GsacTint=tint), scene["truth"] * tint) > 55


def test_a_draw_that_a_later_one_replaced_shows_nothing(gpu, passes, scene):
    assert not picture(gpu, passes, scene, "", GsacNumber=1).any()


@pytest.mark.parametrize("share", [0, .25, .5, .9])
def test_a_fading_person_loses_pixels_evenly_and_nothing_shines_through_those_that_stay(gpu, passes, scene, share):
    got = picture(gpu, passes, scene, "", GsacTint=[1, 1, 1, share])
    there = np.abs(got - scene["truth"]).max(2) < .02
    assert (there | (got[..., 3] == 0)).all(), "a pixel is there as ever or not at all"
    inside = scene["truth"][..., 3] > .9
    assert abs(got[inside][:, 3].mean() / scene["truth"][inside][:, 3].mean() - share) < .02
    for row in np.array_split(inside.nonzero()[0], 6):
        part = inside & np.isin(np.arange(SIZE), np.unique(row))[:, None]
        assert abs((got[part][:, 3] > 0).mean() - share) < .08, "top to bottom"


@pytest.mark.parametrize("pipeline", ["", "UniversalPipeline"])
def test_the_scenes_fog_lies_over_the_person_by_depth_unless_switched_off(gpu, hlsl, scene, pipeline, tmp_path):
    text = "#define FOG_EXP2\n" + hlsl.shader_passes()[pipeline]
    foggy = {pipeline: hlsl.compile_pass(text, tmp_path, Path(__file__).parent / "shims")}
    fog = {"unity_FogColor": [.2, .4, .6, 1], "unity_FogParams": [.25, 0, 0, 0]}
    z = (scene["bound"].means @ scene["total"].T + scene["place"])[:, 2]
    share = np.exp2(-(.25 * np.maximum(z - .02, 0)) ** 2)[:, None]  # clip space's z of this projection
    colours = share * scene["avatar"].gaussians.rgb + (1 - share) * fog["unity_FogColor"][:3]
    assert np.ptp(share) > .1
    g = scene["avatar"].gaussians
    wanted = true_picture(scene | {"avatar": replace(scene["avatar"], gaussians=replace(g, rgb=colours.astype(np.float32)))}, PIXEL)
    assert psnr(picture(gpu, foggy, scene, pipeline, GsacFog=1, **fog), wanted) > 55
    assert psnr(picture(gpu, foggy, scene, pipeline, GsacFog=0, **fog), scene["truth"]) > 55


def test_in_hdrp_the_fog_lies_over_the_person_by_the_way_from_the_eye_unless_switched_off(gpu, passes, scene):
    fog = np.array([.2, .4, .6, .25])
    view = np.vstack([scene["view"], [0, 0, 0, 1]])
    view[:3, 3] = 0
    way = np.linalg.norm(scene["bound"].means @ scene["total"].T + scene["place"], axis=1)
    share = np.exp2(-(fog[3] * way) ** 2)[:, None]
    g = scene["avatar"].gaussians
    colours = share * g.rgb + (1 - share) * fog[:3]
    wanted = true_picture(scene | {"avatar": replace(scene["avatar"], gaussians=replace(g, rgb=colours.astype(np.float32)))}, PIXEL)
    told = {"TestFog": fog, "_InvViewProjMatrix": np.linalg.inv(projection(scene["camera"]) @ view).T}
    assert psnr(picture(gpu, passes, scene, "HDRenderPipeline", GsacFog=1, **told), wanted) > 55
    assert psnr(picture(gpu, passes, scene, "HDRenderPipeline", GsacFog=0, **told), scene["truth"]) > 55


WIDE = Camera((240.0, 240.0), (149.0, 101.5), 320, 192)
"""A camera whose picture is not square, its axis off the middle."""


@pytest.mark.parametrize("told", ["as seen", "as stored"])
@pytest.mark.parametrize("quarters", [1, 2, 3])
def test_a_projection_that_turns_the_picture_gives_the_trainers_turned(gpu, passes, scene, quarters, told):
    """An Android phone on its side, whose display rotation is applied while drawing."""
    turn = np.eye(4)
    turn[:2, :2] = np.linalg.matrix_power(np.array([[0.0, -1], [1, 0]]), quarters)
    wanted = np.rot90(true_picture(scene, PIXEL, WIDE), quarters)
    size = wanted.shape[1::-1]
    got = picture(gpu, passes, scene | {"camera": WIDE}, "", turn @ projection(WIDE), size=size,
                  screen=size if told == "as stored" else (WIDE.width, WIDE.height))
    assert psnr(got, wanted) > 55


FAR = 2000.0
"""m: from here on a trainer's camera with a lens as long sees as one without perspective."""


@pytest.mark.parametrize("pipeline", PIPELINES)
@pytest.mark.parametrize(("span", "back"), [(.6, 0), (2.5, 6), (40.0, 0)])
def test_a_camera_without_perspective_gives_the_picture_of_the_trainers_from_far_away(gpu, passes, scene, pipeline, span, back):
    """span: m of the picture's height; back: m by which the person goes towards the eye, and behind it."""
    focal = WIDE.height / span
    away = Camera((focal * FAR, focal * FAR), WIDE.center, WIDE.width, WIDE.height)
    wanted = true_picture(scene, PIXEL, away, FAR - scene["place"][2])
    flat = np.diag([2 * focal / WIDE.width, 2 * focal / WIDE.height, -.02, 1])
    flat[:2, 3] = 2 * WIDE.center[0] / WIDE.width - 1, 1 - 2 * WIDE.center[1] / WIDE.height
    flat[2, 3] = .5
    nearer = scene | {"view": scene["view"] + [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, back]]}
    got = picture(gpu, passes, nearer, pipeline, flat, size=(WIDE.width, WIDE.height))
    assert (wanted[..., 3] > .5).any() and psnr(got, wanted) > 55


def psnr(got, wanted):
    """dB over the whole picture, all four channels."""
    mse = ((got - wanted) ** 2).mean()
    print(f"{-10 * np.log10(mse):.1f} dB")
    return -10 * np.log10(mse)


def test_each_eye_of_a_headset_is_drawn_by_its_own_matrices_in_one_pass(gpu, passes, scene):
    shifted = scene | {"view": scene["view"] + [[0, 0, 0, .25], [0, 0, 0, 0], [0, 0, 0, 0]]}
    alone = [picture(gpu, passes, s, "") for s in (shifted, scene)]  # the last leaves the buffers
    assert abs(alone[0] - alone[1]).max() > .3, "the eyes see different things"
    together = both_eyes(gpu, passes, scene, [shifted["view"], scene["view"]], [scene["camera"]] * 2)
    for got, wanted in zip(together, alone, strict=True):
        assert abs(got - wanted).max() < 1e-3


def test_each_eyes_picture_is_the_trainers_though_its_lens_looks_aside(gpu, passes, scene):
    picture(gpu, passes, scene, "")  # leaves the buffers
    apart = np.array([.032, 0, 0])
    cameras = [Camera((200.0, 200.0), (128 + side, 120.0), SIZE, SIZE) for side in (18.0, -18.0)]
    views = [np.column_stack([scene["view"][:, :3], scene["view"][:, 3] + side * apart]) for side in (1, -1)]
    for got, camera, side in zip(both_eyes(gpu, passes, scene, views, cameras), cameras, (1, -1), strict=True):
        assert psnr(got, true_picture(scene | {"place": scene["place"] + side * apart}, PIXEL, camera)) > 55


def both_eyes(gpu, passes, scene, views, cameras):
    """The two pictures of a headset's one pass, of the buffers that `picture` left. views: (3, 4) of each eye."""
    parameters = {"unity_StereoMatrixV": [np.vstack([view, [0, 0, 0, 1]]).T for view in views],
                  "unity_StereoMatrixP": [projection(camera).T for camera in cameras],
                  "_ScreenParams": [SIZE, SIZE, 0, 0], "GsacIndexBits": 13, **draw_rule(PIXEL),
                  **{f"GsacModel{r}": scene["model"][r] for r in range(3)}}
    painting = Painting(gpu, *passes["stereo"], SIZE, SIZE, len(scene["bound"].means))
    return [painting.draw(parameters, instance=eye) for eye in (0, 1)]


def test_in_a_linear_project_an_opaque_colour_is_the_lit_display_colour_made_linear(gpu, passes, scene):
    factor = np.array([.5, 1, 1.5])
    first = type(scene["bound"])(*(a[:1] for a in scene["bound"]))
    one = scene | {"shade": factor, "bound": first, "avatar": _first(scene["avatar"])}
    got = picture(gpu, passes, one, "", linear=1)
    peak = got.reshape(-1, 4)[got[..., 3].argmax()]
    rgb = one["avatar"].gaussians.rgb[0].astype(np.float64) * factor
    linear = np.where(rgb > .04045, ((rgb + .055) / 1.055) ** 2.4, rgb / 12.92)
    np.testing.assert_allclose(peak[:3] / peak[3], linear, atol=2e-3)


def _first(avatar):
    return replace(avatar, gaussians=avatar.gaussians[:1])
