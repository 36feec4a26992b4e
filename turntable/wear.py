"""What a person wears or holds that is no raised piece of skin: a skirt, long hair, glasses, a cap's brim, a hood, a phone.

Places are m in the T-pose: +x to the person's left, +y up, +z forward.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from gsac.avatar.joints import INDEX
from gsac.avatar.mesh import vertex_normals
from gsac.turntable.shell import Piece, Shell

EYES_OF = {1: slice(13574, 13646), -1: slice(13646, 13718)}
SECTORS = 48


def skirt(trunk: np.ndarray, joints: np.ndarray, hem: float, thick: float) -> Piece:
    """From the waist to the knees, wider below. trunk: (K, 3) m, what it goes around; joints: (55, 3) m; hem: m, the shirt's."""
    top = joints[INDEX["pelvis"], 1] + hem - 0.153 + 0.08
    low = joints[INDEX["left_knee"], 1] - 0.01
    rows = np.linspace(top, low, 28)
    angle = np.arange(SECTORS) * 2 * np.pi / SECTORS
    way = np.stack([np.sin(angle), np.zeros(SECTORS), np.cos(angle)], 1)
    axis = np.array([0, 0, joints[INDEX["pelvis"], 2] + 0.01])
    radius = np.stack([((trunk[np.abs(trunk[:, 1] - y) < 0.02] - axis) @ way.T).max(0) for y in rows])
    down = np.linspace(0, 1, len(rows))[:, None]
    fold = 0.010 * np.sin(9 * angle + 1) + 0.006 * np.sin(14 * angle)
    radius = np.maximum.accumulate(radius, 0) + thick * (0.006 + 0.06 * down + fold * down)
    points = (axis + way[None] * radius[..., None] + rows[:, None, None] * [0, 1.0, 0]).reshape(-1, 3)
    leg = 0.8 * np.clip((top - points[:, 1] - 0.08) / 0.25, 0, 1)
    left = np.clip(0.5 + points[:, 0] / 0.24, 0, 1)
    weight = np.stack([1 - leg, leg * left, leg * (1 - left)], 1)
    return piece("skirt", points, grid_faces(len(rows), SECTORS, True), ("pelvis", "left_hip", "right_hip"), weight)


def long_hair(hair: np.ndarray, drawn: np.ndarray, joints: np.ndarray, thick: float) -> Piece:
    """Hair down the back. hair: (K, 3) m, surface of the hair on the head; drawn: (M, 3) m, skin and clothes; joints: (55, 3) m."""
    head, neck = joints[INDEX["head"]], joints[INDEX["neck"]]
    rows = np.linspace(head[1] + 0.085, neck[1] - 0.27, 40)
    middle = np.array([0, 0, head[2] - 0.02])
    open_to = np.interp(rows, [neck[1] - 0.08, neck[1] + 0.02, head[1]], [0.95, 1.15, 1.75])
    columns = np.linspace(-1, 1, 41)
    angle = np.pi + open_to[:, None] * columns  # pi is behind
    way = np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], -1)
    solid = np.concatenate([hair, drawn[np.abs(drawn[:, 0]) < 0.22]])
    flat = (solid - middle) * [1, 0, 1]
    at = np.hypot(flat[:, 0], flat[:, 2])
    radius = np.zeros(angle.shape)
    for i, y in enumerate(rows):
        here = np.abs(solid[:, 1] - y) < 0.014
        facing = flat[here] @ way[i].T / np.maximum(at[here, None], 1e-9)
        radius[i] = np.where(facing > np.cos(0.10), at[here, None], 0).max(0, initial=0)
        if i:
            radius[i] = np.maximum(radius[i], radius[i - 1] - 0.003)
    for _ in range(4):  # a smooth sheet that stays outside
        mean = radius.copy()
        mean[1:-1] = (radius[:-2] + radius[1:-1] + radius[2:]) / 3
        mean[:, 1:-1] = (mean[:, :-2] + mean[:, 1:-1] + mean[:, 2:]) / 3
        radius = np.maximum(radius, mean)
    lower = np.linspace(0, 1, len(rows))[:, None]
    strand = 0.004 * np.sin(columns * 23) + 0.003 * np.sin(columns * 41 + 2)
    radius = np.minimum(radius, 0.19) + thick * (0.006 + 0.012 * np.sin(np.pi * lower) * (1 - columns**2) + strand * lower)
    points = middle + way * radius[..., None] + rows[:, None, None] * [0, 1.0, 0]
    points[..., 1] -= 0.035 * lower * (1 - columns**2) + 0.012 * lower * np.sin(columns * 31)
    points = points.reshape(-1, 3)
    high = np.clip((points[:, 1] - neck[1] + 0.03) / 0.13, 0, 1)
    return piece("hair", points, grid_faces(len(rows), len(columns), False), ("head", "spine3"), np.stack([high, 1 - high], 1))


