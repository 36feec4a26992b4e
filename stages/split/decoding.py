"""What has to be decoded for some of a video's frames: each frame's chain, from a key frame up to it.

Where every twentieth frame is kept, the rest of each chain after the last one kept is for nothing; and of frames that stand for
their neighbours anyway, those soon after a key frame cost least.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsac.stages.split.probe import Video

NEAR = 0.15
"""How far a frame may lie from its place in time for a shorter chain, as a share of the time between kept frames."""


@dataclass(frozen=True)
class Chains:
    """Of the N frames of a video, in the order in which they are shown."""

    root: np.ndarray
    """(N,) int, where the chain begins: a key frame's place in the order of decoding."""
    length: np.ndarray
    """(N,) int, frames of the chain, this one included."""
    leading: np.ndarray
    """(N,) bool: decoded after a key frame and shown before it, so that it may need the key frame before that one, too."""

    @classmethod
    def of(cls, video: Video) -> Chains | None:
        """None where the file does not tell."""
        if not len(video.sent) == len(video.ticks) > 0:
            return None
        order = np.argsort(video.sent)
        ticks, place = video.ticks[order], np.argsort(order)
        keys = np.flatnonzero(np.isin(ticks, video.key_ticks))
        if not len(keys) or keys[0] > 0:
            return None
        last = np.searchsorted(keys, np.arange(len(order)), side="right") - 1
        leading = ticks < ticks[keys[last]]
        root = keys[np.maximum(last - leading, 0)]
        return cls(root[place], place - root[place] + 1, leading[place])

    def move_picks(self, picks: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Frames (K,) near `picks` (K,), rising, whose chains are shorter; the first and the last stay. times: (N,) s."""
        reach = NEAR * (times[picks[-1]] - times[picks[0]]) / max(len(picks) - 1, 1)
        decoded = {int(self.root[end]): int(self.length[end]) for end in picks[[0, -1]]}
        moved = list(picks[[0, -1]])
        for pick in picks[-2:0:-1]:  # from the end: what a later frame's chain holds costs the earlier ones nothing
            away = np.abs(times - times[pick])
            near = np.flatnonzero(away <= reach)
            more = np.array([max(0, self.length[k] - decoded.get(int(self.root[k]), 0)) for k in near])
            best = near[np.lexsort((away[near], more))[0]]
            decoded[int(self.root[best])] = max(int(self.length[best]), decoded.get(int(self.root[best]), 0))
            moved.append(best)
        return np.unique(moved)

    def needed(self, picks: np.ndarray) -> np.ndarray:
        """(N,) bool, what has to be decoded for the frames `picks` (K,)."""
        place = self.root + self.length - 1
        inside = np.zeros(len(place), bool)
        for pick in picks:
            inside[self.root[pick]:place[pick] + 1] = True
        needed = inside[place]
        for k in np.flatnonzero(needed & self.leading):  # one whose chain is broken could not be decoded
            needed[k] = inside[self.root[k]:place[k]].all()
        return needed
