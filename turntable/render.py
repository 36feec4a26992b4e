"""Draws a frame: the person under the key lamp, composited over the room. World: y up; camera frame: OpenCV axes."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from gsac.avatar.numba_kernel import own_kernel
from gsac.avatar.zbuffer import interpolate, rasterise
from gsac.turntable.appearance import Appearance
from gsac.turntable.person import MATERIALS
from gsac.turntable.room import Lighting, Room
from gsac.turntable.viewpoint import Viewpoint

SHADOW = 768
"""Side of the shadow map, px."""


@dataclass
class Picture:
    """One drawn frame."""

    colour: np.ndarray
    """(H, W, 3) float32 sRGB in 0..255, before noise."""
    mask: np.ndarray
    """(H, W) uint8, coverage of the pixel by the person: skin, clothes and hair."""
    depth: np.ndarray
    """(sH, sW) float32 m, one value a sample, s samples a pixel along each axis; inf off the person."""


@dataclass
class Studio:
    """The constant parts of a clip: camera, colours, light and room."""

    view: Viewpoint
    appearance: Appearance
    light: Lighting
    room: Room
    supersample: int
    """Samples a pixel along each axis."""

    def draw(self, vertices: np.ndarray, feet: np.ndarray) -> Picture:
        """vertices: (N, 3) m, drawn mesh, camera frame; feet: (K, 3) m, world, which darken the floor beneath them."""
        s = self.supersample
        camera = self.view.camera
        big = camera.scaled(camera.width * s, camera.height * s)
        person = self.appearance.person
        face_id, bary, depth = rasterise(vertices, person.faces, big)
        world = self.view.to_world(vertices)
        lamp_depth = self.draw_shadow_map(world)
        colour = np.zeros((camera.height, camera.width, 3), np.float32)
        seen = face_id >= 0
        if seen.any():
            rows, columns = np.flatnonzero(seen.any(1)) // s, np.flatnonzero(seen.any(0)) // s
            y0, y1, x0, x1 = rows[0], rows[-1] + 1, columns[0], columns[-1] + 1
            box = np.s_[y0 * s: y1 * s, x0 * s: x1 * s]
            shaded = self.shade(world, face_id[box], bary[box], depth[box], lamp_depth)
            colour[y0:y1, x0:x1] = cv2.resize(shaded, (int(x1 - x0), int(y1 - y0)), interpolation=cv2.INTER_AREA)
        cover = cv2.resize(seen.astype(np.float32), (camera.width, camera.height), interpolation=cv2.INTER_AREA)
        ground = self.room.cast_shadow(np.isfinite(lamp_depth), feet)
        out = colour + ground * (1 - cover[..., None])
        out = np.clip(out / (1 + np.float32(0.12) * out), 0, 1) ** np.float32(1 / 2.2) * 255
        return Picture(out, np.round(cover * 255).astype(np.uint8), depth)

    def draw_shadow_map(self, world: np.ndarray) -> np.ndarray:
        """world: (N, 3) m, drawn mesh. Returns depth (S, S) m along the lamp's axis, inf where nothing blocks the light."""
        turn, lamp = self.light.shadow_camera(SHADOW)
        return rasterise((world - self.light.place) @ turn.T, self.appearance.person.faces, lamp)[2]

    def shade(self, world: np.ndarray, face_id: np.ndarray, bary: np.ndarray, depth: np.ndarray,
              lamp_depth: np.ndarray) -> np.ndarray:
        """Linear RGB (h, w, 3), 0 off the person.

        world: (N, 3) m, drawn mesh; face_id: (h, w), bary: (h, w, 3), depth: (h, w) m, of the z-buffer; lamp_depth: (S, S) m.
        """
        person, light = self.appearance.person, self.light
        attributes = np.concatenate([_normals(world, person.faces), world, person.paint, person.region], 1)
        seen = face_id >= 0
        at = interpolate(attributes, person.faces, face_id[seen][None], bary[seen][None])[0]
        normal, place, paint, region = at[:, :3], at[:, 3:6], at[:, 6:9], at[:, 9:]
        material = person.material[face_id[seen]]
        albedo, gloss, bump = self.appearance.paint(material, paint, region)
        turn, lamp = light.shadow_camera(SHADOW)
        single = [np.ascontiguousarray(a, np.float32) for a in (
            normal, place, albedo, gloss, bump, _openness(depth)[seen], lamp_depth, turn, light.place, self.view.eye,
            light.key, light.sky, light.ground)]
        out = np.zeros(face_id.shape + (3,), np.float32)
        out[seen] = _light_points(material, *single, np.float32(lamp.focal[0]))
        return out


