"""First colours, and the light they were seen in, read from the frames.

Gaussians that no frame shows take the colour of their neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsac.avatar.binding import bind, face_frames
from gsac.avatar.camera import Camera
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.light import FROM_CAMERA, basis, shade
from gsac.avatar.numba_kernel import own_kernel
from gsac.avatar.threads import Workspace, side_by_side
from gsac.avatar.zbuffer import rasterise, visible_points
from gsac.stages.train.gaussians.light_from_above import find_from_above
from gsac.stages.train.gaussians.nearest import find_nearest_among

TOLD = 10.0
"""Independent observations of the light in a frame: its errors are correlated over large parts of the body."""
NOISE = 0.1
"""Sigma of an observed colour, in 0..1."""
EVEN = 0.3
"""Sigma of the prior on the light's directed part: as `find_from_above` has it, and even all round."""
ROUNDS = 12
"""Of colours and light in turns."""
LEAST_FACING = 0.1
"""Cosine between the face's normal and the ray to the camera below which a colour is not read."""
SURE = 200
"""Mask value, of 255, above which a pixel shows the person alone."""


@dataclass
class PosedFrame:
    vertices: np.ndarray
    """(V, 3) m, camera frame."""
    camera: Camera
    pixels: np.ndarray
    """(h, w, 4) uint8, premultiplied RGB and mask."""


@dataclass
class Sight:
    """The colours that one frame shows at the places of M gaussians."""

    which: np.ndarray
    """(M,) indices of the gaussians."""
    colour: np.ndarray
    """(M, 3) in 0..1."""
    normal: np.ndarray
    """(M, 3) of the faces, in the light's axes."""
    weight: np.ndarray
    """(M,), larger for faces seen straight on."""


def read_sights(frames: list[PosedFrame], faces: np.ndarray, gaussians: Gaussians) -> list[Sight]:
    """The colours that the frames show where the gaussians are. faces: (F, 3)."""

    def read(frame: PosedFrame, _: Workspace) -> Sight:
        posed = face_frames(frame.vertices, faces)
        places = bind(posed, gaussians.face, gaussians.mu, gaussians.quat, gaussians.log_scale).means.astype(np.float64)
        facing = -(posed.R[gaussians.face, :, 1] * places).sum(1) / np.maximum(np.linalg.norm(places, axis=1), 1e-9)
        depth = rasterise(frame.vertices, faces, frame.camera)[2]
        visible = np.flatnonzero(visible_points(places, depth, frame.camera) & (facing > LEAST_FACING))
        x, y = frame.camera.project(places[visible]).astype(np.int64).T
        pixel = frame.pixels[y, x].astype(np.float64)
        sure = pixel[:, 3] > SURE
        chosen = visible[sure]
        return Sight(chosen, pixel[sure, :3] / pixel[sure, 3:], posed.R[gaussians.face[chosen], :, 1] * FROM_CAMERA,
                     facing[chosen] ** 2)

    return side_by_side(read, frames)


