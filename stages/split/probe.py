"""Reads what a video file holds, decoding no more than its first picture."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import av
import av.container
import numpy as np
from av.container import InputContainer
from av.error import FFmpegError

from gsac.stages.contract import BadInput
from gsac.stages.split.pick import turn_size
from gsac.stages.split.picture_file import refuse_picture

HLG, PQ, BT2020_PRIMARIES, BT2020_MATRIX, UNSPECIFIED = 18, 16, 9, 9, 2
"""Code points of ITU-T H.273."""
MOST_PIXELS = 8192 * 4320
"""Of a frame: 8K. A larger one would fill the memory, however small the file is."""
CONTAINERS = ("mov", "matroska", "webm", "avi", "mpegts", "mpeg", "mpegvideo", "flv", "asf", "ogg", "mxf", "dv", "ivf", "m4v",
              "h264", "hevc", "obu", "yuv4mpegpipe", "gif")
"""What ffmpeg may take a video's content for. It knows others that name further files, as playlists do, or that are programs."""
SLOTTED = "avi"
"""ffmpeg's name of the container whose header counts slots of time in place of frames."""
LIMITS = {"format_whitelist": ",".join(CONTAINERS), "protocol_whitelist": "file", "max_pixels": str(MOST_PIXELS)}
"""ffmpeg's options for a file that anybody may have made."""


@dataclass
class Video:
    """A video file's video stream."""

    stream: int
    """Index of the video stream in the file."""
    ticks: np.ndarray
    """(N,) int64 presentation times, rising, in time_base, of all frames that need none from before the file's beginning; empty
    where the container has none."""
    key_ticks: np.ndarray
    """(K,) int64, those of them whose frame needs no other one."""
    sent: np.ndarray
    """(N,) int64, when each frame is decoded, in time_base, none twice; empty where the container does not tell."""
    time_base: Fraction
    declared_frames: int
    """Number of frames by the header, among them those that are kept and not shown; 0 where it has none."""
    width: int
    height: int
    """Displayed size, px: after the rotation tag and `quarters`, with square pixels."""
    transfer: int
    primaries: int
    matrix: int
    has_alpha: bool
    interlaced: bool
    """Whether its frames are two half pictures each, as camcorders film."""
    decoder: str | None
    """The ffmpeg decoder to use where its default would lose the alpha channel."""
    rate: float | None
    """Frames a second by the header."""
    tags: dict[str, str]
    """Metadata of container and stream; keys in lower case."""
    quarters: int = 0
    """By which it is turned beside its tag, counter-clockwise as seen, so that its person stands (`upright`)."""

    def turned(self, quarters: int) -> Video:
        """The same, turned by that much more."""
        width, height = turn_size(self.width, self.height, quarters)
        return replace(self, width=width, height=height, quarters=(self.quarters + quarters) % 4)


def probe(path: Path) -> Video:
    """Raises BadInput where the file is a picture, or no picture of it can be decoded."""
    refuse_picture(path)
    try:
        with open_video(path) as container:
            return _probe(container, path)
    except BadInput:
        raise
    except Exception as e:  # beside its own errors PyAV raises nearly anything on a damaged file
        if _is_text(path):
            raise BadInput(f"{path.name}: is text, no video; a playlist or a list of files is not followed. Give the video itself, "
                           "or a folder of photos.") from e
        raise BadInput(f"{path.name}: not a video that ffmpeg can read ({_reason(e)}). If it plays elsewhere, "
                       "convert it to MP4 (H.264); if it does not, it is cut off or damaged: copy it from the phone again.") from e


def file_url(path: Path) -> str:
    """The file's address, in which no part of its name is a protocol or an option."""
    return f"file:{path.absolute()}"


def open_video(path: Path, **options: str) -> InputContainer:
    """Under `LIMITS`. options: further ones of ffmpeg's."""
    return av.open(file_url(path), options=LIMITS | options, metadata_errors="ignore")


def count_frames(path: Path, video: Video) -> tuple[int, int]:
    """Number of the video's frames by its header, and of those that are in the file, among them those that it keeps and does not
    show, as where it was trimmed without loss."""
    sent = []
    with open_video(path, ignore_editlist="1") as container:
        with contextlib.suppress(FFmpegError):  # a truncated file, as in _packet_times
            sent += [packet.dts for packet in container.demux(container.streams[video.stream])
                     if packet.size > 0 and not packet.is_corrupt]
        slotted = container.format.name == SLOTTED
    if slotted and None not in sent and len(used := np.unique(np.array(sent, np.int64))) > 1:
        return len(sent) + count_promised(used, video.declared_frames), len(sent)
    return video.declared_frames, len(sent)


def count_promised(used: np.ndarray, slots: int) -> int:
    """Number of frames that an AVI's header promises after those that are there, at their pace.

    used: (N,) int64, rising, N >= 2, the slots of frames that are there. slots: of which the header tells the number; those between
    two frames are empty, as many as 19 where a clip was copied in without encoding. After the last frame fewer than between any two
    are no promise: it lasts so long.
    """
    left = slots - 1 - int(used[-1])
    return left * (len(used) - 1) // int(used[-1] - used[0]) if left >= np.diff(used).max() else 0


