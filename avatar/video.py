"""Writes a silent H.264 file frame by frame, encoded by imageio-ffmpeg's ffmpeg."""

from __future__ import annotations

import contextlib
import subprocess
import tempfile
from pathlib import Path

import numpy as np

CRF = 18
"""libx264's quality: 0 is lossless, 51 the worst."""


class VideoError(Exception):
    """The file could not be written; carries ffmpeg's first line."""


class Video:
    """`with Video(path, 640, 480, 30) as video: video.add(frame)`. Width and height are even, px. Where the block raises, no file
    is left."""

    def __init__(self, path: Path, width: int, height: int, fps: float):
        self.path, self.size, self.fps = Path(path), (width, height), fps

    def __enter__(self) -> Video:
        import imageio_ffmpeg

        width, height = self.size
        self.part = self.path.with_name(f".{self.path.name}.part")
        self.log = tempfile.TemporaryFile()
        self.process = subprocess.Popen(
            [imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-nostdin", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24",
             "-s", f"{width}x{height}", "-r", f"{self.fps:g}", "-i", "pipe:0",
             "-vf", "scale=out_color_matrix=bt709:out_range=tv", "-c:v", "libx264", "-preset", "medium", "-crf", str(CRF),
             "-pix_fmt", "yuv420p", "-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709",
             "-fflags", "+bitexact", "-flags:v", "+bitexact", "-movflags", "+faststart", "-f", "mp4", str(self.part)],
            stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=self.log)
        return self

    def add(self, frame: np.ndarray) -> None:
        """Appends a frame (H, W, 3) uint8 RGB."""
        try:
            self.process.stdin.write(np.ascontiguousarray(frame, np.uint8).tobytes())
        except BrokenPipeError:
            raise VideoError(self._why()) from None

    def __exit__(self, kind, error, trace) -> None:
        try:
            if kind is not None:
                self.process.kill()
            with contextlib.suppress(BrokenPipeError):
                self.process.stdin.close()
            if self.process.wait() and kind is None:
                raise VideoError(self._why())
            if kind is None:
                self.part.replace(self.path)
        finally:
            self.process.wait()
            self.log.close()
            self.part.unlink(missing_ok=True)

    def _why(self) -> str:
        self.process.wait()
        self.log.seek(0)
        lines = self.log.read().decode(errors="replace").strip().splitlines()
        return f"{self.path}: ffmpeg could not write it ({lines[0] if lines else 'it ended'})"
