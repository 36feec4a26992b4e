"""People who stand among each other: the Unity package sorts them together, and the picture is the trainer's of all of them."""

from itertools import permutations

import numpy as np
import pytest

from gsac.avatar.binding import bind, face_frames
from gsac.avatar.camera import Camera
from gsac.avatar.light import shade
from gsac.avatar.raster import render
from gsac.avatar.skinning import joint_transforms, skin
from gsac.benchmarks.unity.frame import EVEN
from gsac.benchmarks.unity.gpu import Painting, projection
from gsac.benchmarks.unity.shaders import JOIN, KERNELS

pytestmark = pytest.mark.slow

MIRROR = np.diag([-1.0, 1, 1])
CAMERA = Camera((230.0, 230.0), (128.0, 128.0), 256, 256)
PEOPLE = [(0, 0, 10, 1), (.05, .02, 100, .95), (-.25, .05, 75, 1.1), (.1, -.3, -60, 1)]
"""x, z, m, turn about y, degrees, and size of each: an arm of each is among the others'."""
INTS = ("GsacVertexCount", "GsacSplatCount", "GsacIndexBits", "GsacSortStage", "GsacSortShift", "GsacSortStrides", "GsacJoinFirst")
VECTORS = ("GsacDepthRange", "GsacDepthRow", *EVEN, "GsacJoinModel0", "GsacJoinModel1", "GsacJoinModel2")
BUFFERS = ("GsacRest", "GsacSkin", "GsacMoves", "GsacWeights", "GsacBones", "GsacPosed", "GsacCorners", "GsacLocal", "GsacSplats",
           "GsacKeys", "GsacColours", "GsacJoined", "GsacJoinedColours")
DRAWN = ("GsacModel0", "GsacModel1", "GsacModel2", "GsacBlend", "GsacTint", "GsacIndexBits", "GsacKeepsEnergy", "GsacNumber")


@pytest.fixture
def asked(play, mono, files, tmp_path):
    """Names of arrays -> what the scripts ask of the GPU for people who stand so, drawn together or, of different finish, apart."""
    def ask(how, people):
        places = [number for person in people for number in person]
        play("crowd", files / "person.gsac", files / "person.txt", tmp_path / "asked", how, *places)
        return mono.arrays(tmp_path / "asked")
    return ask


