"""The outline by GrabCut at half size (Rother et al. 2004), seeded by the network, the hands' points and a plate."""

from __future__ import annotations

import cv2
import numpy as np

from gsac.avatar.wholebody import HANDS
from gsac.stages.segment.plate import HALF, Difference

SURE, NEVER = 0.95, 0.15
"""Network probabilities above which a pixel is seeded as person, and below which as background, for good."""
SOME, SMALL = 3, 5000
"""The colours are first sorted in every such row and column, which takes as long as all the rest if it is done in all; but not of a
person or background of fewer pixels."""
FINGERS = ([0, 1, 2, 3, 4], [0, 5, 6, 7, 8], [0, 9, 10, 11, 12], [0, 13, 14, 15, 16], [0, 17, 18, 19, 20])
PALM_HULL = (0, 1, 5, 9, 13, 17)
FINGER_WIDTH = 0.16
"""As a share of the length from the wrist to the root of the middle finger."""
HAND_SEEN = 0.3
"""Least median score of a hand's points for them to be used."""


def cut_out(image: np.ndarray, probability: np.ndarray, xy: np.ndarray, score: np.ndarray, iterations: int,
            difference: Difference | None = None) -> np.ndarray:
    """image: (H, W, 3) uint8; probability: (H, W); xy: (133, 2) px; score: (133,).

    difference: of this part of the frame from the plate.
    Returns (H, W) float32 in 0..1, sharp except for the interpolation from half size.
    """
    height, width = probability.shape
    size = (max(1, width // HALF), max(1, height // HALF))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    rough = cv2.resize(probability, size, interpolation=cv2.INTER_AREA)
    scale = np.array(size) / (width, height)
    labels = seed(rough, xy * scale, score)
    if difference is not None:
        labels[difference.empty] = cv2.GC_BGD
        labels[difference.changed] = cv2.GC_FGD
    foreground = (labels == cv2.GC_FGD) | (labels == cv2.GC_PR_FGD)
    if iterations and foreground.any() and not foreground.all():
        background, person, everywhere = np.zeros((1, 65)), np.zeros((1, 65)), (0, 0, *size)  # the last is not looked at
        few = np.s_[::SOME, ::SOME] if min(foreground.sum(), (~foreground).sum()) > SMALL else np.s_[:, :]
        cv2.setRNGSeed(0)  # k-means inside draws numbers: the same frame must give the same bytes
        cv2.grabCut(small[few].copy(), labels[few].copy(), everywhere, background, person, 0, cv2.GC_INIT_WITH_MASK)
        cv2.grabCut(small, labels, everywhere, background, person, iterations, cv2.GC_EVAL)
        foreground = (labels == cv2.GC_FGD) | (labels == cv2.GC_PR_FGD)
    return cv2.resize(foreground.astype(np.float32), (width, height), interpolation=cv2.INTER_LINEAR)


def seed(rough: np.ndarray, xy: np.ndarray, score: np.ndarray) -> np.ndarray:
    """rough: (h, w) network probability; xy: (133, 2) px; score: (133,).

    Returns (h, w) uint8 GrabCut labels: from the probability, around seen hands from their fingers.
    """
    sure = cv2.erode((rough > SURE).astype(np.uint8), np.ones((3, 3), np.uint8))
    never = cv2.dilate((rough > NEVER).astype(np.uint8), np.ones((3, 3), np.uint8)) == 0
    labels = np.where(rough > 0.5, cv2.GC_PR_FGD, cv2.GC_PR_BGD).astype(np.uint8)
    labels[never] = cv2.GC_BGD
    labels[sure > 0] = cv2.GC_FGD
    for points in HANDS.values():
        if np.median(score[points]) >= HAND_SEEN:
            seed_hand(labels, rough, xy[points])
    return labels


def seed_hand(labels: np.ndarray, rough: np.ndarray, hand: np.ndarray) -> None:
    """Labels the surroundings of one hand by its bones: the network fills the gaps between fingers and loses thin ones.

    labels: (h, w) uint8, changed in place; rough: (h, w) network probability; hand: (21, 2) px.
    """
    length = float(np.linalg.norm(hand[9] - hand[0]))
    if not 2 <= length <= max(labels.shape):
        return
    whole = cv2.convexHull(hand.round().astype(np.int32))
    zone = np.zeros_like(labels)
    cv2.fillConvexPoly(zone, whole, 1)
    cv2.polylines(zone, [whole], True, 1, max(1, int(0.5 * length)))
    # Where the hand lies in front of the body, the network is right deep inside it.
    reach = int(0.5 * length) | 1
    zone[cv2.erode((rough > SURE).astype(np.uint8), np.ones((reach, reach), np.uint8)) > 0] = 0

    width = max(1, round(FINGER_WIDTH * length))
    bones, cores = np.zeros_like(labels), np.zeros_like(labels)
    for finger in FINGERS:
        line = [hand[finger].round().astype(np.int32)]
        cv2.polylines(bones, line, False, 1, width)
        cv2.polylines(cores, line, False, 1, max(1, width // 3))
    cv2.fillConvexPoly(bones, cv2.convexHull(hand[list(PALM_HULL)].round().astype(np.int32)), 1)
    near = cv2.dilate(bones, np.ones((2 * width + 1, 2 * width + 1), np.uint8))
    inside = zone > 0
    labels[inside & (near > 0)] = cv2.GC_PR_BGD
    labels[inside & (bones > 0)] = cv2.GC_PR_FGD
    labels[cores > 0] = cv2.GC_FGD
