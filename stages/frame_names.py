"""Names frames in warnings."""

from __future__ import annotations

import numpy as np

from gsac.stages.counting import count_of

MOST = 8
"""Most runs of frames that are named."""


def name_frames(mask: np.ndarray) -> str:
    """mask: (T,) bool. Returns `frame 3`, `12 of 60 frames (0-3, 17, 40-46)`, or `all 60 frames`."""
    index = np.flatnonzero(mask)
    if len(index) == len(mask):
        return count_of(len(mask), len(mask), "frame")
    if len(index) == 1:
        return f"frame {index[0]}"
    runs = np.split(index, np.flatnonzero(np.diff(index) > 1) + 1)
    words = [str(r[0]) if len(r) == 1 else f"{r[0]}-{r[-1]}" for r in runs]
    more = ", ..." if len(words) > MOST else ""
    return f"{count_of(len(index), len(mask), 'frame')} ({', '.join(words[:MOST])}{more})"