def mean_colours(sights: list[Sight], count: int, light: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Mean colours of `count` gaussians over the sights, the light (4, 3) divided out.

    Returns rgb (N, 3) float32 in 0..1, grey where unseen, and seen (N,) bool.
    """
    sight = _concatenate(sights)
    return _mean_colours(sight, count, np.ones_like(sight.colour) if light is None else shade(light, sight.normal))


def _concatenate(sights: list[Sight]) -> Sight:
    """All sights as one."""
    parts = zip(*((s.which, s.colour, s.normal, s.weight) for s in sights), strict=True)
    return Sight(*map(np.concatenate, parts)) if sights else Sight(np.zeros(0, np.int64), *np.zeros((2, 0, 3)), np.zeros(0))


def _mean_colours(sight: Sight, count: int, factor: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """As `mean_colours`. factor: (M, 3) of the light."""
    total, weight = np.zeros((2, count, 3))
    _sum_colours(sight.which, sight.colour, sight.weight, factor, total, weight)
    seen = weight[:, 0] > 0
    rgb = np.full((count, 3), 0.5, np.float32)
    rgb[seen] = np.clip(total[seen] / weight[seen], 0, 1)
    return rgb, seen


@own_kernel(nogil=True, error_model="numpy")
def _sum_colours(which, colour, weight, factor, total, square):
    """Adds to the rows which (M,) of total and square, (N, 3) both: colours (M, 3) and 1, by weight (M,) and factor (M, 3)."""
    for i in range(len(which)):
        for c in range(3):
            total[which[i], c] += weight[i] * colour[i, c] * factor[i, c]
            square[which[i], c] += weight[i] * (factor[i, c] * factor[i, c])


@own_kernel(nogil=True, error_model="numpy")
def _weigh_light(which, colour, weight, rgb, square, product):
    """Writes square and product, (M,) both: weight (M,) times the means of rgb rgb and of rgb colour, rgb (N, 3) and colour (M, 3)
    of a gaussian, which (M,).
    """
    for i in range(len(which)):
        own, seen = 0.0, 0.0
        for c in range(3):
            value = np.float64(rgb[which[i], c])
            own += value * value
            seen += value * colour[i, c]
        square[i], product[i] = weight[i] * (own / 3), weight[i] * (seen / 3)


def find_light(sights: list[Sight], places: np.ndarray) -> np.ndarray:
    """(4, 3) float32: the white light that explains the sights of gaussians at places (N, 3) m at rest, each of one colour, best.

    Solves for colours and light in turns, each by least squares, from a light that comes from above as far as the colours say so.
    The light's strength cannot be separated from the brightness of the colours, so its mean over the sights is set to 1. Without a
    turn of the person the prior keeps the light even all round. Coloured lamps are not modelled: in a partial turn they absorb
    stains, and whole turns look as good without.
    """
    light = np.concatenate([np.ones((1, 3)), np.zeros((3, 3))])
    every, count = _concatenate(sights), len(places)
    seen = float(every.weight.sum())
    if not seen:
        return light.astype(np.float32)
    expected = np.array([0, 0, _from_above(every, places), 0])
    light += expected[:, None]
    trust, terms = TOLD * len(sights) / NOISE**2 / seen, basis(every.normal).astype(np.float64)
    prior = np.diag([0, 1, 1, 1]) / EVEN**2
    square, product = np.empty((2, len(every.which)))
    for _ in range(ROUNDS):
        rgb, _ = _mean_colours(every, count, shade(light, every.normal))
        _weigh_light(every.which, every.colour, every.weight, rgb, square, product)
        white = np.linalg.solve(trust * (terms.T @ (terms * square[:, None])) + prior,
                                trust * (terms.T @ product) + prior @ expected)
        mean = float(every.weight @ (terms @ white))
        light = np.tile((white * seen / mean)[:, None], 3)
    return light.astype(np.float32)


def _from_above(sight: Sight, places: np.ndarray) -> float:
    """`find_from_above` of the gaussians' mean colours and normals. places: (N, 3) m at rest."""
    rgb, seen = _mean_colours(sight, len(places), np.ones_like(sight.colour))
    weight = np.bincount(sight.which, sight.weight, len(places))
    up = np.bincount(sight.which, sight.weight * sight.normal[:, 1], len(places)) / np.maximum(weight, 1e-12)
    return find_from_above(rgb[seen], up[seen], places[seen])


def fill_unseen(rgb: np.ndarray, seen: np.ndarray, places: np.ndarray) -> np.ndarray:
    """rgb (N, 3) with unseen rows replaced by the mean of the 4 nearest seen ones. seen: (N,) bool; places: (N, 3) m at rest."""
    if seen.all() or not seen.any():
        return rgb
    out, poor = rgb.copy(), np.flatnonzero(~seen)
    out[poor] = rgb[find_nearest_among(places, np.flatnonzero(seen), poor, 4)].mean(1)
    return out
