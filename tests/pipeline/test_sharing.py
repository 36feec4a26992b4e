"""Runs of several machines over one shared place, and what a run does where that place fails."""

import subprocess
import sys
import time

import pytest

from support.s3 import SECRET, serving
from support.toy import Toy


@pytest.fixture
def server():
    pytest.importorskip("obstore")
    with serving() as held:
        yield held


@pytest.fixture
def machine(tmp_path):
    """machine(name): a toy project with a cache of its own; the same clip everywhere."""

    def make(name: str) -> Toy:
        (tmp_path / name).mkdir()
        return Toy(tmp_path / name)

    return make


def test_what_one_machine_computed_another_fetches_and_places(server, machine, everything):
    one, two = machine("one"), machine("two")
    assert one.ran(**server.env) == everything
    assert server.names("leases") == [] and len(server.names("actions")) == 4
    done = two.run(**server.env)
    assert two.runs == [] and done.statuses == dict.fromkeys(everything, "cached")
    assert "cut: fetched from s3://bucket/prefix" in done.err
    assert two.result == one.result
    times = [[stage["seconds"] for stage in toy.run("--dry-run").json["stages"]] for toy in (one, two)]
    assert times[0] == times[1]
    asked = len(server.asked)
    assert two.ran(**server.env) == [] and len(server.asked) == asked  # all is here: nobody is asked


def test_a_changed_parameter_fetches_what_is_above_and_computes_what_is_below(server, machine):
    one, two = machine("one"), machine("two")
    one.ran(**server.env)
    assert two.ran("--set", "left.word=last", **server.env) == ["left", "join"]


def test_a_damaged_object_here_is_fetched_again_instead_of_computed(server, machine):
    toy = machine("one")
    toy.ran(**server.env)
    damaged = (toy.out / "left" / "out.txt").resolve()
    damaged.chmod(0o644)
    damaged.write_text("DAMAGED")
    assert toy.ran(**server.env) == [] and toy.result == "ALPHA ALPHA"


@pytest.mark.parametrize("what", ["500", "spoil", *(pytest.param(what, marks=pytest.mark.slow) for what in ("403", "cut"))])
def test_a_shared_place_that_fails_never_fails_a_run_nor_gives_it_a_wrong_result(server, machine, everything, what):
    one, two = machine("one"), machine("two")
    one.ran(**server.env)
    server.trouble = lambda method, name: what if "/leases/" not in name else None
    done = two.run(**server.env)
    assert done.code == 0 and two.runs == everything and two.result == one.result
    assert SECRET not in done.err + done.out and "AKIA" not in done.err + done.out
    if what == "spoil":
        assert done.err.count("is not used: ") == 4 and len(server.names("actions")) == 4
    else:
        assert done.err.count("the run goes on without it") == 1
        assert f"not uploaded: {', '.join(everything)}" in done.err and "`gsac cache push` does it later" in done.err
    server.trouble = lambda method, name: None
    assert two.gsac("cache", "push", "--force", two.out, **server.env).code == 0
    assert machine("three").ran(**server.env) == []


def test_a_server_that_is_gone_costs_a_run_a_sentence(server, machine, everything):
    env, toy, began = server.env | {"AWS_ENDPOINT_URL": "http://127.0.0.1:9"}, machine("one"), time.monotonic()
    assert toy.ran(**env) == everything and time.monotonic() - began < 30


@pytest.mark.slow
def test_a_server_that_never_answers_costs_a_run_a_bounded_time(server, machine, everything):
    server.trouble, server.slow_s = (lambda method, name: "slow"), 300.0
    toy, began = machine("one"), time.monotonic()
    assert toy.ran(**server.env) == everything and time.monotonic() - began < 90


def test_uploads_that_fail_are_said_once_and_can_be_pushed_later(server, machine, everything):
    one = machine("one")
    server.trouble = lambda method, name: "500" if method == "PUT" and "/objects/" in name else None
    done = one.run(**server.env)
    assert done.code == 0 and one.runs == everything and done.err.count("not uploaded: ") == 1
    assert server.names("actions") == [] and server.names("leases") == []
    server.trouble = lambda method, name: None
    pushed = one.gsac("cache", "push", "--json", **server.env)
    assert pushed.code == 0 and len(pushed.json["pushed"]) == 4 and pushed.json["failed"] == []
    assert one.gsac("cache", "push", one.out, "--json", **server.env).json["there"] == pushed.json["pushed"]
    two = machine("two")
    pulled = two.gsac("cache", "pull", "--json", **server.env)
    assert sorted(pulled.json["pulled"]) == sorted(pushed.json["pushed"]) and two.ran() == []


