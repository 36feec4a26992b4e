"""Parts of the body that no frame shows, by name: what stands there in the avatar is made up from what lies around."""

from __future__ import annotations

import numpy as np

from gsac.avatar.binding import face_frames
from gsac.avatar.body import Body
from gsac.stages.train.gaussians.merge import skin_of

HALVED = {"head": ("face", "back of the head"), "trunk": ("front of the trunk", "back")}
"""Parts whose front and back are told apart."""
LIMBS = {"upper arm": ("shoulder",), "forearm": ("elbow",), "hand": ("wrist", "index", "middle", "pinky", "ring", "thumb"),
         "thigh": ("hip",), "shin": ("knee",), "foot": ("ankle", "foot")}
"""Limb -> what its joints' names begin with after their side."""
HEAD = ("head", "jaw", "left_eye_smplhf", "right_eye_smplhf")
TRUNK = ("pelvis", "spine1", "spine2", "spine3", "left_collar", "right_collar")
FACING = 0.3
"""Cosine between a face's normal and the way ahead from which on it belongs to the front, or to the back by minus that."""
SHOWN, HALF_SHOWN = 0.2, 0.5
"""Share of a limb's gaussians, and of those of a front or a back, below which it is called unseen. One side of a limb is enough;
a rim is seen where its neighbours are: of a face 0.43 where only the chin is in the picture, and at least 0.78 where all is."""
FEWEST = 10
"""Gaussians of a part below which nothing is said of it."""


def part_of(name: str) -> str | None:
    """Of a joint; None for the neck, whose skin goes up to the chin and down to the shoulders."""
    if name in HEAD:
        return "head"
    if name in TRUNK:
        return "trunk"
    side, _, rest = name.partition("_")
    return next((f"{side} {limb}" for limb, starts in LIMBS.items() if side in ("left", "right") and rest.startswith(starts)), None)


def unseen_parts(face: np.ndarray, seen: np.ndarray, body: Body) -> list[str]:
    """face: (N,) of the gaussians; seen: (N,) bool. From head to foot; head and trunk by their halves where one of them is seen."""
    names = [part_of(name) for name in body.joint_names]
    carried = np.array([name or "" for name in names])[skin_of(face, body).argmax(1)]
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
