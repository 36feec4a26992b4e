"""gsac convert by its command line, on the small figure of the export's tests."""

import json
import zipfile

import pytest

from gsac.avatar.gsac_file.write import avatar_bytes
from gsac.pipeline.cli import execute
from gsac.pipeline.commands.convert import FORMATS, POSED
from gsac.stages.export.on_request import POSED_WRITERS, WRITERS
from support.figure import make_figure


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run's folder with avatar.gsac."""
    folder = tmp_path_factory.mktemp("ada")
    (folder / "export").mkdir()
    (folder / "export" / "avatar.gsac").write_bytes(avatar_bytes(make_figure()))
    return folder


def convert(capsys, *words):
    code = execute(["convert", *map(str, words)])
    said = capsys.readouterr()
    return code, said.out, said.err


@pytest.mark.parametrize(("kind", "begins"), [("vrm", b"glTF"), ("usdz", b"PK"), ("sog", b"PK"), ("glb", b"glTF")])
def test_an_avatar_becomes_a_file_of_each_format_named_after_its_run(run, tmp_path, monkeypatch, capsys, kind, begins):
    monkeypatch.chdir(tmp_path)
    code, out, _ = convert(capsys, run, kind, "--json")
    answer, made = json.loads(out.splitlines()[-1]), tmp_path / f"{run.name}.{kind}"
    assert code == 0 and answer["outputs"] == {kind: str(made)} and answer["metrics"]["bytes"] == made.stat().st_size
    assert made.read_bytes().startswith(begins) and [p.name for p in tmp_path.iterdir()] == [made.name]


def test_every_format_that_the_command_names_has_a_writer():
    assert FORMATS.keys() == WRITERS.keys() | POSED_WRITERS.keys() and set(POSED) == POSED_WRITERS.keys()


@pytest.mark.parametrize("kind", ["vrm", "usdz"])
def test_a_pose_of_a_format_that_moves_is_refused(run, tmp_path, capsys, kind):
    code, _, said = convert(capsys, run, kind, "--pose", "t", "--out", tmp_path / f"a.{kind}")
    assert code == 2 and f"--pose t: {kind} has no pose of its own" in said and not list(tmp_path.iterdir())


def test_gaussians_stand_in_the_pose_that_is_asked_for(run, tmp_path, capsys):
    widths = {}
    for pose in "at":
        assert convert(capsys, run, "sog", "--pose", pose, "--out", tmp_path / f"{pose}.sog")[0] == 0
        with zipfile.ZipFile(tmp_path / f"{pose}.sog") as archive:
            means = json.loads(archive.read("meta.json"))["means"]
        widths[pose] = means["maxs"][0] - means["mins"][0]
    assert widths["t"] > 1.1 * widths["a"]


def test_nothing_is_written_over_and_a_wrong_name_or_file_is_said(run, tmp_path, capsys):
    there = tmp_path / "there.vrm"
    there.write_text("mine")
    code, _, said = convert(capsys, run, "vrm", "--out", there)
    assert code == 2 and "--force" in said and there.read_text() == "mine"
    assert convert(capsys, run, "vrm", "--out", there, "--force")[0] == 0 and there.read_bytes()[:4] == b"glTF"
    code, _, said = convert(capsys, run, "usdz", "--out", tmp_path / "a.glb")
    assert code == 2 and "expected a file .usdz" in said
    for words, named in ((["vmr"], "unknown format vmr"), (["sog", "--pose", "x"], "--pose x: expected a or t")):
        code, _, said = convert(capsys, run, *words)
        assert code == 2 and named in said
    broken = tmp_path / "broken.gsac"
    broken.write_bytes((run / "export" / "avatar.gsac").read_bytes()[:900])
    code, _, said = convert(capsys, broken, "vrm", "--out", tmp_path / "b.vrm")
    assert code == 2 and "broken.gsac" in said and "Traceback" not in said and not (tmp_path / "b.vrm").exists()
