"""Clothes as shape directions: thickness of cloth, shoes and hair over the skin, one direction a region, symmetric.

    python tools/open_body/clothes.py    # writes them anew into open_body.npz; `bake.py` does so at its end

A silhouette shows clothes. A body that can only grow heavier follows it at the cost of its joints, so the shape basis ends with
these directions: each raises one region along the smoothed normals by `UNIT` a unit (soles downwards), fades into its neighbours
and moves no joint. Hands, face and neck have none. The waist has its own beside the belly: shirts hang straight over the small of
the back, and a body that cannot fill that gap is fitted with its pelvis too high.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

FILE = Path(__file__).parents[2] / "avatar" / "open_body" / "open_body.npz"
UNIT = 0.01
"""Metres."""
SKIN = 13348
"""Number of skin vertices; those after them are tongue and eyeballs."""


def add_clothes(arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The arrays of the body file with the clothes as last betas, replacing earlier ones; `clothes` lists their names."""
    figure = int(arrays["num_betas"]) - len(arrays.get("clothes", ()))
    shapes, rest = arrays["shapedirs"][:, :, :figure], arrays["shapedirs"][:, :, int(arrays["num_betas"]):]
    names = [str(n) for n in arrays["joint_names"]]
    lifts = directions(arrays["v_template"], arrays["f"].astype(np.int64), arrays["weights"].astype(np.float64), names)
    regressor = arrays["J_regressor"].astype(np.float64)
    back = np.linalg.pinv(regressor)  # the smallest change of the surface, under a millimetre, that moves the joints back
    lifts = {name: lift - back @ (regressor @ lift) for name, lift in lifts.items()}
    new = np.stack(list(lifts.values()), 2).astype(shapes.dtype)
    return arrays | {"shapedirs": np.concatenate([shapes, new, rest], 2), "num_betas": np.int64(figure + new.shape[2]),
                     "clothes": np.array(list(lifts))}


def directions(v: np.ndarray, faces: np.ndarray, weights: np.ndarray, joints: list[str]) -> dict[str, np.ndarray]:
    """Region -> (V, 3) m a unit. v: (V, 3) m, T-pose; faces: (F, 3); weights: (V, 55); joints: their names."""
    blur = make_blur(faces, len(v))
    normal = normalise(blur(vertex_normals(v, faces), 8))
    x, y, z = np.abs(v[:, 0]), v[:, 1], v[:, 2]
    skin = np.arange(len(v)) < SKIN

    def of(*parts: str) -> np.ndarray:
        carriers = [j for j, name in enumerate(joints) if name.removeprefix("left_").removeprefix("right_") in parts]
        return skin * weights[:, carriers].sum(1)

    def ramp(value: np.ndarray, start: float, end: float) -> np.ndarray:
        return np.clip((value - start) / (end - start), 0, 1)

    around = np.arctan2(x, z - 0.045)  # 0 in front of the head, pi behind
    scalp = skin * (x < 0.13)
    hairline = 0.95 - 0.15 * ramp(-np.cos(around), -1, 0.3)
    share = {
        "chest": blur(of("spine2", "spine3") + of("collar") * (y < 0.72), 12),
        "belly": blur(of("pelvis", "spine1"), 12),
        "waist": blur(of("pelvis", "spine1", "spine2", "spine3", "hip") * ramp(y, 0.05, 0.18) * ramp(-y, -0.35, -0.18), 6),
        "upper arms": blur(of("shoulder"), 12),
        "sleeves": blur(of("shoulder") * ramp(x, 0.25, 0.40), 6),
        "forearms": blur(of("elbow"), 12),
        "thighs": blur(of("hip"), 12),
        "shanks": blur(of("knee"), 12),
        "cuffs": blur(of("knee") * ramp(-y, 0.40, 0.70), 6),
        "feet": blur(of("ankle", "foot"), 12),
        "hair": blur(scalp * ramp(y - hairline, 0, 0.04), 6),
        "nape": blur(scalp * ramp(around, 1.5, 1.9) * ramp(y, 0.72, 0.77) * ramp(-y, -0.88, -0.82), 8),
    }
    out = {name: normal * s[:, None] * UNIT for name, s in share.items()}
    out["feet"][:, 1] = out["nape"][:, 1] = 0
    out["soles"] = np.array([0, -UNIT, 0]) * (of("ankle", "foot") * ramp(-y, 0.74, 0.80))[:, None]
    return out


def make_blur(faces: np.ndarray, count: int) -> Callable[[np.ndarray, int], np.ndarray]:
    """Makes a function (values (V, ...), rounds) -> (V, ...), which averages values with their neighbours'. faces: (F, 3)."""
    one_way = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edges = np.unique(np.concatenate([one_way, one_way[:, ::-1]]), axis=0)
    degree = 1 + np.bincount(edges[:, 0], minlength=count)

    def blur(values: np.ndarray, rounds: int) -> np.ndarray:
        flat = np.array(values, np.float64).reshape(count, -1)
        for _ in range(rounds):
            total = flat.copy()
            np.add.at(total, edges[:, 0], flat[edges[:, 1]])
            flat = total / degree[:, None]
        return flat.reshape(np.shape(values))

    return blur


def vertex_normals(v: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Unit normals (V, 3), weighted by area. v: (V, 3); faces: (F, 3)."""
    corners = v[faces].astype(np.float64)
    normal = np.zeros((len(v), 3))
    for c in range(3):
        np.add.at(normal, faces[:, c], np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    return normalise(normal)


def normalise(v: np.ndarray) -> np.ndarray:
    """(V, 3) of unit length."""
    return v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-12)


if __name__ == "__main__":
    with np.load(FILE) as z:
        bare = {name: z[name] for name in z.files}
    np.savez_compressed(FILE, **add_clothes(bare))