def hood(skin: np.ndarray, faces: np.ndarray, joints: np.ndarray, thick: float) -> Piece:
    """A hood that lies on neck and back. skin: (V, 3) m; faces: (F, 3) of the skin; joints: (55, 3) m."""
    neck = joints[INDEX["neck"]]
    along = np.linspace(-1.7, 1.7, 33)  # from the left of the throat over the back to the right
    behind = np.cos(along / 2)
    centre = np.stack([0.130 * np.sin(along), neck[1] - 0.03 - 0.045 * behind**2,
                       neck[2] - 0.005 - (0.09 + 0.05 * behind) * np.cos(along)], 1)
    out = np.stack([np.sin(along), np.zeros_like(along), -np.cos(along)], 1)
    size = (0.35 + 0.65 * behind)[:, None, None] * thick
    turn = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    ring = 0.034 * np.cos(turn)[None, :, None] * out[:, None] + 0.058 * np.sin(turn)[None, :, None] * [0, 1.0, 0]
    points = (centre[:, None] + size * ring).reshape(-1, 3)
    nearest = KDTree(skin).query(points)[1]
    outward = vertex_normals(skin, faces)[nearest]
    points += outward * np.maximum(0.004 - ((points - skin[nearest]) * outward).sum(1), 0)[:, None]
    return piece("shirt", points, grid_faces(len(along), len(turn), True), ("spine3",), np.ones((len(points), 1)))


def glasses(rest: np.ndarray, joints: np.ndarray) -> list[Piece]:
    """Two rims, a bridge and two temples. rest: (V, 3) m; joints: (55, 3) m."""
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    lines, rims = [], {}
    for sign, eye in EYES_OF.items():
        centre = rest[eye].mean(0) + [0.003 * sign, -0.003, 0.027]
        rims[sign] = centre
        oval = np.stack([0.027 * np.sign(np.cos(turn)) * np.abs(np.cos(turn)) ** 0.8,
                         0.020 * np.sign(np.sin(turn)) * np.abs(np.sin(turn)) ** 0.8, 0 * turn], 1)
        lines.append((centre + oval, True))
        skull = rest[(np.abs(rest[:, 1] - centre[1] - 0.006) < 0.012) & (np.abs(rest[:, 2] - joints[INDEX["head"], 2]) < 0.03)
                     & (np.abs(rest[:, 0]) < 0.12)]
        wide = np.abs(skull[:, 0]).max() + 0.001 if len(skull) else 0.075
        hinge = centre + [0.028 * sign, 0.006, -0.002]
        ear = np.array([sign * wide, centre[1] + 0.008, joints[INDEX["head"], 2] - 0.012])
        lines.append((hinge + (ear - hinge) * np.linspace(0, 1, 8)[:, None] ** [[0.6, 1, 1]], False))
    left, right = rims[1] - [0.026, -0.004, 0], rims[-1] + [0.026, 0.004, 0]
    arch = np.linspace(0, 1, 7)[:, None]
    lines.append((left + (right - left) * arch + np.sin(np.pi * arch) * [0, 0.004, 0.003], False))
    return [tube("glasses", line, closed, 0.0022, "head") for line, closed in lines]


