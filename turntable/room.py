"""The static scene: a room of textured planes and a cabinet, drawn once, and the person's shadow on it.

World: y up, person at the origin on the floor y = 0, camera at +z.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from gsac.avatar.camera import Camera
from gsac.turntable.appearance import to_linear
from gsac.turntable.noise import make_noise, sample_noise
from gsac.turntable.viewpoint import look_at

WALLS = ((196, 190, 178), (170, 184, 190), (204, 186, 168), (184, 192, 176))
FLOORS = ((150, 112, 78), (120, 92, 70), (164, 140, 112))
ACCENTS = ((170, 90, 60), (60, 100, 120), (190, 160, 80), (90, 110, 80))


@dataclass
class Lighting:
    """One soft key lamp and ambient light, linear RGB."""

    place: np.ndarray
    """(3,) m, world, of the key lamp."""
    key: np.ndarray
    """(3,) colour of the key lamp."""
    sky: np.ndarray
    """(3,) ambient light from above."""
    ground: np.ndarray
    """(3,) ambient light from below."""

    def shadow_camera(self, size: int) -> tuple[np.ndarray, Camera]:
        """Rotation (3, 3) world -> lamp, and the lamp's pinhole camera: its image of `size` px a side is the shadow map."""
        middle = np.array([0, 0.85, 0])
        focal = 0.5 * size * np.linalg.norm(middle - self.place) / 1.35
        return look_at(self.place, middle), Camera((focal, focal), (size / 2, size / 2), size, size)


