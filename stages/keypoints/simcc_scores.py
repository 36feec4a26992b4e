"""Brings the peaks of a SimCC network to the scores 0..1 that all detectors give.

The heights depend on how a network was trained: DWPose's and RTMPose's loss takes ten times the outputs as the logits of the bins,
so that peaks lie in 0..1 and are scores as they stand; RTMW's takes the outputs themselves, and what is seen peaks at 1 to 5 and
more. A file does not tell which it is, the peaks of a clip do. mmpose's own visibility (the softmax of 150 sigma times the outputs)
does not separate the second kind: a made-up peak of 0.3 there reads 0.95, one of 3 reads 1.
"""

from __future__ import annotations

import numpy as np

from gsac.avatar.onnx_network import NetworkError

STRONG = 90
"""Percentile of a clip's peaks that stands for what is plainly seen."""
LEAST, LOGITS, MOST = 0.25, 1.5, 20.0
"""Strong peaks from LEAST to LOGITS are scores, to MOST they are logits. Probabilities of bins stay below LEAST (the sharpest that
the official labels ask for is 0.2), scores exceed 1 slightly, and the official labels ask for logits of 10."""


def calibrate(peaks: np.ndarray, source: str) -> np.ndarray:
    """peaks: (T, 133), zeros in frames without a person; source: whose they are. Returns scores (T, 133) in 0..1.

    A logit is a score by the odds of its bin against an indifferent one: 0 where they are even, tanh of half the logit. Raises
    NetworkError where the peaks are of no known kind.
    """
    seen = peaks[peaks.any(axis=1)]
    if not len(seen):
        return np.zeros_like(peaks)
    strong = float(np.percentile(seen, STRONG))
    if not LEAST <= strong <= MOST:  # NaN too
        raise NetworkError(f"{source} gives peaks whose strongest tenth begins at {strong:.3g}; expected {LEAST} to {LOGITS} "
                           f"(DWPose, RTMPose) or up to {MOST:g} (RTMW), else a seen hand is not told from a hidden one: export "
                           "the network without a softmax, or choose another")
    return np.clip(peaks if strong < LOGITS else np.tanh(peaks / 2), 0, 1)