def _openness(depth: np.ndarray) -> np.ndarray:
    """Ambient occlusion (h, w) in 0.4..1: darker behind the surroundings (unsharp mask of the depth buffer, Luft 2006)."""
    here = np.isfinite(depth)
    small = max(1, depth.shape[1] // 4), max(1, depth.shape[0] // 4)
    middle = np.median(depth[here])
    flat = np.where(here, depth - middle, 0).astype(np.float32)
    less = np.zeros(depth.shape, np.float32)
    weight0, flat0 = (cv2.resize(a, small, interpolation=cv2.INTER_AREA) for a in (here.astype(np.float32), flat))
    for share, strength in ((0.008, 4.0), (0.025, 1.6)):
        sigma = max(0.5, share * small[1])
        mean = cv2.GaussianBlur(flat0, (0, 0), sigma) / np.maximum(cv2.GaussianBlur(weight0, (0, 0), sigma), 1e-3)
        mean = cv2.resize(mean, depth.shape[::-1], interpolation=cv2.INTER_LINEAR)
        less += np.float32(strength) * np.clip(flat - mean, 0, 0.08)
    return np.clip(1 - less, 0.4, 1)


WRAP = np.array([0.30, 0.18, 0.14], np.float32)
"""Wrap of the key light around skin's terminator, by colour."""
GLOW = np.array([0.08, 0.05, 0.04], np.float32)
"""Share of the key light that reaches shadowed skin through the flesh."""
_SKIN, _EYE = MATERIALS.index("skin"), MATERIALS.index("eye")


CORNERS_FIRST = np.array(sorted(((1.3 * x, 1.3 * y, 0) for x in range(-2, 3) for y in range(-2, 3)),
                                key=lambda tap: (abs(tap[0]) != abs(tap[1]) or abs(tap[0]) == 1.3, tap)), np.float32)
"""(25, 3) shadow-map taps: x, y px and a mark. Corners and middle come first; the last of these five is marked."""
CORNERS_FIRST[4, 2] = 1


@own_kernel(error_model="numpy", fastmath=True)
def _light_points(material, normals, places, albedo, gloss, bump, openness, lamp_depth, turn, lamp, eye, key, sky, ground,
                  focal):
    """(n, 3) linear RGB that each point sends to the eye."""
    out = np.empty((len(places), 3), np.float32)
    n, to_eye, to_lamp, half = np.empty(3, np.float32), np.empty(3, np.float32), np.empty(3, np.float32), np.empty(3, np.float32)
    for i in range(len(places)):
        for k in range(3):
            n[k] = normals[i, k]
            to_eye[k] = eye[k] - places[i, k]
            to_lamp[k] = lamp[k] - places[i, k]
        _unit(n)
        _unit(to_eye)
        distance = _unit(to_lamp)
        if n[0] * to_eye[0] + n[1] * to_eye[1] + n[2] * to_eye[2] < -0.15:  # inside of cloth and hair
            for k in range(3):
                n[k] = -n[k]
        free = _unblocked(places[i], n, lamp, turn, lamp_depth, focal)
        for k in range(3):
            n[k] += bump[i, k]
            half[k] = to_lamp[k] + to_eye[k]
        _unit(n)
        _unit(half)
        cosine = n[0] * to_lamp[0] + n[1] * to_lamp[1] + n[2] * to_lamp[2]
        power = (3.2 / distance) ** 1.5
        glance = max(n[0] * half[0] + n[1] * half[1] + n[2] * half[2], 0.0)
        fleshy = material[i] == _SKIN or material[i] == _EYE
        shine = gloss[i] * free * power * (1.2 * glance ** 300 if material[i] == _EYE else 0.22 * glance ** 22)
        up = 0.5 + 0.5 * n[1]
        for k in range(3):
            wrap = WRAP[k] if fleshy else 0.06
            lit = free * 0.92 + GLOW[k] if fleshy else free
            direct = min(max((cosine + wrap) / (1 + wrap), 0.0), 1.0) * lit * power * key[k] * 0.95
            around = (sky[k] * up + ground[k] * (1 - up)) * openness[i]
            out[i, k] = albedo[i, k] * (direct + around) + shine
    return out


@own_kernel(error_model="numpy", fastmath=True)
def _unit(v):
    length = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    if length > 0:
        v /= length
    return length


@own_kernel(error_model="numpy", fastmath=True)
def _unblocked(place, normal, lamp, turn, lamp_depth, focal):
    """Share of the shadow-map taps about a point, lifted 1 cm off its surface, that the lamp reaches."""
    size = lamp_depth.shape[0]
    x = place[0] + np.float32(0.010) * normal[0] - lamp[0]
    y = place[1] + np.float32(0.010) * normal[1] - lamp[1]
    z = place[2] + np.float32(0.010) * normal[2] - lamp[2]
    depth = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z
    u = (turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z) / depth * focal + size / 2
    v = (turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z) / depth * focal + size / 2
    free = 0
    for tap in CORNERS_FIRST:
        column, row = int(u + tap[0]), int(v + tap[1])
        if column < 0 or row < 0 or column >= size or row >= size or depth - 0.012 <= lamp_depth[row, column]:
            free += 1
        if tap[2] == 1 and (free == 0 or free == 5):  # corners and middle agree
            return free / 5
    return free / 25


@own_kernel(error_model="numpy")
def _normals(vertices, faces):
    """(N, 3) float32 unit vertex normals, weighted by area."""
    out = np.zeros(vertices.shape, np.float32)
    for f in range(len(faces)):
        a, b, c = faces[f]
        ux, uy, uz = vertices[b] - vertices[a]
        vx, vy, vz = vertices[c] - vertices[a]
        for i in (a, b, c):
            out[i, 0] += uy * vz - uz * vy
            out[i, 1] += uz * vx - ux * vz
            out[i, 2] += ux * vy - uy * vx
    for i in range(len(out)):
        length = np.sqrt(out[i, 0] ** 2 + out[i, 1] ** 2 + out[i, 2] ** 2)
        if length > 0:
            out[i] /= length
    return out
