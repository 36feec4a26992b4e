"""Writes frames as a silent video (H.264, VP9, ProRes 4444) or a GIF, encoded by imageio-ffmpeg's ffmpeg, or as PNG files."""

from __future__ import annotations

import contextlib
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from gsac.avatar.ffmpeg import ffmpeg_program

CRF = 18
"""libx264's quality: 0 is lossless, 51 the worst."""
CRF_VP9 = 24
"""libvpx's: 0 is lossless, 63 the worst."""
BT709 = ["-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709"]
TO_BT709 = ["-vf", "scale=out_color_matrix=bt709:out_range=tv"]


def h264(crf: int = CRF, preset: str = "medium", threads: int = 0) -> list[str]:
    """ffmpeg's options of an H.264 file in an MP4. threads: 0 takes all cores; their number is seen in the bytes."""
    return [*TO_BT709, "-c:v", "libx264", "-preset", preset, "-threads", str(threads), "-crf", str(crf), "-pix_fmt", "yuv420p",
            *BT709, "-fflags", "+bitexact", "-flags:v", "+bitexact", "-movflags", "+faststart", "-f", "mp4"]


PALETTE = "split[a][b];[a]palettegen=reserve_transparent=1[p];[b][p]paletteuse=dither=sierra2_4a:alpha_threshold=128"
ENCODERS = {
    ".mp4": lambda alpha: h264(),
    ".webm": lambda alpha: [*TO_BT709, "-c:v", "libvpx-vp9", "-crf", str(CRF_VP9), "-b:v", "0", "-cpu-used", "4", "-row-mt", "1",
                            "-auto-alt-ref", "0", "-pix_fmt", "yuva420p" if alpha else "yuv420p", *BT709,
                            "-fflags", "+bitexact", "-flags:v", "+bitexact", "-f", "webm"],
    ".mov": lambda alpha: [*TO_BT709, "-c:v", "prores_ks", "-profile:v", "4444", "-vendor", "apl0",
                           "-alpha_bits", "16" if alpha else "0", "-pix_fmt", "yuva444p10le" if alpha else "yuv444p10le", *BT709,
                           "-fflags", "+bitexact", "-flags:v", "+bitexact", "-f", "mov"],
    ".gif": lambda alpha: ["-vf", PALETTE, "-loop", "0", "-f", "gif"],
}
"""Suffix -> ffmpeg's options, by whether the frames have transparency."""
TRANSPARENT = (".webm", ".mov", ".gif")
"""Suffixes of files that can hold transparency; PNG files can as well."""


class VideoError(Exception):
    """The file could not be written; carries ffmpeg's first line."""


class Video:
    """`with Video(path, 640, 480, 30) as video: video.add(frame)`. Width and height are even, px. Where the block raises, no file
    is left."""

    def __init__(self, path: Path, width: int, height: int, fps: float, alpha: bool = False, encoder: list[str] | None = None):
        """encoder: ffmpeg's options; None: by the suffix of the path, one of ENCODERS."""
        self.path, self.size, self.fps, self.alpha = Path(path), (width, height), fps, alpha
        self.encoder = encoder or ENCODERS[self.path.suffix.lower()](alpha)

    def __enter__(self) -> Video:
        width, height = self.size
        self.part = self.path.with_name(f".{self.path.name}.part")
        self.log = tempfile.TemporaryFile()
        self.process = subprocess.Popen(
            [ffmpeg_program(), "-y", "-nostdin", "-loglevel", "error", "-f", "rawvideo",
             "-pix_fmt", "rgba" if self.alpha else "rgb24", "-s", f"{width}x{height}", "-r", str(self.fps), "-i", "pipe:0",
             *self.encoder, f"file:{self.part}"],
            stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=self.log)
        return self

    def add(self, frame: np.ndarray) -> None:
        """Appends a frame (H, W, 3) uint8 RGB, or (H, W, 4) with straight alpha where the file has it."""
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


class Pictures:
    """`with Pictures(folder) as pictures: pictures.add(frame)` writes folder/000000.png and so on; the folder is new or empty.
    Where the block raises, none is left."""

    def __init__(self, folder: Path):
        self.folder, self.count = Path(folder), 0

    def __enter__(self) -> Pictures:
        self.part = Path(tempfile.mkdtemp(prefix=f".{self.folder.name}.", dir=self.folder.parent))
        return self

    def add(self, frame: np.ndarray) -> None:
        """Writes a frame (H, W, 3) uint8 RGB, or (H, W, 4) with straight alpha."""
        from PIL import Image

        Image.fromarray(frame).save(self.part / f"{self.count:06d}.png")
        self.count += 1

    def __exit__(self, kind, error, trace) -> None:
        if kind is not None:
            shutil.rmtree(self.part)
            return
        self.part.chmod(0o755)
        self.part.replace(self.folder)
