"""In a terminal no line breaks inside a word; pipes get each line whole."""

import fcntl
import io
import os
import pty
import re
import struct
import sys
import termios

import pytest

from gsac.pipeline.cli import execute
from gsac.pipeline.journal import Journal
from gsac.pipeline.outcomes import Outcome
from gsac.pipeline.reporter import PlainReporter, TerminalReporter
from gsac.pipeline.wrapping import wrap

COLUMNS = 44
SENTENCE = "The clip carries no focal length; estimated 1246 px (set smplx.focal_px to fix it), well-known for phones."
PATH = "/home/somebody/a/folder/of/a/long/name/clip-avatar/export/viewer.html"


@pytest.fixture
def terminal(monkeypatch):
    """A terminal of COLUMNS columns to write to, and a function that returns the lines that it was sent."""
    monkeypatch.delenv("COLUMNS", raising=False)
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 30, COLUMNS, 0, 0))
    with os.fdopen(theirs, "w") as stream:
        def lines():
            stream.flush()
            sent = os.read(ours, 1 << 16).decode()
            return re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", sent).replace("\r", "").rstrip("\n").split("\n")

        yield stream, lines
    os.close(ours)


@pytest.mark.parametrize("kind", [PlainReporter, TerminalReporter])
@pytest.mark.parametrize("tell", [
    lambda it: Journal(it.take).warning("smplx", SENTENCE), lambda it: Journal(it.take).remark("smplx", SENTENCE),
    lambda it: it.note(SENTENCE), lambda it: it.foresees("smplx", Outcome.PLANNED, 0, SENTENCE)])
def test_a_line_breaks_between_words(terminal, kind, tell):
    stream, lines = terminal
    with kind(stream) as reporter:
        tell(reporter)
    said = lines()
    assert len(said) > 1 and max(map(len, said)) <= COLUMNS
    assert SENTENCE.split() == " ".join(said).split()[-len(SENTENCE.split()):]


@pytest.mark.parametrize("kind", [PlainReporter, TerminalReporter])
def test_a_path_stays_whole_so_that_it_can_be_clicked(terminal, kind):
    stream, lines = terminal
    kind(stream).note(f"viewer:  {PATH}")
    assert PATH in " ".join(lines()).split()


def test_an_error_breaks_between_words_too(terminal, monkeypatch, tmp_path):
    stream, lines = terminal
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stderr", stream)
    assert execute(["run", "nowhere.mp4"]) == 2
    assert lines() == ["gsac: nowhere.mp4: no such file or folder;", "  give a video or a folder of photos"]


def test_a_pipe_gets_each_line_whole():
    stream = io.StringIO()
    Journal(PlainReporter(stream).take).warning("smplx", SENTENCE)
    assert stream.getvalue() == f"smplx: warning: {SENTENCE}\n"


def test_what_fits_stays_as_it_is_with_its_columns():
    table = "split       cached   0.1 s\n\n  keypoints  ran      9.0 s"
    assert wrap(table, 80) == table
