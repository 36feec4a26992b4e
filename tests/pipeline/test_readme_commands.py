"""README's own commands, run in their order in the folder of a user, cost no file of the user's."""

import re
import shlex
import signal
import urllib.request
from pathlib import Path

import pytest

from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.pipeline.project import shipped_dag
from gsac.viewer.page import page_bytes
from support import dances
from support.figure import make_figure

README = shipped_dag().with_name("README.md")
OPENS = "view"
"""The command that goes on until Ctrl-C."""

MAKE = '''
import os
import shutil
from gsac.toy.common import begin


def run(job):
    begin(job, "export")
    for name in ("avatar.gsac", "viewer.html"):
        shutil.copyfile(os.path.join(os.environ["TOY_FIGURE"], name), job.out / name)
'''


def commands() -> list[list[str]]:
    """Words of the command lines in README's code blocks, in their order."""
    blocks = re.findall(r"^```\n(.*?)^```", README.read_text(), re.MULTILINE | re.DOTALL)
    lines = re.findall(r"^(?:\.venv/bin/)?gsac (.*)", "\n".join(blocks), re.MULTILINE)
    return [shlex.split(line, comments=True) for line in lines]


@pytest.fixture
def user(toy, tmp_path, monkeypatch):
    """The toy project, whose stage export gives the small figure, and the files that README's reader has."""
    toy.call_last_stage_export()
    toy.edit("export/__init__.py", "'out.txt', 'metrics.json'", "'avatar.gsac', 'viewer.html'")
    for old, new in (("out.txt", "avatar.gsac"), ("metrics.json", "viewer.html")):
        toy.edit("dvc.yaml", f"export/{old}", f"export/{new}")
    toy.write("export/stage.py", MAKE)
    figure, avatar = tmp_path / "figure", make_figure()
    figure.mkdir()
    (figure / "avatar.gsac").write_bytes(avatar_bytes(avatar))
    (figure / "viewer.html").write_bytes(page_bytes(avatar_bytes(avatar)))
    monkeypatch.setenv("TOY_FIGURE", str(figure))
    home = tmp_path / "home"
    home.mkdir()
    (home / "clip.mp4").write_text("alpha beta gamma")
    (home / "avatar.mp4").write_text("another film of mine")
    (home / "notes.txt").write_text("notes")
    skeleton = dances.Skeleton(avatar.joint_names, avatar.parents, avatar.joints)
    walk = avatar.clips["walk"]
    still = dances.Motion(walk.fps, walk.rotation[:2, :1].repeat(len(avatar.joints), 1) * 0, walk.transl[:2])
    (home / "dance.bvh").write_text(dances.bvh_text(skeleton, still))
    return toy, home


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def run(toy, home: Path, words: list[str]) -> tuple[int, str]:
    """Exit code and what was said; a command that serves a page is visited and then stopped as its user would."""
    if words[0] != OPENS:
        done = toy.gsac(*words, cwd=home)
        return done.code, done.out + done.err
    started = toy.start(OPENS, home / words[1], *words[2:], DISPLAY="", WAYLAND_DISPLAY="")
    address = next(word for line in started.stdout for word in line.split() if word.startswith("http"))
    assert urllib.request.urlopen(address).read() == (home / words[1] / "export" / "viewer.html").read_bytes()
    started.send_signal(signal.SIGINT)
    said = started.communicate(timeout=60)[1]
    return started.returncode, said


def test_readmes_commands_in_their_order_work_and_change_no_file_that_was_there_not_even_when_typed_again(user):
    toy, home = user
    assert [words[0] for words in commands()][:3] == ["run", "view", "render"]
    mine = contents(home)
    for words in commands():
        code, said = run(toy, home, words)
        assert code == 0, (words, said)
        assert mine.items() <= contents(home).items(), words
    made = contents(home)
    assert made.keys() - mine.keys() == {"clip-avatar-dance.mp4", "clip-avatar.vrm", "clip-avatar.zip"}
    for words in commands():
        code, said = run(toy, home, words)
        assert (code, "--force" in said) == ((2, True) if words[0] in ("render", "convert", "pack") else (0, False)), (words, said)
    assert contents(home) == made
