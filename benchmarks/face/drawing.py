"""Draws the open body's head with painted brows, lips, eyes and hair under one plain light: a second renderer beside the turntable.

The face network is measured on both: its response to one renderer alone would be overfitted.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from gsac.avatar.body import Body
from gsac.avatar.camera import Camera
from gsac.avatar.zbuffer import interpolate, rasterise

SIZE, SPAN = 448, 0.36
"""Width of the picture in px and in m."""
DISTANCE = 1.5
"""m from the camera to the head."""
CENTER = np.array([0.0, 0.86, 0.10])
"""(3,) m, centre of the head in the body's frame."""
SMALLEST = 0.22
"""Least factor by which a picture is scaled down."""
SKINS = ((236, 188, 160), (205, 160, 135), (170, 118, 88), (110, 74, 54), (225, 178, 150))
WHITE, PUPIL = np.array([235, 230, 225], np.float32), np.array([15, 12, 10], np.float32)
WALLS = ((150, 155, 150), (60, 66, 74), (208, 204, 196), (120, 96, 78))
NOISE = 2.0
"""Standard deviation of the sensor noise, 8-bit steps."""


@dataclass
class Portrait:
    """Colours, brows and light of one person; colours are 8-bit RGB."""

    skin: np.ndarray  # (3,)
    lips: np.ndarray  # (3,)
    hair: np.ndarray  # (3,)
    brows: np.ndarray  # (3,)
    iris: np.ndarray  # (3,)
    wall: np.ndarray  # (3,)
    light: np.ndarray
    """(3,) unit direction to the lamp, camera frame."""
    ambient: float
    """Share of the colour that shows without the lamp."""
    brow_height: float
    """m above the eyes."""
    brow_thick: float
    """m, half of the thickness."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Portrait:
        """Draws a random person."""
        def near(colour: np.ndarray | tuple[int, int, int], spread: float) -> np.ndarray:
            return (np.asarray(colour, np.float32) * rng.uniform(1 - spread, 1 + spread, 3)).astype(np.float32)

        skin = near(SKINS[rng.integers(len(SKINS))], 0.06)
        hair = near((60, 42, 32), 0.5)
        light = np.array([rng.uniform(-0.6, 0.6), rng.uniform(-0.9, -0.2), -0.8])
        return cls(skin, near(skin * [0.83, 0.6, 0.66], 0.1), hair, near(hair * 1.1, 0.2), near((95, 75, 55), 0.4),
                   near(WALLS[rng.integers(len(WALLS))], 0.1), light / np.linalg.norm(light), rng.uniform(0.35, 0.6),
                   rng.uniform(0.015, 0.024), rng.uniform(0.002, 0.0045))


class Head:
    """Draws one person's head. betas: (B,)."""

    def __init__(self, body: Body, betas: np.ndarray, portrait: Portrait):
        self.body, self.betas, self.portrait = body, betas, portrait
        names = list(body.expression_names)
        reach = np.linalg.norm(body.exprdirs, axis=1)
        roll = np.max([reach[:, names.index(n)] / reach[:, names.index(n)].max()
                       for n in ("mouthRollLower", "mouthRollUpper")], axis=0)
        part = np.clip((roll - 0.45) / 0.2, 0, 1)[:, None] * (body.v_template[:, 2:] > 0.13)
        self._paint = (portrait.skin * (1 - part) + portrait.lips * part).astype(np.float32)
        eyes = [body.joint_names.index(f"{side}_eye_smplhf") for side in ("left", "right")]
        self._eyes = (body.J_regressor @ body.v_template)[eyes]
        self._balls = [self._faces_of_ball(eye) for eye in self._eyes]

    def _faces_of_ball(self, center: np.ndarray) -> np.ndarray:
        """Faces (F,) bool of the mesh's connected component nearest to an eye's centre (3,) m: the eyeball."""
        faces, n = self.body.faces, len(self.body.v_template)
        edges = (np.ones(faces.size), (faces.ravel(), np.roll(faces, 1, axis=1).ravel()))
        _, part = connected_components(coo_matrix(edges, shape=(n, n)), directed=False)
        middles = np.array([self.body.v_template[part == p].mean(axis=0) for p in range(part.max() + 1)])
        return part[faces[:, 0]] == np.linalg.norm(middles - center, axis=1).argmin()

    def draw(self, turn: np.ndarray, expression: np.ndarray, share: float, rng: np.random.Generator) -> np.ndarray:
        """Picture (n, n, 3) uint8 RGB.

        turn: (3, 3) rotation of the head, y up, z to the camera; expression: (52,); share: factor on the picture's size.
        """
        body, portrait = self.body, self.portrait
        vertices, _ = body.rest(self.betas, expression)
        placed = ((vertices - CENTER) @ turn.T * [1, -1, -1] + [0, 0, DISTANCE]).astype(np.float32)
        camera = Camera((SIZE * DISTANCE / SPAN,) * 2, (SIZE / 2, SIZE / 2), SIZE, SIZE)
        face_id, bary, _ = rasterise(placed, body.faces, camera)
        normal, corner = np.zeros_like(placed), placed[body.faces]
        flat = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        for k in range(3):
            np.add.at(normal, body.faces[:, k], flat)
        values = interpolate(np.hstack([normal, self._paint, body.v_template]).astype(np.float32), body.faces, face_id, bary)
        normal, paint, rest = values[..., :3], values[..., 3:6].copy(), values[..., 6:]
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True) + 1e-9
        self._paint_details(paint, rest, face_id)
        shade = portrait.ambient + 0.6 * np.clip(normal @ portrait.light, 0, 1)
        image = np.where((face_id >= 0)[..., None], paint * shade[..., None], portrait.wall)
        image = cv2.resize(image.astype(np.float32), None, fx=share, fy=share, interpolation=cv2.INTER_AREA)
        return (image + rng.normal(0, NOISE, image.shape)).clip(0, 255).astype(np.uint8)

    def _paint_details(self, paint: np.ndarray, rest: np.ndarray, face_id: np.ndarray) -> None:
        """Paints eyes, brows and hair into `paint`, by each pixel's place `rest` (n, n, 3) m on the template."""
        x, y, z = (rest[..., k] for k in range(3))
        for center, ball in zip(self._eyes, self._balls, strict=True):
            on = (face_id >= 0) & ball[face_id]
            off = np.hypot(x - center[0], y - center[1])
            paint[on], paint[on & (off < 0.0062)], paint[on & (off < 0.0028)] = WHITE, self.portrait.iris, PUPIL
        across = np.abs(x)
        arch = self._eyes[0, 1] + self.portrait.brow_height + 0.05 * (across - 0.012) - 0.55 * np.clip(across - 0.035, 0, 1)
        thick = self.portrait.brow_thick * (1 - 0.5 * np.clip((across - 0.03) / 0.022, 0, 1))
        paint[(across > 0.012) & (across < 0.052) & (np.abs(y - arch) < thick) & (z > 0.09)] = self.portrait.brows
        paint[(y > 0.955) | ((z < 0.06) & (y > 0.85))] = self.portrait.hair
