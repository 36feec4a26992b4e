"""What has to be decoded for some of a video's frames: each frame's chain, from a key frame up to it.

Where every twentieth frame is kept, the rest of each chain after the last one kept is for nothing; and of frames that stand for
their neighbours anyway, those soon after a key frame cost least. Frames to which no other refers are in no chain but their own.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np
from av.bitstream import BitStreamFilterContext
from av.error import FFmpegError

from gsac.stages.split.probe import Video, open_video

NEAR = 0.15
"""How far a frame may lie from its place in time for a shorter chain, as a share of the time between kept frames."""


@dataclass(frozen=True)
class Chains:
    """Of the N frames of a video, in the order in which they are shown."""

    root: np.ndarray
    """(N,) int, where the chain begins: a key frame's place in the order of decoding."""
    place: np.ndarray
    """(N,) int, its own place in that order."""
    length: np.ndarray
    """(N,) int, frames of the chain to which others refer, this one included where it is one of them."""
    alone: np.ndarray
    """(N,) bool: no other frame refers to it."""
    leading: np.ndarray
    """(N,) bool: decoded after a key frame and shown before it, so that it may need the key frame before that one, too."""

    @classmethod
    def of(cls, video: Video, alone: np.ndarray) -> Chains | None:
        """None where the file does not tell. alone: (N,) bool, of `find_alone`."""
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
        before = np.concatenate([[0], np.cumsum(~alone[order])])
        return cls(root[place], place, before[place + 1] - before[root[place]], alone, leading[place])

    def move_picks(self, picks: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Frames (K,) near `picks` (K,), rising, whose chains are shorter; the first and the last stay. times: (N,) s."""
        reach = NEAR * (times[picks[-1]] - times[picks[0]]) / max(len(picks) - 1, 1)
        decoded = {int(self.root[end]): int(self.length[end]) for end in picks[[0, -1]]}
        moved = list(picks[[0, -1]])
        for pick in picks[-2:0:-1]:  # from the end: what a later frame's chain holds costs the earlier ones nothing
            away = np.abs(times - times[pick])
            near = np.flatnonzero(away <= reach)
            more = np.array([max(0, self.length[k] - decoded.get(int(self.root[k]), 0)) + self.alone[k] for k in near])
            best = near[np.lexsort((away[near], more))[0]]
            decoded[int(self.root[best])] = max(int(self.length[best]), decoded.get(int(self.root[best]), 0))
            moved.append(best)
        return np.unique(moved)

    def needed(self, picks: np.ndarray) -> np.ndarray:
        """(N,) bool, what has to be decoded for the frames `picks` (K,)."""
        inside = np.zeros(len(self.place), bool)
        for pick in picks:
            inside[self.root[pick]:self.place[pick] + 1] = True
        needed = inside[self.place] & ~self.alone
        needed[picks] = True
        for k in np.flatnonzero(needed & self.leading):  # one whose chain is broken could not be decoded
            needed[k] = inside[self.root[k]:self.place[k]].all()
        return needed


def find_alone(path: Path, video: Video) -> np.ndarray:
    """(N,) bool, frames to which no other refers, by the words of their packets; none where the codec's are not understood.

    HEVC says it of the frames of one temporal layer: a file of several may contradict it, which the decoder then tells.
    """
    referred = []
    try:
        with open_video(path) as container:
            stream = container.streams[video.stream]
            assert isinstance(stream, av.VideoStream)
            left = BitStreamFilterContext("filter_units=discard=nonref", stream)
            for packet in container.demux(stream):
                if packet.size:
                    referred += [kept.pts for kept in left.filter(packet)]
    except (FFmpegError, ValueError):
        return np.zeros(len(video.ticks), bool)
    return ~np.isin(video.ticks, np.array([tick for tick in referred if tick is not None], np.int64))
