"""The program that all video goes through."""

import subprocess
import sys
from pathlib import Path

import imageio_ffmpeg

from gsac.avatar import ffmpeg
from gsac.avatar.ffmpeg import ffmpeg_program


def test_it_is_the_one_that_the_package_brings_whatever_the_environment_says(monkeypatch):
    monkeypatch.delenv("IMAGEIO_FFMPEG_EXE", raising=False)
    ours = imageio_ffmpeg.get_ffmpeg_exe()
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", "/bin/true")
    assert ffmpeg_program() == ours


def test_it_is_found_without_importing_the_package():
    script = "import sys; from gsac.avatar.ffmpeg import ffmpeg_program; ffmpeg_program(); print('imageio_ffmpeg' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout == "False\n"


def test_where_the_package_brings_none_it_is_the_one_on_the_path(monkeypatch, tmp_path):
    program = tmp_path / "ffmpeg"
    program.touch(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(ffmpeg, "find_spec", lambda name: None)
    assert Path(ffmpeg_program()) == program
    program.unlink()
    assert ffmpeg_program() == "ffmpeg"
