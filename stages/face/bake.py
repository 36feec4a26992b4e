"""Measures how the face network answers to each facial action of the open body; writes `actions.npz` beside this file.

`python -m gsac.stages.face.bake STORE`: STORE is the cache folder that `gsac models pull` filled.

The body's head is drawn with each action at full, several bodies and views, and read as `face` reads a clip. What the
network's points do then is what the solver looks for: it differs from what the skin under them does, since the
network slides along lips and lids and damps what it seldom saw.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from gsac.avatar.artifacts import write_arrays
from gsac.avatar.body import Body
from gsac.avatar.camera import Camera
from gsac.avatar.facemesh import MODELS, POINTS, FaceMesh
from gsac.avatar.models import model_path
from gsac.avatar.region import Region
from gsac.avatar.zbuffer import interpolate, rasterise
from gsac.stages.face.actions import TABLE, view_terms
from gsac.stages.face.landmarks import align, look

SIZE = 448
SPAN = 0.36
"""Pixels and metres across the picture."""
DISTANCE = 1.5
CENTER = np.array([0.0, 0.86, 0.10])
"""Of the head, body frame, m."""
YAWS = np.radians((-40.0, -20.0, 0.0, 20.0, 40.0))
SIZES = (1.0, 0.3)
"""At which the actions are measured: small faces are answered to less."""
BODIES = 2
REST_BODIES, REST_VIEWS = 16, 22
REST_YAW, REST_PITCH, REST_SIZE = np.radians(65.0), np.radians(22.0), 0.22
"""The resting face is measured on more bodies, up to these angles and down to this size, at random."""
MODES = 20
SKIN, LIPS, BROWS, HAIR, WHITE, IRIS, PUPIL, WALL = (np.array(c, np.float32) for c in (
    (205, 160, 135), (170, 95, 90), (70, 48, 35), (60, 42, 32), (235, 230, 225), (95, 65, 40), (15, 12, 10),
    (150, 155, 150)))


class Head:
    """Draws the open body's head with painted brows, lips, eyes and hair."""

    def __init__(self, body: Body):
        self.body = body
        names = list(body.expression_names)
        reach = np.linalg.norm(body.exprdirs, axis=1)
        roll = np.max([reach[:, names.index(n)] / reach[:, names.index(n)].max()
                       for n in ("mouthRollLower", "mouthRollUpper")], axis=0)
        part = np.clip((roll - 0.45) / 0.2, 0, 1)[:, None] * (body.v_template[:, 2:] > 0.13)
        self._paint = (SKIN * (1 - part) + LIPS * part).astype(np.float32)
        eyes = [body.joint_names.index(f"{side}_eye_smplhf") for side in ("left", "right")]
        self._eyes = (body.J_regressor @ body.v_template)[eyes]
        self._eyeball = [self._faces_of_ball(eye) for eye in self._eyes]

    def _faces_of_ball(self, center: np.ndarray) -> np.ndarray:
        """(F,) bool, the faces of the loose part of the mesh that lies about an eye's centre."""
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components

        faces, n = self.body.faces, len(self.body.v_template)
        edges = (np.ones(faces.size), (faces.ravel(), np.roll(faces, 1, axis=1).ravel()))
        _, part = connected_components(coo_matrix(edges, shape=(n, n)), directed=False)
        middles = np.array([self.body.v_template[part == p].mean(axis=0) for p in range(part.max() + 1)])
        return part[faces[:, 0]] == np.linalg.norm(middles - center, axis=1).argmin()

    def draw(self, yaw: float, expression: np.ndarray, betas: np.ndarray, pitch: float = 0.0,
             size: int = SIZE) -> np.ndarray:
        """(size, size, 3) uint8; yaw: radians, + to the picture's right; pitch: radians, + downward."""
        body = self.body
        vertices, _ = body.rest(betas, expression)
        (c, s), (d, e) = (np.cos(yaw), np.sin(yaw)), (np.cos(pitch), np.sin(pitch))
        turn = np.array([[1, 0, 0], [0, d, -e], [0, e, d]]) @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        turned = (vertices - CENTER) @ turn.T
        placed = (turned * [1, -1, -1] + [0, 0, DISTANCE]).astype(np.float32)
        camera = Camera((size * DISTANCE / SPAN,) * 2, (size / 2, size / 2), size, size)
        face_id, bary, _ = rasterise(placed, body.faces, camera)
        normal = np.zeros_like(placed)
        corner = placed[body.faces]
        flat = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        for k in range(3):
            np.add.at(normal, body.faces[:, k], flat)
        each = np.hstack([normal, self._paint, body.v_template]).astype(np.float32)
        values = interpolate(each, body.faces, face_id, bary)
        normal, paint, rest = values[..., :3], values[..., 3:6].copy(), values[..., 6:]
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True) + 1e-9
        light = np.array([-0.35, -0.5, -0.8]) / np.linalg.norm([0.35, 0.5, 0.8])
        self._paint_details(paint, rest, face_id)
        shade = 0.45 + 0.6 * np.clip(normal @ light, 0, 1)
        image = np.where((face_id >= 0)[..., None], paint * shade[..., None], WALL)
        return image.clip(0, 255).astype(np.uint8)

    def _paint_details(self, paint: np.ndarray, rest: np.ndarray, face_id: np.ndarray) -> None:
        """Eyes, brows and hair, by where a pixel's surface lies on the resting head."""
        x, y, z = (rest[..., k] for k in range(3))
        for center, ball in zip(self._eyes, self._eyeball, strict=True):
            on = (face_id >= 0) & ball[face_id]
            off = np.hypot(x - center[0], y - center[1])
            paint[on], paint[on & (off < 0.0062)], paint[on & (off < 0.0028)] = WHITE, IRIS, PUPIL
        across = np.abs(x)
        arch = self._eyes[0, 1] + 0.0185 + 0.05 * (across - 0.012) - 0.55 * np.clip(across - 0.035, 0, 1)
        thick = 0.0035 * (1 - 0.5 * np.clip((across - 0.03) / 0.022, 0, 1))
        paint[(across > 0.012) & (across < 0.052) & (np.abs(y - arch) < thick) & (z > 0.09)] = BROWS
        paint[(y > 0.955) | ((z < 0.06) & (y > 0.85))] = HAIR