@dataclass
class Room:
    """The camera's image without the person."""

    colour: np.ndarray
    """(H, W, 3) linear RGB."""
    place: np.ndarray
    """(H, W, 3) float32 m, world, of the surface in each pixel."""
    key_share: np.ndarray
    """(H, W) share of the key lamp in the light of each pixel."""
    lamp_map: np.ndarray
    """(H, W, 2) float32 px, each pixel's place in the shadow map."""
    floor_row: int
    """First row whose pixels are mostly floor."""

    def cast_shadow(self, blocked: np.ndarray, feet: np.ndarray) -> np.ndarray:
        """blocked: (S, S) bool, shadow map; feet: (K, 3) m, world, for contact shadows. Returns linear RGB (H, W, 3)."""
        soft = cv2.GaussianBlur(blocked.astype(np.float32), (0, 0), blocked.shape[0] / 90)
        shadow = cv2.remap(soft, self.lamp_map, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
        light = 1 - self.key_share * shadow * np.float32(0.85)
        first = self.floor_row
        x, z = self.place[first:, :, 0], self.place[first:, :, 2]
        for foot in feet.astype(np.float32):
            near = (x - foot[0]) ** 2 + (z - foot[2]) ** 2
            lifted = np.float32(np.exp(-max(foot[1] - 0.1, 0) / 0.1))
            light[first:] *= 1 - 0.55 * lifted * np.exp(near * np.float32(-50))
        return self.colour * light[..., None]


def make_lighting(rng: np.random.Generator) -> Lighting:
    """Draws side, height and tint of the key lamp."""
    side = rng.choice([-1, 1])
    warm = rng.uniform(-0.06, 0.06)
    return Lighting(np.array([side * rng.uniform(1.2, 2.0), rng.uniform(2.6, 3.2), rng.uniform(2.0, 2.8)]),
                    np.array([1 + warm, 1, 1 - warm]) * 1.15, np.array([0.40, 0.42, 0.45]), np.array([0.22, 0.19, 0.17]))


def make_room(camera: Camera, to_world: np.ndarray, eye: np.ndarray, light: Lighting, shadow_size: int,
              rng: np.random.Generator) -> Room:
    """Ray-traces the room at twice the camera's size and averages.

    to_world: (3, 3) camera -> world; eye: (3,) m, world; shadow_size: px a side of the shadow map.
    """
    big = camera.scaled(camera.width * 2, camera.height * 2)
    ys, xs = np.mgrid[: big.height, : big.width].astype(np.float32) + 0.5
    ray = np.stack([(xs - big.center[0]) / big.focal[0], (ys - big.center[1]) / big.focal[1], np.ones_like(xs)], -1)
    ray = ray.reshape(-1, 3) @ to_world.T.astype(np.float32)
    place, normal, surface = _trace(ray, eye.astype(np.float32), rng)
    albedo = _albedo(place, surface, rng)
    to_lamp = light.place.astype(np.float32) - place
    distance = np.linalg.norm(to_lamp, axis=1, keepdims=True)
    key = np.clip((normal * to_lamp).sum(1, keepdims=True) / distance, 0, 1) * (3.2 / distance) ** 1.5
    lit_key = key * light.key * 0.8
    lit_all = light.sky * (0.5 + 0.5 * normal[:, 1:2]) + light.ground * (0.5 - 0.5 * normal[:, 1:2])
    lit_all = lit_all * (1 - 0.35 * np.exp(-_corner(place) / 0.18))[:, None]
    colour = albedo * (lit_key + lit_all)
    share = lit_key.mean(1) / (lit_key + lit_all).mean(1)

    def small(a, c):
        return cv2.resize(a.reshape(big.height, big.width, c).astype(np.float32), (camera.width, camera.height),
                          interpolation=cv2.INTER_AREA)

    place = small(place, 3)
    turn, lamp = light.shadow_camera(shadow_size)
    seen = lamp.project((place.reshape(-1, 3) - light.place) @ turn.T)
    lamp_map = (seen - 0.5).reshape(camera.height, camera.width, 2).astype(np.float32)
    floor = (place[..., 1] < 0.02).mean(1) > 0.5
    floor_row = int(floor.argmax()) if floor.any() else camera.height
    return Room(small(colour, 3), place, small(share, 1), lamp_map, floor_row)


HALF, BACK, TOP = 1.9, -1.5, 2.7
"""m, world: x of the side walls, z of the back wall, y of the ceiling."""


def _trace(ray, eye, rng):
    """Place (n, 3), normal (n, 3), surface (n,): 0 floor, 1-3 back, left, right, 4 ceiling, 5-7 cabinet front, top, side."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ts = np.stack([-eye[1] / ray[:, 1], (BACK - eye[2]) / ray[:, 2], (-HALF - eye[0]) / ray[:, 0],
                       (HALF - eye[0]) / ray[:, 0], (TOP - eye[1]) / ray[:, 1]], 1)
    ts[~(ts > 1e-4)] = np.inf
    surface = ts.argmin(1)
    t = ts.min(1)
    normals = np.float32([[0, 1, 0], [0, 0, 1], [1, 0, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 1, 0], [1, 0, 0]])
    side = rng.choice([-1, 1])
    width, height = rng.uniform(0.5, 0.8), rng.uniform(0.6, 1.0)
    low = np.array([side * 1.15 - width / 2, 0, BACK], np.float32)
    high = np.array([side * 1.15 + width / 2, height, BACK + 0.4], np.float32)
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (low - eye) / ray, (high - eye) / ray
    enter, leave = np.minimum(a, b), np.maximum(a, b).min(1)
    axis, at = enter.argmax(1), enter.max(1)
    hit = (at > 0) & (at < leave) & (at < t)
    surface = np.where(hit, np.array([7, 6, 5])[axis], surface)
    t = np.where(hit, at, t)
    normal = normals[surface].copy()
    normal[surface == 7, 0] = -np.sign(ray[surface == 7, 0])
    return (eye + ray * t[:, None]).astype(np.float32), normal, surface


def _albedo(place, surface, rng):
    noise = make_noise(rng)
    wall, floor, accent, second = (to_linear(t[rng.integers(len(t))]) for t in (WALLS, FLOORS, ACCENTS, ACCENTS))
    x, y, z = place.T
    out = np.broadcast_to(wall, place.shape) * (
        1 + 0.05 * sample_noise(noise, place, 3)[:, :1] + 0.05 * sample_noise(noise, place, 60)[:, 1:2])
    on = surface == 0
    plank = np.floor(x[on] / 0.14)
    end = np.floor((z[on] + plank * 0.37) / 0.9)
    tone = np.sin(plank * 12.9898 + end * 78.233) * 43758.5453
    tone = tone - np.floor(tone)
    grain = sample_noise(noise, place[on], (90, 1, 5))[:, 0] * 0.12 + sample_noise(noise, place[on], (300, 1, 12))[:, 0] * 0.08
    gap = np.minimum(np.abs((x[on] / 0.14) % 1 - 0.5), np.abs(((z[on] + plank * 0.37) / 0.9) % 1 - 0.5) * 6)
    out[on] = floor * (0.8 + 0.4 * tone + grain)[:, None] * (0.55 + 0.45 * np.clip(gap / 0.02, 0, 1))[:, None]
    rug = on & (np.abs(x) < 0.95) & (z > -1.0) & (z < 0.85)
    ring = np.minimum(0.95 - np.abs(x[rug]), np.minimum(z[rug] + 1.0, 0.85 - z[rug]))
    woven = 1 + 0.12 * sample_noise(noise, place[rug], 150)[:, :1]
    border = ((ring > 0.06) & (ring < 0.10))[:, None]
    out[rug] = np.where(border, to_linear((210, 200, 180)), second * 0.6 + 0.12) * woven
    walls = (surface >= 1) & (surface <= 3)
    skirting = walls & (y < 0.09)
    out[skirting] = to_linear((222, 218, 210))
    out[surface == 4] = to_linear((225, 224, 220))
    back = surface == 1
    for _ in range(2):
        cx, cy = rng.uniform(-1.4, 1.4), rng.uniform(1.45, 1.8)
        w, h = rng.uniform(0.2, 0.36), rng.uniform(0.22, 0.32)
        inside = np.maximum(np.abs(x - cx) / w, np.abs(y - cy) / h)
        frame, canvas = back & (inside < 1) & (inside >= 0.88), back & (inside < 0.88)
        out[frame] = to_linear((50, 40, 34))
        art = sample_noise(noise, place[canvas] - [cx, cy, 0], (9, 9, 1))
        out[canvas] = accent * 0.5 + 0.25 + 0.3 * (art > 0) * (second + 0.1)
    shelf = surface >= 5
    book = np.floor(x[shelf] / 0.045)
    tint = np.stack([np.sin(book * k) for k in (12.1, 7.7, 3.3)], -1) * 0.5 + 0.5
    row = (y[shelf] % 0.28) / 0.28
    wood = floor * (0.9 + 0.2 * sample_noise(noise, place[shelf], (6, 90, 90))[:, :1])
    books = (row > 0.12) & (row < 0.72 + 0.12 * tint[:, 0]) & (surface[shelf] == 5)
    hollow = (row > 0.12) & (surface[shelf] == 5)
    out[shelf] = np.where(books[:, None], 0.05 + 0.35 * tint, np.where(hollow[:, None], 0.03, wood))
    return out


def _corner(place):
    """Distance (n,) m to the second-nearest plane of the room: small in its corners."""
    x, y, z = place.T
    gaps = np.abs(np.stack([y, z - BACK, HALF - x, HALF + x, TOP - y], 1))
    return np.sort(gaps, 1)[:, 1]
