"""Corrects the outline at full size by a plate: opens gaps that show the bare scene, adds rims that cannot be scene.

GrabCut works at half size and with the colours of the whole person, so it fills the gaps between fingers, arm and trunk, and
loses what is as bright as the wall. Clothes that look like the scene are told from gaps by the bones, which gaps lie beside.
"""

from __future__ import annotations

import cv2
import numpy as np

from gsac.stages.segment.plate import Plate, expose, measure_gain

SMOOTH = 0.7
"""px, sigma of the blur that takes the sensor's noise from frame and plate before gaps are looked for."""
ALIKE, NOISES = (8, 16), 4
"""Bounds of the difference (of 255) up to which a pixel shows the bare scene; that difference, in medians of the background's."""
OTHER = 24
"""Difference from the plate in any shade from which on a pixel is no scene."""
DARKEST = 0.45
"""Least share of its light that a shadow leaves."""
RIM = 6
"""px beyond the outline in which the person may have been lost."""
APART = 8
"""px kept from the outline where the background is compared."""
SOME = 4
"""The background is compared in every such row and column."""
LEAST_GAP = 6
"""Fewest pixels of a gap."""
CAMOUFLAGE = 0.03
"""Share of the person that may look like the plate; with more it is the clothing, and only gaps open to the outside count."""
ON_BONE, BESIDE = 0.012, 0.04
"""Shares of the picture's height: what looks like the scene and comes so near to a bone is clothing, and so is what lies so near to
clothing."""
LOST = 0.06
"""Share of the picture's height: so near to a bone lies all of a limb."""
LIKELY, MOSTLY = 0.8, 0.3
"""Network probability above which a pixel is likely the person's, and the least share of such pixels in clothing."""
SPECK = 1e-4
"""Share of the person: smaller parts on a bone do not tell of clothing beside them."""
LEAST_KNOWN, MOST_CHANGED = 0.05, 0.08
"""Least share of known background, and the most of it that may be no scene; else the plate does not show the frame's scene."""


def match_scene(image: np.ndarray, outline: np.ndarray, plate: Plate) -> Plate | None:
    """image: (H, W, 3) uint8, like the plate; outline: (H, W) bool.

    Returns the plate in the frame's exposure; None where it shows another scene.
    """
    near = cv2.dilate(outline.astype(np.uint8), np.ones((2 * APART + 1, 2 * APART + 1), np.uint8)) > 0
    outside = (plate.known & ~near)[::SOME, ::SOME]
    if outside.mean() < LEAST_KNOWN:
        return None
    seen, bare = (np.ascontiguousarray(x[::SOME, ::SOME]) for x in (image, plate.image))
    gain = measure_gain(bare, seen, outside)
    changed = unlike(seen[outside], expose(bare, gain)[outside]) > OTHER
    return Plate(expose(plate.image, gain), plate.known) if changed.mean() <= MOST_CHANGED else None


def correct(image: np.ndarray, outline: np.ndarray, scene: Plate, bones: np.ndarray,
            likely: np.ndarray) -> np.ndarray:
    """image: (H, W, 3) uint8; outline: (H, W) bool; scene: the plate in the frame's exposure; bones: (H, W) px, from the bones;
    likely: (H, W) bool, where the probability is above `LIKELY`. Returns the outline, (H, W) bool."""
    return open_gaps(image, scene, add_rims(image, scene, outline), bones, likely)


def add_rims(image: np.ndarray, scene: Plate, outline: np.ndarray) -> np.ndarray:
    """The outline, (H, W) bool, with what lies next to it and is the scene in no shade. image: (H, W, 3) uint8."""
    reach = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * RIM + 1, 2 * RIM + 1))
    rim = (cv2.dilate(outline.astype(np.uint8), reach) > 0) & ~outline & scene.known
    grown = outline.astype(np.uint8)
    grown[rim] = unlike(image[rim], scene.image[rim]) > OTHER
    return outline | (keep_squares(grown) > 0)


