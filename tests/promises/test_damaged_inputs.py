"""Damage is found before it is used, also where neither size nor times tell of it."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from support.poison import hide_damage


def spoil(toy, port: str, file: str = "", text: str = "omega") -> Path:
    """Damages an output in the cache as rot does; returns the file."""
    stage, _, output = port.partition("/")
    place = (toy.out / port).resolve()
    path = place / file if file else place
    path.chmod(0o644)
    path.write_text(text)
    for record in (toy.cache / "actions").glob("*/*.json"):
        if place.name[:64] in record.read_text() and record.parent.name == stage:
            hide_damage(record, output, place)
    return path


def test_a_damaged_input_is_made_again_before_a_stage_reads_it(toy):
    toy.ran()
    spoil(toy, "cut/words", "000000.txt")
    assert toy.run().statuses == dict.fromkeys(("cut", "left", "right", "join"), "cached"), "nothing reads it"
    toy.runs_file.write_text("")
    done = toy.run("--set", "left.keep=7")
    assert done.code == 0 and toy.runs == ["cut", "left"], done.err
    assert done.statuses == {"cut": "ran", "left": "ran", "right": "cached", "join": "cached"}
    assert [stage["name"] for stage in done.json["stages"]] == ["cut", "left", "right", "join"]
    assert "left: its input cut/words was damaged in the cache; cut runs again first" in done.err
    assert done.err.count("cut: cached") == 1 and toy.result == "ALPHA ALPHA"
    assert len(list((toy.cache / "quarantine").iterdir())) == 1
    assert toy.gsac("cache", "verify").code == 0


def test_damaged_inputs_of_damaged_inputs_are_made_again_too(toy):
    toy.ran("--set", "right.word=last")
    spoil(toy, "cut/words", "000000.txt")
    spoil(toy, "left/out.txt", text="OMEGA")
    toy.runs_file.write_text("")
    done = toy.run("--set", "right.word=last", "--force", "join")
    assert done.code == 0 and toy.runs == ["cut", "left", "join"], done.err
    assert toy.result == "ALPHA GAMMA"


def test_a_stage_alone_does_not_read_a_damaged_input_and_names_the_stage_that_makes_it_again(toy):
    toy.ran()
    spoil(toy, "cut/words", "000000.txt")
    done = toy.gsac("stage", "left", toy.out, "--set", "left.keep=7")
    assert done.code == 4 and "cut/words was damaged in the cache; `gsac stage cut` makes it again" in done.err
    done = toy.gsac("stage", "left", toy.out, "--set", "left.keep=7")
    assert done.code == 2 and "cut/words is missing; run `gsac stage cut`" in done.err
    assert toy.runs == ["cut", "left", "right", "join"]
    assert toy.gsac("stage", "cut", toy.out).code == 0
    assert toy.gsac("stage", "left", toy.out, "--set", "left.keep=7").code == 0
    assert (toy.out / "left" / "out.txt").read_text() == "ALPHA"


def test_a_run_stays_cached_after_what_changes_no_content(toy):
    toy.call_last_stage_export()
    toy.ran()
    assert toy.gsac("cache", "gc", "--keep-days", "0").code == 0
    shutil.copytree(toy.cache, toy.root / "copy", symlinks=True)
    shutil.rmtree(toy.cache)
    (toy.root / "copy").rename(toy.cache)
    for number, path in enumerate((toy.cache / "objects").rglob("*.txt")):
        path.touch() if number % 2 else path.chmod(0o600)
        os.link(path, toy.root / f"second name {number}")
    assert toy.ran() == [] and list((toy.cache / "quarantine").iterdir()) == []
