"""One frame: the drawn mesh under the lamp, over the room. World: y up; camera frame: OpenCV axes."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from gsac.avatar.camera import Camera
from gsac.avatar.zbuffer import interpolate, rasterise
from gsac.benchmarks.turntable.appearance import Appearance
from gsac.benchmarks.turntable.person import MATERIALS
from gsac.benchmarks.turntable.room import Light, Room
from numba import njit

SHADOW = 768
"""Side of the shadow map, px."""


@dataclass
class View:
    """Where the camera stands."""

    camera: Camera
    rotation: np.ndarray
    """(3, 3) world -> camera."""
    eye: np.ndarray
    """(3,) m, world."""

    def to_camera(self, points: np.ndarray) -> np.ndarray:
        return (points - self.eye) @ self.rotation.T

    def to_world(self, points: np.ndarray) -> np.ndarray:
        return points @ self.rotation + self.eye


@dataclass
class Picture:
    """What one frame shows."""

    colour: np.ndarray
    """(H, W, 3) float32 sRGB in 0..255, before noise."""
    mask: np.ndarray
    """(H, W) uint8, share of the pixel that is person: skin, clothes and hair."""
    depth: np.ndarray
    """(sH, sW) float32 m, of every sample; inf off the person."""


@dataclass
class Studio:
    """Everything of a clip that stands still."""

    view: View
    appearance: Appearance
    light: Light
    room: Room
    supersample: int

    def picture(self, vertices: np.ndarray, feet: np.ndarray) -> Picture:
        """vertices: (N, 3) m drawn mesh, camera frame; feet: (K, 3) m, world."""
        s = self.supersample
        camera = self.view.camera
        big = camera.scaled(camera.width * s, camera.height * s)
        person = self.appearance.person
        face_id, bary, depth = rasterise(vertices, person.faces, big)
        world = self.view.to_world(vertices)
        lamp_depth = self.lamp_depth(world)
        colour = np.zeros((big.height, big.width, 3), np.float32)
        seen = face_id >= 0
        if seen.any():
            rows, columns = np.flatnonzero(seen.any(1)), np.flatnonzero(seen.any(0))
            box = np.s_[rows[0]: rows[-1] + 1, columns[0]: columns[-1] + 1]
            colour[box] = self.shade(world, face_id[box], bary[box], depth[box], lamp_depth)
        h, w = camera.height, camera.width
        colour = colour.reshape(h, s, w, s, 3).mean((1, 3))
        cover = seen.reshape(h, s, w, s).mean((1, 3), dtype=np.float32)
        ground = self.room.with_shadow(np.isfinite(lamp_depth), feet)
        out = colour + ground * (1 - cover[..., None])
        out = np.clip(out / (1 + 0.12 * out), 0, 1) ** (1 / 2.2) * 255
        return Picture(out.astype(np.float32), np.round(cover * 255).astype(np.uint8), depth)

    def lamp_depth(self, world: np.ndarray) -> np.ndarray:
        """(S, S) m along the lamp's axis, inf where nothing blocks it."""
        turn, lamp = self.light.camera(SHADOW)
        return rasterise((world - self.light.place) @ turn.T, self.appearance.person.faces, lamp)[2]

    def shade(self, world, face_id, bary, depth, lamp_depth) -> np.ndarray:
        """(h, w, 3) linear; 0 off the person."""
        person, light = self.appearance.person, self.light
        attributes = np.concatenate([_normals(world, person.faces), world, person.paint, person.region], 1)
        pixels = interpolate(attributes, person.faces, face_id, bary)
        seen = face_id >= 0
        at = pixels[seen]
        normal, place, paint, region = at[:, :3], at[:, 3:6], at[:, 6:9], at[:, 9:]
        material = person.material[face_id[seen]]
        albedo, gloss, bump = self.appearance.paint(material, paint, region)
        to_eye = _unit(self.view.eye.astype(np.float32) - place)
        normal = _unit(normal)
        normal = np.where((normal * to_eye).sum(1, keepdims=True) < -0.15, -normal, normal)
        normal = _unit(normal + bump)
        away = light.place.astype(np.float32) - place
        distance = np.linalg.norm(away, axis=1, keepdims=True)
        to_lamp = away / distance
        turn, lamp = light.camera(SHADOW)
        in_lamp = ((place + 0.006 * normal - light.place) @ turn.T).astype(np.float32)
        lit = _unblocked(in_lamp, lamp_depth, lamp.focal[0], SHADOW)[:, None]
        cosine = (normal * to_lamp).sum(1, keepdims=True)
        fleshy = np.isin(material, [MATERIALS.index("skin"), MATERIALS.index("eye")])[:, None]
        wrap = np.where(fleshy, np.array([0.30, 0.18, 0.14], np.float32), np.float32(0.06))
        diffuse = np.clip((cosine + wrap) / (1 + wrap), 0, 1)
        lit = np.where(fleshy, lit * 0.92 + 0.08 * np.array([1, 0.6, 0.5], np.float32), lit)
        power = (3.2 / distance) ** 1.5
        key = diffuse * lit * power * light.key.astype(np.float32) * 0.95
        open_sky = _openness(depth)[seen][:, None]
        ambient = (light.sky * (0.5 + 0.5 * normal[:, 1:2]) + light.ground * (0.5 - 0.5 * normal[:, 1:2])) * open_sky
        half = _unit(to_lamp + to_eye)
        sharp = np.where(material == MATERIALS.index("eye"), 300.0, 22.0)[:, None]
        shine = np.clip((normal * half).sum(1, keepdims=True), 0, 1) ** sharp * gloss[:, None] * lit * power
        shine = shine * np.where(sharp > 100, 1.2, 0.22)
        out = np.zeros(face_id.shape + (3,), np.float32)
        out[seen] = albedo * (key + ambient) + shine
        return out


def _unit(v):
    return v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-9).astype(np.float32)


def _openness(depth: np.ndarray) -> np.ndarray:
    """(h, w) in 0.4..1: darker where the surface lies behind its surroundings (depth-buffer unsharp mask, Luft 2006)."""
    here = np.isfinite(depth)
    out = np.ones(depth.shape, np.float32)
    middle = np.median(depth[here])
    flat = np.where(here, depth - middle, 0).astype(np.float32)
    for share, strength in ((0.008, 4.0), (0.025, 1.6)):
        sigma = max(1.0, share * depth.shape[0])
        weight = cv2.GaussianBlur(here.astype(np.float32), (0, 0), sigma)
        mean = cv2.GaussianBlur(flat, (0, 0), sigma) / np.maximum(weight, 1e-3)
        out -= strength * np.clip(flat - mean, 0, 0.08)
    return np.clip(out, 0.4, 1)


@njit(cache=True, error_model="numpy")
def _unblocked(points, lamp_depth, focal, size):
    """Share of 5 x 5 shadow-map taps about each point (n, 3), lamp's view, that the lamp reaches."""
    out = np.empty(len(points), np.float32)
    for i in range(len(points)):
        z = points[i, 2]
        u = points[i, 0] / z * focal + size / 2
        v = points[i, 1] / z * focal + size / 2
        free = 0
        for dy in range(-2, 3):
            for dx in range(-2, 3):
                x, y = int(u + dx * 1.3), int(v + dy * 1.3)
                if x < 0 or y < 0 or x >= size or y >= size or z - 0.008 <= lamp_depth[y, x]:
                    free += 1
        out[i] = free / 25
    return out


@njit(cache=True, error_model="numpy")
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