def open_gaps(image: np.ndarray, scene: Plate, outline: np.ndarray, bones: np.ndarray, likely: np.ndarray) -> np.ndarray:
    """The outline, (H, W) bool, without what looks like the bare scene and is no clothing.

    image: (H, W, 3) uint8; bones: (H, W) px; likely: (H, W) bool.
    """
    red, green, blue = cv2.split(cv2.absdiff(*(cv2.GaussianBlur(x, (0, 0), SMOOTH) for x in (image, scene.image))))
    away = cv2.max(cv2.max(red, green), blue)
    noise = np.median(away[::SOME, ::SOME][(scene.known & ~outline)[::SOME, ::SOME]])
    alike = (away <= np.clip(NOISES * noise, *ALIKE)) & scene.known & outline
    _, labels, stats, _ = cv2.connectedComponentsWithStats(keep_squares(alike.astype(np.uint8)), connectivity=8)
    area = stats[:, cv2.CC_STAT_AREA]
    gap = area >= LEAST_GAP
    gap[0] = False
    if area[gap].sum() > CAMOUFLAGE * np.count_nonzero(outline):
        outside = cv2.dilate((~outline).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        gap &= np.isin(np.arange(len(gap)), labels[outside])
    labels = labels.astype(np.intp)
    gap &= ~find_clothing(labels, gap, bones, likely, SPECK * np.count_nonzero(outline))
    return outline & ~gap[labels]


def find_clothing(labels: np.ndarray, gap: np.ndarray, bones: np.ndarray, likely: np.ndarray, speck: float) -> np.ndarray:
    """(K,) bool, the parts that likely are the person's and lie on a bone, or beside such a part of more than `speck` px.

    labels: (H, W), 0 to K - 1; gap: (K,) bool, the parts to look at; bones: (H, W) px; likely: (H, W) bool.
    """
    at = np.nonzero(gap[labels])
    part = labels[at]
    size, count = np.bincount(part, minlength=len(gap)), np.bincount(part, likely[at], len(gap))

    def nearest(distance: np.ndarray) -> np.ndarray:
        """(K,) px, of each part. distance: (H, W) px."""
        least = np.full(len(gap), np.inf)
        np.minimum.at(least, part, distance[at])
        return least

    ours = count > MOSTLY * size
    clothing = ours & (nearest(bones) < ON_BONE * len(labels))
    if (telling := clothing & (size > speck)).any():
        apart = cv2.distanceTransform((~telling[labels]).astype(np.uint8), cv2.DIST_L2, 5)
        clothing |= ours & (nearest(apart) < BESIDE * len(labels))
    return clothing


def find_lost(outline: np.ndarray, probability: np.ndarray, bones: np.ndarray) -> np.ndarray:
    """(H, W) bool, what lies beside a bone and is more likely the person than not, though the outline leaves it out: of trousers as
    green as the carpet GrabCut leaves half a calf, with edges that lie deep inside. What neither touches the outline nor lies on a
    bone is somebody else's.

    outline: (H, W) bool; probability: (H, W) uint8, the network's; bones: (H, W) px, from the bones.
    """
    lost = (probability > 127) & ~outline & (bones < LOST * len(outline))
    count, labels = cv2.connectedComponents((outline | lost).astype(np.uint8), connectivity=8)
    part = labels.astype(np.intp)
    ours = np.bincount(part[outline | (bones < ON_BONE * len(outline))], minlength=count) > 0
    return lost & ours[part]


def keep_squares(mask: np.ndarray) -> np.ndarray:
    """mask: (H, W) uint8, 0 or 1. Returns what of it lies in squares of two by two pixels that it fills."""
    square = np.ones((2, 2), np.uint8)
    # OpenCV does not mirror the kernel: with the default anchor twice the mask would move by a pixel.
    return cv2.dilate(cv2.erode(mask, square), square, anchor=(0, 0))


def unlike(seen: np.ndarray, bare: np.ndarray) -> np.ndarray:
    """seen, bare: (n, 3) uint8. Returns (n,), the largest difference of a channel from the scene in the shade that fits best."""
    seen, bare = seen.astype(np.float32), bare.astype(np.float32)
    shade = np.clip((seen * bare).sum(1) / np.maximum((bare * bare).sum(1), 1), DARKEST, 1)
    return np.abs(seen - shade[:, None] * bare).max(1)
