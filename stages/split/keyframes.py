"""Small pictures from a video at little cost: its key frames, which need no other frame to be decoded."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import av
import numpy as np
from av.error import FFmpegError

from gsac.stages.split.pick import pick_evenly, turn_size
from gsac.stages.split.probe import Video, open_video


def read_key_frames(path: Path, video: Video, count: int, width: int, height: int) -> Iterator[np.ndarray]:
    """Yields (height, width, 3) uint8 of at most `count` key frames, as shown and turned by the video's `quarters`, spread evenly;
    ends early where one is damaged. Where a clip was trimmed to what lies between two of them, yields its first frame.

    HDR is not tone-mapped.
    """
    keyed = len(video.key_ticks) > 0
    with open_video(path) as container:
        stream = container.streams[video.stream]
        assert isinstance(stream, av.VideoStream)
        stream.codec_context.skip_frame = "NONKEY" if keyed else "DEFAULT"
        for tick in video.key_ticks[pick_evenly(len(video.key_ticks), count)] if keyed else video.ticks[:1]:
            try:
                container.seek(int(tick), stream=stream)
                frame = next((frame for frame in container.decode(stream) if frame.pts is None or frame.pts >= tick), None)
            except FFmpegError:
                return
            if frame is None:
                return
            over, quarters = read_display(frame)
            quarters += video.quarters
            stored = turn_size(width, height, quarters)
            picture = frame.to_ndarray(format="rgb24", width=stored[0], height=stored[1])
            yield np.ascontiguousarray(np.rot90(picture[::-1] if over else picture, quarters))


def read_display(frame: av.VideoFrame) -> tuple[bool, int]:
    """Whether the stored picture is turned over, top to bottom, before it is shown, and by how many quarters, counter-clockwise as
    seen, it is turned then. By the file's display matrix, from which PyAV's `rotation` takes the angle alone."""
    data = frame.side_data.get("DISPLAYMATRIX")
    if data is None:
        return False, 0
    # The place (x, y) of a pixel is shown at (a x + c y, b x + d y), but for scale and shift.
    a, b, _, c, d = np.frombuffer(data, np.int32)[:5].astype(float)
    return bool(a * d < b * c), round(-np.arctan2(b, a) / (np.pi / 2))
