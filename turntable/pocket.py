"""A hand in a pocket: cloth below the pocket's mouth bulges over it."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from gsac.avatar.joints import INDEX, LEFT_HAND, RIGHT_HAND, WRISTS, J
from gsac.turntable.person import MATERIALS, Person

MOUTH = 0.08
"""m below the hip joint, along the thigh, at which the pocket opens."""
CLOTH = {"trousers": 0.005, "skirt": 0.007, "shirt": 0.010}
"""Material -> m by which it lies over the hand; the shirt's hem hangs over trousers and wrist."""
WIDE = 0.026
"""m along and around the thigh over which a point of the hand holds the cloth up."""
REACH = 0.14
"""m from the hand beyond which no cloth moves."""


def cover_hands(person: Person, bare: np.ndarray, drawn: np.ndarray, joints: np.ndarray, covered: np.ndarray) -> np.ndarray:
    """Drawn mesh (N, 3) m with cloth raised over the covered hands. bare: (V, 3) m; drawn: (N, 3) m; joints: (55, 3) m, all posed
    alike; covered: (2,) bool, left and right."""
    out = drawn.copy()
    for side, fingers, wrist, there in zip(("left", "right"), (LEFT_HAND, RIGHT_HAND), WRISTS, covered, strict=True):
        if not there:
            continue
        hip, knee = joints[INDEX[f"{side}_hip"]], joints[INDEX[f"{side}_knee"]]
        thigh = Axis(hip, knee)
        hand = bare[person.body.weights[:, [wrist, *range(J)[fingers]]].sum(1) > 0.6]
        tree = KDTree(hand)
        for name, over in CLOTH.items():
            here = np.unique(person.faces[person.material == MATERIALS.index(name)])
            here = here[tree.query(out[here], distance_upper_bound=REACH)[0] < REACH]
            under = hand
            if name != "shirt":
                here = here[thigh.along(out[here]) > MOUTH]
                under = hand[thigh.along(hand) > MOUTH]
            if len(here) and len(under):
                out[here] = thigh.raise_over(out[here], under, over)
    return out


class Axis:
    """The line of a thigh; places as length along it, angle round it and distance from it."""

    def __init__(self, hip: np.ndarray, knee: np.ndarray):
        """hip, knee: (3,) m."""
        self.start, self.way = hip, (knee - hip) / np.linalg.norm(knee - hip)

    def along(self, points: np.ndarray) -> np.ndarray:
        """(n,) m from the hip towards the knee. points: (n, 3) m."""
        return (points - self.start) @ self.way

    def raise_over(self, cloth: np.ndarray, hand: np.ndarray, over: float) -> np.ndarray:
        """(n, 3) m: the cloth moved away from the axis until it lies `over` m outside. cloth: (n, 3) m; hand: (k, 3) m."""
        along, under = self.along(cloth), self.along(hand)
        out, held = cloth - self.start - along[:, None] * self.way, hand - self.start - under[:, None] * self.way
        far, reach = np.linalg.norm(out, axis=1), np.linalg.norm(held, axis=1)
        out, held = out / far[:, None], held / reach[:, None]
        aside = 2 * (1 - np.clip(out @ held.T, -1, 1)) * far[:, None] ** 2 + (along[:, None] - under) ** 2
        near = np.clip(1.6 - aside / WIDE**2, 0, 1)
        lift = (np.clip(reach + over - far[:, None], 0, None) * near * near * (3 - 2 * near)).max(1)
        return cloth + out * lift[:, None]