@pytest.fixture
def painted(gpu, kernels, passes):
    """What was asked, done on the GPU: (pictures of the draws in order, each person's and the camera's matrix (3, 4))."""
    def paint(asked):
        made = {}
        for name, array in asked.items():
            if name.startswith("buffer"):
                gpu.put(name, array)
                made[int(name[6:])] = gpu.buffers[name]
        for row in asked["steps"].reshape(-1, 2 + len(INTS) + 4 * len(VECTORS) + len(BUFFERS)):
            parameters = dict(zip(INTS, map(int, row[2:9]), strict=True))
            parameters |= dict(zip(VECTORS, row[9:9 + 4 * len(VECTORS)].reshape(-1, 4), strict=True))
            parameters["GsacDepthRange"] = parameters["GsacDepthRange"][:2]
            gpu.buffers |= {name: made[int(n)] for name, n in zip(BUFFERS, row[-len(BUFFERS):], strict=True) if n >= 0}
            gpu.run([(kernels[[*KERNELS, JOIN][int(row[0])]], parameters, int(row[1]))])
        places = asked["places"].reshape(-1, 3, 4).astype(float)
        given = {"GsacFog": 0, "unity_MatrixV": view_of(places[-1]).T, "glstate_matrix_projection": projection(CAMERA).T,
                 "_ScreenParams": [256, 256, 0, 0]}
        pictures = []
        for row in asked["draws"].reshape(-1, 4 * len(DRAWN) + 5):
            parameters = given | dict(zip(DRAWN, row[:4 * len(DRAWN)].reshape(-1, 4), strict=True))
            parameters |= {name: int(parameters[name][0]) for name in DRAWN[5:]}
            parameters["GsacBlend"] = [*parameters["GsacBlend"][:3], 0]
            names = "GsacSplats", "GsacColours", "GsacKeys", "GsacLatest"
            gpu.buffers |= {name: made[int(n)] for name, n in zip(names, row[-5:-1], strict=True)}
            pictures.append(Painting(gpu, *passes[""], 256, 256, int(row[-1]) // 6).draw(parameters))
        return pictures, places
    return paint


def view_of(place):
    """(4, 4): world to eye, -z ahead, of a camera whose matrix is (3, 4)."""
    view = np.eye(4)
    view[:3, :3] = place[:, 0], place[:, 1], -place[:, 2]
    view[:3, 3] = -view[:3, :3] @ place[:, 3]
    return view


@pytest.fixture(scope="module")
def truth(given):
    """What the trainer draws of people at `places`: (H, W, 4)."""
    avatar, pose, transl, weights = given("person")
    rest = avatar.vertices.copy()
    for e, w in enumerate(weights):
        span = slice(avatar.expression_start[e], avatar.expression_start[e + 1])
        rest[avatar.expression_vertex[span]] += w * avatar.expression_delta[span]
    bones = joint_transforms(pose[None], avatar.joints, avatar.parents)[0]
    vertices = skin(rest, bones, avatar.skin_index, avatar.skin_weight) + transl - (0, avatar.ground, 0)
    g = avatar.gaussians
    frames = face_frames(vertices, avatar.faces)
    bound = bind(frames, g.face, g.mu, g.quat, g.log_scale)
    colours = g.rgb * shade(g.light, frames.R[g.face, :, 1])

    def draw(places):
        view, parts = view_of(places[-1]), []
        for model in places[:-1]:
            size = np.linalg.norm(model[:, 0])
            total = np.diag([1.0, -1, -1]) @ view[:3, :3] @ model[:, :3] @ MIRROR
            centre = np.diag([1.0, -1, -1]) @ (view[:3, :3] @ model[:, 3] + view[:3, 3])
            parts.append((bound.means @ total.T + centre, total / size @ bound.rotations, bound.scales * size, colours, g.opacity))
        got = render(*(np.concatenate(part).astype(np.float32) for part in zip(*parts, strict=True)), CAMERA)
        return np.concatenate([got.rgb, got.alpha[..., None]], 2)

    return draw


def psnr(got, wanted):
    print(f"{-10 * np.log10(((got - wanted) ** 2).mean()):.1f} dB")
    return -10 * np.log10(((got - wanted) ** 2).mean())


@pytest.mark.parametrize("count", [2, 4])
def test_people_among_each_other_are_one_picture_and_it_is_the_trainers(asked, painted, truth, count):
    pictures, places = painted(asked("together", PEOPLE[:count]))
    wanted = truth(places)
    assert len(pictures) == 1 and (wanted[..., 3] > .5).mean() > .05
    assert psnr(pictures[0], wanted) > 50
    apart, _ = painted(asked("apart", PEOPLE[:count]))
    best = max(psnr(one_after_another(order), wanted) for order in permutations(apart))
    assert len(apart) == count and best < psnr(pictures[0], wanted) - 15, "no order of whole people is right"


def one_after_another(pictures):
    """(H, W, 4) of premultiplied pictures, each over those before."""
    over = np.zeros_like(pictures[0])
    for picture in pictures:
        over = picture + over * (1 - picture[..., 3:])
    return over


@pytest.fixture(scope="module")
def told(play, files):
    """Situation -> dispatches of Join, other dispatches, gaussians of each draw."""
    lines = (line.split(": ") for line in play("crowds", files / "figure.gsac").splitlines())
    return {what: [int(n) for n in numbers.split()] for what, numbers in lines}


def test_people_are_joined_once_and_again_only_when_one_of_them_moves(told, figure):
    N = len(figure.gaussians)
    assert told["four together"][0] == 4 and told["four together"][2:] == [4 * N]
    assert told["at rest"] == [0, 0, 4 * N]
    assert told["one turns"][0] == 4 and told["one turns"][2:] == [4 * N]
    assert told["camera turns"][0] == 0 and told["camera turns"][1] > 0, "sorted only"


def test_people_apart_or_of_another_finish_are_drawn_by_themselves(told, figure):
    N = len(figure.gaussians)
    assert told["one of another tint"][2:] == [N, 3 * N]
    assert told["two by two"][0] == 4 and told["two by two"][2:] == [2 * N, 2 * N] and told["two by two at rest"][:2] == [0, 0]
    assert told["all apart"][0] == 0 and len(told["all apart"][2:]) == 4


def test_a_headset_has_a_budget_that_takes_gaussians_of_the_farthest_first_and_nobody_away(told):
    all_of_them, most, least = (told[what][2:] for what in ("headset", "nine tenths of it", "next to nothing"))
    assert sum(most) <= sum(all_of_them) * .9 and most[0] == all_of_them[0] and len(most) == 4
    assert sum(least) < sum(most) and all(0 < few <= many for few, many in zip(least, all_of_them, strict=True))


def test_a_crowds_buffers_are_given_back(told):
    assert told["buffers"] == [0]
