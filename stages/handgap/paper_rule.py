"""The paper's own rule: a hand is missing where its wrist and its palm both score below a threshold.

Elbow, wrist and palm of such a frame are all placed anew; a hand that is detected in a wrong place with a good score is believed.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.wholebody import ARM
from gsac.stages.handgap.config import HandgapConfig
from gsac.stages.handgap.missing_hands import SIDES, MissingHands


def find_missing_as_paper(xy: np.ndarray, score: np.ndarray, times: np.ndarray | None, config: HandgapConfig) -> MissingHands:
    """xy: (T, 133, 2) px; score: (T, 133); times: (T,) s, None for photos. The threshold is `lost_score`."""
    hand = np.stack([(score[:, ARM[side][2:]] < config.lost_score).all(axis=1) for side in SIDES], axis=1)
    return MissingHands(hand, hand, hand, np.zeros_like(hand))
