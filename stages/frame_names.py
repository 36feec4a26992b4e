"""Names frames in warnings."""

from __future__ import annotations

import numpy as np

MOST = 8
"""Most runs of frames that are named."""


def name_frames(mask: np.ndarray) -> str:
    """mask: (T,) bool. Returns `frame 3`, or `12 of 60 frames (0-3, 17, 40-46)`."""
    index = np.flatnonzero(mask)
    if len(index) == 1:
        return f"frame {index[0]}"
    runs = np.split(index, np.flatnonzero(np.diff(index) > 1) + 1)
    words = [str(r[0]) if len(r) == 1 else f"{r[0]}-{r[-1]}" for r in runs]
    more = ", ..." if len(words) > MOST else ""
    return f"{len(index)} of {len(mask)} frames ({', '.join(words[:MOST])}{more})"
