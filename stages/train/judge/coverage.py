"""Names the parts of the body that no frame shows: the avatar's colours there are guessed from their surroundings."""

from __future__ import annotations

import numpy as np

from gsac.avatar.binding import face_frames
from gsac.avatar.body import Body
from gsac.stages.train.gaussians.merge import skin_weights

HALVED = {"head": ("face", "back of the head"), "trunk": ("front of the trunk", "back")}
"""Parts whose front and back are named separately."""
LIMBS = {"upper arm": ("shoulder",), "forearm": ("elbow",), "hand": ("wrist", "index", "middle", "pinky", "ring", "thumb"),
         "thigh": ("hip",), "shin": ("knee",), "foot": ("ankle", "foot")}
"""Limb -> how its joints' names begin after their side."""
HEAD = ("head", "jaw", "left_eye_smplhf", "right_eye_smplhf")
TRUNK = ("pelvis", "spine1", "spine2", "spine3", "left_collar", "right_collar")
FACING = 0.3
"""Cosine between a face's normal and the forward direction above which it belongs to the front; below minus that, to the back."""
SHOWN, HALF_SHOWN = 0.2, 0.5
"""Share of seen gaussians below which a limb, and a front or a back, is called unseen. One side of a limb is enough; rims count as
seen with their neighbours: 0.43 of a face where only the chin is in the picture, at least 0.78 where all of it is."""
FEWEST = 10
"""Fewest gaussians of a part that is named."""


def part_of(name: str) -> str | None:
    """The part that a joint belongs to; None for the neck, whose skin reaches from the chin to the shoulders."""
    if name in HEAD:
        return "head"
    if name in TRUNK:
        return "trunk"
    side, _, rest = name.partition("_")
    return next((f"{side} {limb}" for limb, starts in LIMBS.items() if side in ("left", "right") and rest.startswith(starts)), None)


def unseen_parts(face: np.ndarray, seen: np.ndarray, body: Body) -> list[str]:
    """Names from head to foot; a half of head or trunk where the other half is seen.

    face: (N,) of the gaussians; seen: (N,) bool.
    """
    names = [part_of(name) for name in body.joint_names]
    carried = np.array([name or "" for name in names])[skin_weights(face, body).argmax(1)]
    ahead = face_frames(np.asarray(body.v_template, np.float32), body.faces).R[face, 2, 1]
    found = []

    def hidden(part: np.ndarray, shown: float) -> bool:
        return int(part.sum()) >= FEWEST and float(seen[part].mean()) < shown

    for name in ["head", "trunk", *(f"{side} {limb}" for limb in LIMBS for side in ("left", "right"))]:
        part = carried == name
        if name in HALVED:
            halves = [half for half, on in zip(HALVED[name], (ahead > FACING, ahead < -FACING), strict=True)
                      if hidden(part & on, HALF_SHOWN)]
            found += [name] if len(halves) == len(HALVED[name]) else halves
        elif hidden(part, SHOWN):
            found.append(name)
    return found
