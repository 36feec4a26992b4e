"""`gsac fixtures`: what every stage of a run read, as plain files, with a manifest that says how to replay them."""

import json
import shlex
import shutil

import pytest

READ = {"clip", "cut/words", "left/out.txt", "right/out.txt"}
"""Ports that some stage of the toy reads."""


@pytest.fixture
def cut(toy):
    toy.ran("--set", "left.word=last")
    folder = toy.root / "fixtures"
    done = toy.gsac("fixtures", toy.out, "--out", folder, "--json")
    assert done.code == 0, done.err
    assert done.json["outputs"] == {"manifest": str(folder / "manifest.json")} and done.json["metrics"]["stages"] == 4
    return folder


def test_fixtures_need_neither_the_run_nor_its_cache_and_their_commands_give_the_promised_digests(toy, cut, everything):
    manifest = json.loads((cut / "manifest.json").read_text())
    assert manifest["inputs"].keys() == READ and manifest["frames"] is None
    assert not [path for path in cut.rglob("*") if path.is_symlink()]
    shutil.rmtree(toy.out)
    toy.cache.rename(toy.root / "old cache")
    moved = cut.rename(toy.root / "elsewhere")
    for name in everything:
        stage = manifest["stages"][name]
        done = toy.gsac(*shlex.split(stage["command"])[1:], cwd=moved)
        assert done.code == 0 and done.json["stages"][0]["outputs"] == stage["outputs"], done.err
    assert (moved / "replay" / "join" / "out.txt").read_text() == "GAMMA ALPHA"


def test_files_of_a_fixture_may_be_edited(toy, cut):
    (cut / "right" / "out.txt").write_text("other")
    done = toy.gsac("stage", "join", "--inputs", cut, "--out", toy.root / "replay")
    assert done.code == 0 and (toy.root / "replay" / "out.txt").read_text() == "GAMMA other"


def test_a_run_that_was_stopped_early_gives_the_stages_that_it_can_feed(toy):
    toy.ran("--until", "left")
    assert toy.gsac("fixtures", toy.out, "--out", toy.root / "fixtures").code == 0
    manifest = json.loads((toy.root / "fixtures" / "manifest.json").read_text())
    assert list(manifest["stages"]) == ["cut", "left", "right"] and manifest["stages"]["right"]["outputs"] is None


def test_no_outputs_are_promised_of_a_result_that_was_made_from_something_else(toy):
    toy.ran()
    toy.ran("--set", "left.word=last", "--until", "left")
    assert toy.gsac("fixtures", toy.out, "--out", toy.root / "fixtures").code == 0
    stages = json.loads((toy.root / "fixtures" / "manifest.json").read_text())["stages"]
    assert stages["join"]["outputs"] is None and stages["left"]["outputs"] is not None


def test_what_cannot_be_cut_is_said_and_nothing_is_left(toy):
    toy.ran()
    for arguments, said in ((("--frames", "0"), "--frames 0: expected 1 or more"), ((), "a folder that does not exist yet")):
        folder = toy.root / "fixtures" if arguments else toy.out
        done = toy.gsac("fixtures", toy.out, "--out", folder, *arguments)
        assert done.code == 2 and said in " ".join(done.err.split())
    done = toy.gsac("fixtures", toy.root, "--out", toy.root / "fixtures")
    assert done.code == 2 and "is not in the output folder of a run" in done.err and not (toy.root / "fixtures").exists()