def _is_text(path: Path) -> bool:
    with path.open("rb") as file:
        return not any(byte < 32 and chr(byte) not in "\t\r\n" for byte in file.read(64))


def _probe(container: InputContainer, path: Path) -> Video:
    streams = [s for s in container.streams.video if not s.disposition & av.stream.Disposition.attached_pic]
    if not streams:
        raise BadInput(f"{path.name}: holds no video stream; expected a video of one person or a folder of photos.")
    decoded = [s for s in streams if s.codec_context is not None]
    if not decoded:
        raise BadInput(f"{path.name}: its video is packed in a way that ffmpeg cannot read; convert it to MP4 (H.264).")
    stream = max(decoded, key=lambda s: (s.width or 0) * (s.height or 0))
    _check_size(path, stream.width, stream.height)
    stream.codec_context.options = {"max_pixels": LIMITS["max_pixels"]}
    picture = _first_picture(container, stream, path)
    ticks, key_ticks, sent = _packet_times(path, stream.index)
    whole = ticks >= _find_start(key_ticks, picture.pts)

    width, height = picture.width, picture.height
    aspect = stream.sample_aspect_ratio or Fraction(1)
    if aspect > 1:
        width = round(width * aspect)
    elif aspect > 0:
        height = round(height / aspect)
    if abs(picture.rotation) % 180 == 90:
        width, height = height, width
    _check_size(path, width, height)

    if stream.time_base is None:
        raise BadInput(f"{path.name}: its frames have no times; the file is damaged. Copy it from the phone again.")
    codec = stream.codec_context.name
    tags = {key.lower(): value for key, value in (dict(container.metadata) | dict(stream.metadata)).items()}
    hidden_alpha = codec in ("vp8", "vp9") and tags.get("alpha_mode") == "1"
    rate = stream.average_rate or stream.guessed_rate
    return Video(
        stream=stream.index, ticks=ticks[whole], key_ticks=key_ticks, sent=sent[whole[:len(sent)]],
        time_base=stream.time_base or Fraction(1, 1_000_000), declared_frames=stream.frames, width=width, height=height,
        transfer=int(picture.color_trc), primaries=int(picture.color_primaries), matrix=int(picture.colorspace),
        has_alpha=hidden_alpha or any(c.is_alpha for c in picture.format.components),
        interlaced=picture.interlaced_frame,
        decoder={"vp8": "libvpx", "vp9": "libvpx-vp9"}[codec] if hidden_alpha else None,
        rate=float(rate) if rate else None, tags=tags)


def _check_size(path: Path, width: int, height: int) -> None:
    if width * height > MOST_PIXELS:
        raise BadInput(f"{path.name}: has frames of {width}x{height} pixels; at most {MOST_PIXELS} (8192x4320) are read. "
                       "Export it smaller.")


def _first_picture(container: InputContainer, stream: av.VideoStream, path: Path) -> av.VideoFrame:
    error = "no packet of it decodes"
    for packet in container.demux(stream):
        try:
            for picture in packet.decode():
                return picture
        except FFmpegError as e:
            error = _reason(e)
    raise BadInput(f"{path.name}: no frame can be decoded ({error}). The file is empty or damaged; "
                   "copy it from the phone again.")


def _packet_times(path: Path, index: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(N,) rising ticks of the intact packets of one stream, (K,) of its key frames, and (N,) when each is decoded; the first two
    are empty if any has no time, the last if it is not told. An AVI tells when frames are decoded alone: where they are shown at
    other times, ffmpeg's guess is off by the decoder's delay."""
    ticks, keys, sent, none = [], [], [], np.zeros(0, np.int64)
    with open_video(path) as container:
        slotted = container.format.name == SLOTTED
        try:
            for packet in container.demux(container.streams[index]):
                if packet.size == 0 or packet.is_discard or packet.is_corrupt:
                    continue
                if packet.pts is None or (slotted and packet.pts != packet.dts):
                    return none, none, none
                ticks.append(packet.pts)
                sent.append(packet.dts)
                keys += [packet.pts] * packet.is_keyframe
        except FFmpegError:
            pass  # a truncated file: what was read so far is what there is
    rising, first = np.unique(np.array(ticks, np.int64), return_index=True)
    told = None not in sent and len(set(sent)) == len(rising) == len(ticks)
    return rising, np.unique(np.array(keys, np.int64)), np.array(sent if told else [], np.int64)[first if told else []]


def _find_start(key_ticks: np.ndarray, first: int | None) -> int:
    """Tick before which no frame decodes, where the video begins between key frames, as one that was trimmed without loss, or with
    frames that are shown before its first key frame and need the one before. first: tick of the first picture that decodes."""
    return min(first, int(key_ticks[0])) if first is not None and len(key_ticks) else np.iinfo(np.int64).min


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)