def mirror_of(points: np.ndarray) -> np.ndarray:
    """points: (468, 3), nearly symmetric in x. Returns (468,) the pairing that is its own inverse and lies closest."""
    from scipy.optimize import linear_sum_assignment

    cost = np.linalg.norm(points[:, None] - points[None] * [-1, 1, 1], axis=-1)
    pair = linear_sum_assignment(cost + cost.T)[1]
    return np.where(pair[pair] == np.arange(len(pair)), pair, np.arange(len(pair)))


class Eye:
    """Reads drawn heads as the stage reads frames."""

    def __init__(self, store: Path):
        self.mesh = FaceMesh({name: model_path(name, store) for name in MODELS})
        self.head = Head(Body.load())
        self.names = list(self.head.body.expression_names)
        self.rest = np.zeros(len(self.names))
        image = self.head.draw(0.0, self.rest, np.zeros(self.head.body.num_figure))
        front = self._find(image)
        self.mirror = mirror_of(_metres(front))
        neutral = _metres(look(self.mesh, image, front, self.mirror).points)
        self.neutral = (neutral + neutral[self.mirror] * [-1, 1, 1]) / 2

    def read(self, expression: np.ndarray, betas: np.ndarray, yaw: float, pitch: float = 0.0,
             size: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """Aligned points (468, 3) m and where the face looks (3,)."""
        import cv2

        image = self.head.draw(yaw, expression, betas, pitch)
        image = cv2.resize(image, None, fx=size, fy=size, interpolation=cv2.INTER_AREA)
        face = look(self.mesh, image, self._find(image), self.mirror)
        return align(face.points, self.neutral, face.facing())

    def _find(self, image: np.ndarray) -> np.ndarray:
        side = float(len(image))
        found = self.mesh.find(image, Region((side / 2, side / 2), side))
        if found is None:
            raise RuntimeError("the network finds no face in a drawn head")
        return found.points


def _metres(points: np.ndarray) -> np.ndarray:
    """points: (468, 3) px of the frontal head. Returns them in m about the root of the nose, y up, z outward."""
    return (points - points[168]) * [1, -1, -1] * (SPAN / SIZE)


def measure_rest(eye: Eye) -> tuple[np.ndarray, np.ndarray]:
    """`view` (10, 468, 3) and `modes` (MODES, 468, 3), mm, of `Actions`."""
    random = np.random.default_rng(1)
    terms, points, body = [], [], []
    for k in range(REST_BODIES):
        betas = random.normal(0, 1, eye.head.body.num_figure)
        for _ in range(REST_VIEWS):
            yaw, pitch = random.uniform(-REST_YAW, REST_YAW), random.uniform(-REST_PITCH, REST_PITCH)
            seen, looks = eye.read(eye.rest, betas, yaw, pitch, float(np.exp(random.uniform(np.log(REST_SIZE), 0))))
            # A mirrored head is as good a witness.
            terms += [view_terms(looks), view_terms(looks * [-1, 1, 1])]
            points += [seen - eye.neutral, (seen - eye.neutral)[eye.mirror] * [-1, 1, 1]]
            body += [2 * k, 2 * k + 1]
    points = np.reshape(points, (len(points), -1)) * 1e3
    design = np.hstack([terms, np.eye(2 * REST_BODIES)[body]])
    fit = np.linalg.lstsq(design, points, rcond=None)[0]
    _, spread, modes = np.linalg.svd((points - design @ fit) / np.sqrt(len(points)), full_matrices=False)
    return fit[:10].reshape(10, POINTS, 3), (spread[:MODES, None] * modes[:MODES]).reshape(-1, POINTS, 3)


def measure_actions(eye: Eye) -> np.ndarray:
    """`response` (E, 468, 3), mm, of `Actions`."""
    bodies = np.random.default_rng(0).normal(0, 0.7, (BODIES, eye.head.body.num_figure))
    settings = [(betas, yaw, size) for betas in bodies for yaw in YAWS for size in SIZES]
    response = np.zeros((len(eye.names), POINTS, 3))
    for betas, yaw, size in settings:
        calm, _ = eye.read(eye.rest, betas, yaw, 0.0, size)
        for k, one in enumerate(np.eye(len(eye.names))):
            response[k] += (eye.read(one, betas, yaw, 0.0, size)[0] - calm) / len(settings) * 1e3
    other = [eye.names.index(n.replace("Left", "?").replace("Right", "Left").replace("?", "Right")) for n in eye.names]
    return (response + response[other][:, eye.mirror] * [-1, 1, 1]) / 2


def measure(store: Path) -> dict[str, np.ndarray]:
    """The arrays of `Actions`, in half precision where they are differences."""
    eye = Eye(store)
    view, modes = measure_rest(eye)
    return {"neutral": eye.neutral.astype(np.float32), "mirror": eye.mirror.astype(np.int16),
            "view": view.astype(np.float32), "modes": modes.astype(np.float16),
            "response": measure_actions(eye).astype(np.float16), "names": np.array(eye.names)}


def main() -> None:
    write_arrays(TABLE, **measure(Path(sys.argv[1])))


if __name__ == "__main__":
    main()
