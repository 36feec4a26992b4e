"""`gsac stage`: replay on fixture artifacts, and one stage in the folder of a run."""

from pathlib import Path


def make_fixture(toy):
    folder = toy.root / "fixtures"
    for side in ("left", "right"):
        (folder / side).mkdir(parents=True)
        (folder / side / "out.txt").write_text(side)
    return folder


def test_a_stage_is_replayed_on_fixture_artifacts(toy):
    done = toy.gsac("stage", "join", "--inputs", make_fixture(toy), "--out", toy.root / "replay", "--json")
    assert done.code == 0 and done.statuses == {"join": "ran"} and done.json["metrics"] == {"length": 9}
    assert Path(done.json["outputs"]["join/out.txt"]).read_text() == "left right"
    assert toy.runs == ["join"]


def test_a_replay_takes_parameters_and_force(toy):
    folder = make_fixture(toy)
    for force, runs in (([], 1), ([], 1), (["--force"], 2)):
        done = toy.gsac("stage", "join", "--inputs", folder, "--out", toy.root / "replay", "--set", "join.keep=3", *force)
        assert done.code == 0 and len(toy.runs) == runs


def test_replays_chain_when_each_output_folder_is_the_next_ones_input(toy):
    folder = toy.root / "chain"
    folder.mkdir()
    (folder / "clip").write_text("delta beta")
    for name in ("cut", "left", "right", "join"):
        done = toy.gsac("stage", name, "--inputs", folder, "--out", folder / name)
        assert done.code == 0, done.err
    assert (folder / "join" / "out.txt").read_text() == "DELTA DELTA"


def test_inputs_are_checked_against_their_ports(toy):
    folder = make_fixture(toy)
    (folder / "right" / "out.txt").write_text("")
    done = toy.gsac("stage", "join", "--inputs", folder, "--out", toy.root / "replay")
    assert done.code == 2 and "right/out.txt" in done.err and "is empty" in done.err and toy.runs == []
    (folder / "right" / "out.txt").unlink()
    done = toy.gsac("stage", "join", "--inputs", folder, "--out", toy.root / "replay")
    assert done.code == 2 and "right/out.txt: missing" in done.err and "left/out.txt, right/out.txt" in done.err


def test_inputs_and_out_go_together(toy):
    done = toy.gsac("stage", "join", "--inputs", make_fixture(toy))
    assert done.code == 2 and "--inputs and --out go together" in done.err


def test_an_unknown_stage_is_named_with_the_known_ones(toy):
    done = toy.gsac("stage", "shout", "--inputs", toy.root, "--out", toy.root / "x")
    assert done.code == 2 and "unknown stage shout; known: cut, left, right, join" in done.err


def test_in_the_folder_of_a_run_a_stage_reads_and_writes_that_folder(toy):
    toy.ran()
    toy.runs_file.write_text("")
    inside = toy.out / "left"
    assert toy.gsac("stage", "right", "--set", "right.word=last", cwd=inside).code == 0
    assert (toy.out / "right" / "out.txt").read_text() == "GAMMA"
    assert toy.gsac("stage", "join", cwd=inside).code == 0
    assert toy.result == "ALPHA GAMMA" and toy.runs == ["right", "join"]


def test_a_stage_whose_input_is_not_there_says_which_stage_to_run(toy):
    toy.ran("--until", "left")
    done = toy.gsac("stage", "join", cwd=toy.out)
    assert done.code == 2 and "gsac stage right" in done.err


def test_a_replay_that_fails_still_gives_its_json_object(toy):
    done = toy.gsac("stage", "join", "--inputs", make_fixture(toy), "--out", toy.root / "replay", "--json",
                    "--set", "join.trouble=stage")
    assert done.code == 1 and done.statuses == {"join": "failed"} and "frame 3" in done.json["stages"][0]["error"]


def test_the_folder_of_a_run_may_be_given_from_anywhere(toy):
    toy.ran()
    toy.runs_file.write_text("")
    assert toy.gsac("stage", "left", toy.out, "--force").code == 0 and toy.runs == ["left"]
    done = toy.gsac("stage", "join", toy.out, "--inputs", make_fixture(toy), "--out", toy.root / "replay")
    assert done.code == 2 and "leave one out" in done.err
