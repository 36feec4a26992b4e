"""A hand in a pocket: cloth below the pocket's mouth bulges over it."""

from __future__ import annotations

import numpy as np

from gsac.avatar.joints import INDEX, LEFT_HAND, RIGHT_HAND, WRISTS, J
from gsac.avatar.mesh import vertex_normals
from gsac.turntable.person import MATERIALS, Person

MOUTH = 0.05
"""m below the hip joint, along the thigh, at which the pocket opens."""
CLOTH = 0.005
"""m of cloth over the hand."""
WIDE = 0.018
"""m across which one point of the hand lifts the cloth."""
CLOTHES = tuple(MATERIALS.index(name) for name in ("shirt", "trousers", "skirt"))


def cover_hands(person: Person, bare: np.ndarray, drawn: np.ndarray, joints: np.ndarray, covered: np.ndarray) -> np.ndarray:
    """Drawn mesh (N, 3) m with cloth raised over the covered hands. bare: (V, 3) m; drawn: (N, 3) m; joints: (55, 3) m, all posed
    alike; covered: (2,) bool, left and right."""
    out = drawn.copy()
    cloth = np.zeros(len(drawn), bool)
    cloth[person.faces[np.isin(person.material, CLOTHES)]] = True
    normals = vertex_normals(drawn, person.faces)
    for side, fingers, wrist, there in zip(("left", "right"), (LEFT_HAND, RIGHT_HAND), WRISTS, covered, strict=True):
        if there:
            hip, knee = joints[INDEX[f"{side}_hip"]], joints[INDEX[f"{side}_knee"]]
            down = (knee - hip) / np.linalg.norm(knee - hip)
            hand = bare[person.body.weights[:, [wrist, *range(J)[fingers]]].sum(1) > 0.6]
            hand = hand[(hand - hip) @ down > MOUTH]
            here = np.flatnonzero(cloth & ((drawn - hip) @ down > MOUTH))
            here = here[(np.linalg.norm(drawn[here] - hip, axis=1) < 0.35)]
            out[here] += normals[here] * find_lift(drawn[here], normals[here], hand)[:, None]
    return out


def find_lift(cloth: np.ndarray, normals: np.ndarray, hand: np.ndarray) -> np.ndarray:
    """(n,) m by which points of cloth (n, 3) rise along their normals (n, 3) to lie over the points hand (k, 3)."""
    if not len(hand) or not len(cloth):
        return np.zeros(len(cloth))
    away = hand[None] - cloth[:, None]
    height = np.einsum("nkc,nc->nk", away, normals)
    aside = (away**2).sum(2) - height**2
    return np.where(height < 0.09, (height + CLOTH) * np.exp(-aside / WIDE**2), 0).max(1).clip(0)