def test_two_machines_at_once_compute_each_stage_once_and_get_the_same(server, machine, everything):
    toys = [machine(name) for name in ("one", "two")]
    running = [toy.start("run", toy.clip, "--out", toy.out, "--set", "cut.pause_s=1", **server.env) for toy in toys]
    said = [process.communicate(timeout=60)[1] for process in running]
    assert [process.returncode for process in running] == [0, 0], said
    assert sorted(toys[0].runs + toys[1].runs) == sorted(everything)
    assert toys[0].result == toys[1].result and "another machine computes the same result" in "".join(said)


def test_a_stage_that_fails_gives_its_claim_back(server, machine):
    assert machine("one").run("--set", "left.trouble=stage", **server.env).code == 1
    assert server.names("leases") == [] and [name.split("/")[1] for name in server.names("actions")] == ["cut"]


def test_one_stage_by_itself_is_fetched_as_well(server, machine):
    one, two = machine("one"), machine("two")
    one.ran(**server.env)
    two.ran("--until", "cut")
    (two.out / "left").mkdir()
    two.runs_file.write_text("")
    assert two.gsac("stage", "left", cwd=two.out, **server.env).code == 0 and two.runs == []
    assert (two.out / "left" / "out.txt").read_text() == "ALPHA"


def test_a_forced_stage_is_computed_and_the_shared_result_stays(server, machine):
    one = machine("one")
    one.ran(**server.env)
    before = dict(server.objects)
    assert one.ran("--force", "left", **server.env) == ["left"] and server.objects == before


def test_status_and_dry_run_ask_nobody(server, machine):
    one = machine("one")
    one.run("--dry-run", **server.env)
    assert server.asked == []


@pytest.mark.parametrize("place, said", [
    ("s3://key:secret@bucket", "credentials belong into AWS_ACCESS_KEY_ID"), ("ftp://x", "expected s3://bucket/prefix"),
    ("file:///no/such/folder", "there is no such folder"),
])
def test_a_place_that_cannot_be_one_is_a_mistake_before_anything_runs(machine, place, said):
    if "no/such" in place:
        pytest.importorskip("obstore")
    toy = machine("one")
    done = toy.run(GSAC_REMOTE=place)
    assert done.code == 2 and said in done.err and "secret" not in done.err + done.out and toy.runs == []


def test_a_run_that_shares_nothing_loads_nothing_of_it(machine):
    toy = machine("one")
    code = ("import sys; from gsac.pipeline.cli import execute; "
            f"execute(['run', {str(toy.clip)!r}, '--out', {str(toy.out)!r}]); "
            "print([name for name in sys.modules if 'obstore' in name or 'gsac.cache.remote' in name])")
    done = subprocess.run([sys.executable, "-P", "-c", code], cwd=toy.root, env=toy.env, text=True, capture_output=True)
    assert done.stdout.splitlines()[-1] == "[]", done


def test_keys_can_be_named_by_their_beginning_and_what_is_none_is_named(server, machine):
    one = machine("one")
    one.ran()
    key = one.run("--dry-run").json["stages"][0]["key"]
    done = one.gsac("cache", "push", key[:12], "--json", **server.env)
    assert done.json["pushed"] == [f"cut/{key}"]
    done = one.gsac("cache", "push", "feed", **server.env)
    assert done.code == 2 and "neither the folder of a run nor a key" in done.err
    done = one.gsac("cache", "push")
    assert done.code == 2 and "GSAC_REMOTE is not set" in done.err


def test_old_results_are_swept_from_the_shared_place(server, machine):
    one = machine("one")
    one.ran(**server.env)
    server.age(3 * 86400)
    assert one.gsac("cache", "gc", "--remote", "--json", **server.env).json["records"] == []
    assert len(one.gsac("cache", "gc", "--remote", "--keep-days", "2", "--json", **server.env).json["records"]) == 4
    assert server.names("") == []
    done = one.gsac("cache", "gc", "--remote", "--max-size", "1G", **server.env)
    assert done.code == 2 and "--remote goes with --keep-days" in done.err
