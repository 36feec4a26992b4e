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
from gsac.avatar.threads import Workspace, side_by_side
from gsac.avatar.zbuffer import rasterise, visible_points
from gsac.stages.train.gaussians.nearest import find_nearest

TOLD = 10.0
"""Independent observations of the light in a frame: its errors are correlated over large parts of the body."""
NOISE = 0.1
"""Sigma of an observed colour, in 0..1."""
EVEN = 0.3
"""Sigma of the prior on the light's directed part."""
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
    return _mean_colours(_concatenate(sights), count, light)


def _concatenate(sights: list[Sight]) -> Sight:
    """All sights as one."""
    parts = zip(*((s.which, s.colour, s.normal, s.weight) for s in sights), strict=True)
    return Sight(*map(np.concatenate, parts)) if sights else Sight(np.zeros(0, np.int64), *np.zeros((2, 0, 3)), np.zeros(0))


def _mean_colours(sight: Sight, count: int, light: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    factor = np.ones_like(sight.colour) if light is None else shade(light, sight.normal)
    weighted, square = sight.weight[:, None] * sight.colour * factor, sight.weight[:, None] * factor**2
    total, weight = (np.stack([np.bincount(sight.which, channel, count) for channel in values.T], 1)
                     for values in (weighted, square))
    seen = weight[:, 0] > 0
    rgb = np.full((count, 3), 0.5, np.float32)
    rgb[seen] = np.clip(total[seen] / weight[seen], 0, 1)
    return rgb, seen


def find_light(sights: list[Sight], count: int) -> np.ndarray:
    """(4, 3) float32: the white light that explains the sights of `count` gaussians, each of one colour, best.

    Solves for colours and light in turns, each by least squares. The light's strength cannot be separated from the brightness of
    the colours, so its mean over the sights is set to 1. Without a turn of the person the prior keeps the light even. Coloured
    lamps are not modelled: in a partial turn they absorb stains, and whole turns look as good without.
    """
    light = np.concatenate([np.ones((1, 3)), np.zeros((3, 3))])
    every = _concatenate(sights)
    seen = float(every.weight.sum())
    if not seen:
        return light.astype(np.float32)
    trust, terms = TOLD * len(sights) / NOISE**2 / seen, basis(every.normal).astype(np.float64)
    for _ in range(ROUNDS):
        rgb = _mean_colours(every, count, light)[0].astype(np.float64)[every.which]
        square = terms.T @ (terms * (every.weight * (rgb**2).mean(1))[:, None])
        product = terms.T @ (every.weight * (rgb * every.colour).mean(1))
        prior = np.diag([0, 1, 1, 1]) / EVEN**2
        white = np.linalg.solve(trust * square + prior, trust * product)
        mean = float(every.weight @ (terms @ white))
        light = np.tile((white * seen / mean)[:, None], 3)
    return light.astype(np.float32)


def fill_unseen(rgb: np.ndarray, seen: np.ndarray, places: np.ndarray) -> np.ndarray:
    """rgb (N, 3) with unseen rows replaced by the mean of the 4 nearest seen ones. seen: (N,) bool; places: (N, 3) m at rest."""
    if seen.all() or not seen.any():
        return rgb
    out = rgb.copy()
    out[~seen] = rgb[seen][find_nearest(places[seen], places[~seen], 4)].mean(1)
    return out
