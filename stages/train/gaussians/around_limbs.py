"""Colours of what is seen around a limb: clothes and hair end at the same place all around it, and go on to the other side."""

from __future__ import annotations

import numpy as np

from gsac.avatar.binding import Bound, FaceFrames
from gsac.avatar.body import Body
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.joints import EYES, HEAD, JAW, NAMES
from gsac.avatar.light import shade
from gsac.stages.train.gaussians.merge import skin_weights
from gsac.stages.train.gaussians.nearest import find_nearest

ALONG = 8.0
"""What a length along a limb counts, over one around it."""
TURNED = 0.1
"""m that two faces are farther apart where their normals differ by 1: the chest's print does not come through to the back."""
POLE = np.array([0, 0.8, -0.6], np.float32)
"""Direction in which a head's pole lies, up and back."""
HEAD_OFF = 10.0
"""m that the head lies off the other limbs, and its scalp off the face: hair has no part in a collar, nor has a cheek in hair."""
HAIR, BEGINS = "hair", 0.5
"""The body's clothes that grow on a scalp, and the share of their greatest thickness at which it begins."""
MANY = 100
"""Gaussians that a colour is mixed of."""
CLOSE = 0.01
"""m of the stretched space, the distance up to which gaussians count alike."""
SPREAD = 0.25
"""Of the squared distance over the nearest one's, in the exponent of a gaussian's weight: the farther off, the more are mixed."""
MIDDLE = 0.3
"""Share of the weight, the middle in order of the values, that a colour is the mean of: a hem stays sharp, a print is left out."""
ARMS = [i for i, name in enumerate(NAMES) if any(part in name for part in (
    "shoulder", "elbow", "wrist", "index", "middle", "pinky", "ring", "thumb"))]
"""Joints whose limbs lie sideways at rest; all others lie upright."""


def stretch(bound: Bound, face: np.ndarray, frames: FaceFrames, body: Body) -> np.ndarray:
    """(N, 7) m, places in which what lies around a limb is near, on the same side nearest. bound, frames: at rest; face: (N,).

    Along a head is the way from its `POLE`: hair ends as far from it on all sides. It lies far from all other limbs, so does its
    scalp, where the body tells it: the back of a head takes the colour of hair over the forehead, not of the cheeks below.
    """
    skin, scalp = skin_weights(face, body), find_scalp(face, body)
    arm = skin[:, ARMS].sum(1)
    head = np.maximum(skin[:, [HEAD, JAW, *EYES]].sum(1), scalp)  # hair at the nape, where the neck's share is large, is hair
    along = 1 + (ALONG - 1) * np.stack([arm, 1 - arm - head, np.zeros_like(arm)], 1)
    pole = bound.means[np.argmax(bound.means @ POLE * (head > 0.5))]
    from_pole = head * (HEAD_OFF + ALONG * np.linalg.norm(bound.means - pole, axis=1)) + HEAD_OFF * scalp
    return np.hstack([bound.means * along, from_pole[:, None], TURNED * frames.R[face, :, 1]])


def find_scalp(face: np.ndarray, body: Body) -> np.ndarray:
    """(N,) bool, whether gaussians lie where hair grows; nowhere on a body that has none among its clothes. face: (N,)."""
    if HAIR not in body.clothes:
        return np.zeros(len(face), bool)
    thickness = np.linalg.norm(body.shapedirs[:, :, body.num_figure + body.clothes.index(HAIR)], axis=1)
    return (thickness[body.faces] > BEGINS * thickness.max()).all(1)[face]


def mix_colours(rgb: np.ndarray, weight: np.ndarray, places: np.ndarray, queries: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(M, 3) colours at queries (M, 7), in each channel the mean of the middle of those around, and (M, K) the indices of these.

    rgb: (N, 3); weight: (N,) of each; places: (N, 7) of `stretch`.
    """
    near = find_nearest(places, queries, MANY)
    square = np.zeros(near.shape)
    for axis in range(places.shape[1]):  # one at a time: all together they are 50 MB
        square += (places[near, axis] - queries[:, None, axis]) ** 2
    counts = weight[near] * np.exp(-SPREAD * square / np.maximum(square[:, :1], CLOSE**2))
    counts /= np.maximum(counts.sum(1, keepdims=True), 1e-12)
    return np.stack([middle_means(rgb[near, channel], counts) for channel in range(3)], 1), near


def middle_means(values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(M,) means of values (M, K) between the quantiles 0.5 -+ MIDDLE / 2 of their weight (M, K), whose rows sum to 1."""
    order = np.argsort(values, 1, kind="stable")
    below = np.cumsum(np.take_along_axis(weight, order, 1), 1)
    low = 0.5 - MIDDLE / 2
    inside = np.diff(np.clip(below, low, low + MIDDLE), axis=1, prepend=low)
    return (inside * np.take_along_axis(values, order, 1)).sum(1) / MIDDLE


def hold_colours(gaussians: Gaussians, poor: np.ndarray, near: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(M, 3) colours of M gaussians, held within those of gaussians around them, and in the clip's light within these so lit.

    poor: (M,) the gaussians; near: (M, K) well seen ones around each; normals: (F, 3) of the faces at rest. The light was told
    apart from the colours on the normals that frames showed; on others it is a guess that can leave all that was seen. Where a
    colour cannot be within both, it is so in the light.
    """
    held = np.clip(gaussians.rgb[poor], gaussians.rgb[near].min(1), gaussians.rgb[near].max(1))
    if gaussians.light is None:
        return held
    factor = shade(gaussians.light, normals[gaussians.face])
    lit = gaussians.rgb * factor
    return np.clip(np.clip(held * factor[poor], lit[near].min(1), lit[near].max(1)) / factor[poor], 0, 1).astype(np.float32)
