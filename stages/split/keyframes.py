"""Small pictures from a video at little cost: its key frames, which need no other frame to be decoded."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import av
import numpy as np
from av.error import FFmpegError

from gsac.stages.split.pick import pick_evenly
from gsac.stages.split.probe import Video, open_video


def read_key_frames(path: Path, video: Video, count: int, width: int, height: int) -> Iterator[np.ndarray]:
    """Yields (height, width, 3) uint8 of at most `count` key frames, upright, spread evenly; ends early where one is damaged.

    HDR is not tone-mapped.
    """
    with open_video(path) as container:
        stream = container.streams[video.stream]
        assert isinstance(stream, av.VideoStream)
        stream.codec_context.skip_frame = "NONKEY"
        for tick in video.key_ticks[pick_evenly(len(video.key_ticks), count)]:
            try:
                container.seek(int(tick), stream=stream)
                frame = next(container.decode(stream), None)
            except FFmpegError:
                return
            if frame is None:
                return
            quarters = (round(frame.rotation / 90) + video.quarters) % 4
            size = (height, width) if quarters % 2 else (width, height)
            yield np.ascontiguousarray(np.rot90(frame.to_ndarray(format="rgb24", width=size[0], height=size[1]), quarters))