def brim(hat: Shell, template: np.ndarray, joints: np.ndarray) -> Piece:
    """The brim of a cap. hat: its crown; template: (V, 3) m; joints: (55, 3) m."""
    used = np.unique(hat.pair)
    crown = hat.rest[used][np.abs(template[used, 1] - 0.945) < 0.018]
    middle = np.array([0, 0, joints[INDEX["head"], 2] + 0.01])
    angle = np.linspace(-1.05, 1.05, 25)
    way = np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], 1)
    edge = ((crown - middle) @ way.T).max(0)
    height = np.percentile(crown[crown[:, 2] > middle[2], 1], 30)
    out = np.linspace(-0.15, 1, 7)[:, None]
    radius = edge - 0.002 + 0.075 * out * np.cos(angle * 1.4).clip(0.02)
    drop = 0.014 * np.abs(out) ** 1.5 + 0.022 * (1 - np.cos(angle))
    points = middle + way * radius[..., None] + (height - drop)[..., None] * [0, 1.0, 0]
    points = points.reshape(-1, 3)
    return piece("hat", points, grid_faces(7, 25, False), ("head",), np.ones((len(points), 1)))


def phone(joints: np.ndarray, side: str) -> Piece:
    """A phone in the palm of a hand, its screen towards the person's eyes. joints: (55, 3) m."""
    wrist, knuckle = joints[INDEX[f"{side}_wrist"]], joints[INDEX[f"{side}_middle1"]]
    centre = wrist + 1.05 * (knuckle - wrist) + [0, -0.034, 0.004]
    half = np.array([0.074, 0.0045, 0.036])
    points, paint, faces = [], [], []
    for axis in range(3):
        for way in (-1, 1):
            u, v = np.roll(np.arange(3), -axis)[1:]
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                corner = np.zeros(3)
                corner[[axis, u, v]] = way, a, b
                points.append(centre + corner * half)
                paint.append([*corner[[u, v]], float(axis == 1 and way < 0)])
            n = len(points) - 4
            faces += [[n, n + 1, n + 2], [n, n + 2, n + 3]] if way > 0 else [[n, n + 2, n + 1], [n, n + 3, n + 2]]
    out = piece("phone", np.array(points), np.array(faces), (f"{side}_wrist",), np.ones((len(points), 1)))
    out.paint = np.array(paint, np.float32)
    return out


def tube(material: str, line: np.ndarray, closed: bool, radius: float, joint: str) -> Piece:
    """A thin tube along the points line (n, 3) m; closed: a ring."""
    ahead = np.roll(line, -1, 0) - np.roll(line, 1, 0) if closed else np.gradient(line, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    first = np.cross(ahead, [0.02, 0.11, 1.0])
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-9)
    second = np.cross(ahead, first)
    turn = np.linspace(0, 2 * np.pi, 6, endpoint=False)
    ring = first[:, None] * np.cos(turn)[None, :, None] + second[:, None] * np.sin(turn)[None, :, None]
    points = (line[:, None] + radius * ring).reshape(-1, 3)
    faces = grid_faces(len(line), 6, True)
    if closed:
        faces = np.concatenate([faces, (grid_faces(2, 6, True) + (len(line) - 1) * 6) % len(points)])
    return piece(material, points, faces, (joint,), np.ones((len(points), 1)))


def piece(material: str, points: np.ndarray, faces: np.ndarray, joints: tuple[str, ...], weight: np.ndarray) -> Piece:
    """A piece that follows up to four joints, painted by place. points: (M, 3) m; faces: (F, 3); weight: (M, len(joints))."""
    index = np.zeros((len(points), 4), np.int64)
    share = np.zeros((len(points), 4), np.float32)
    index[:, :len(joints)] = [INDEX[name] for name in joints]
    share[:, :len(joints)] = weight
    return Piece(material, points.astype(np.float32), faces, points.astype(np.float32), index, share)


def grid_faces(rows: int, columns: int, closed: bool) -> np.ndarray:
    """(F, 3) triangles of a grid of rows x columns vertices; closed: the last column joins the first."""
    r, c = np.mgrid[:rows - 1, :columns if closed else columns - 1]
    a, b = r * columns + c, r * columns + (c + 1) % columns
    return np.concatenate([np.stack([a, a + columns, b], -1).reshape(-1, 3),
                           np.stack([b, a + columns, b + columns], -1).reshape(-1, 3)])
