"""Runs of several machines over one shared place, and what a run does where that place fails."""

import subprocess
import sys
import threading
import time

import pytest

from support.s3 import SECRET, serving
from support.toy import Toy


@pytest.fixture
def server():
    pytest.importorskip("obstore")
    with serving() as held:
        yield held


@pytest.fixture(scope="module")
def computed(tmp_path_factory):
    """What one machine has computed and uploaded: name -> content, and the last result."""
    pytest.importorskip("obstore")
    toy = Toy(tmp_path_factory.mktemp("first"))
    with serving() as held:
        toy.ran(**held.env)
        assert held.names("leases") == [] and len(held.names("actions")) == 4
        return held.objects, toy.result


@pytest.fixture
def filled(server, computed):
    """The server with that."""
    server.objects.update(computed[0])
    return server


@pytest.fixture
def machine(tmp_path):
    """machine(name): a toy project with a cache of its own; the same clip everywhere."""

    def make(name: str) -> Toy:
        (tmp_path / name).mkdir()
        return Toy(tmp_path / name)

    return make


def test_what_one_machine_computed_another_fetches_and_places(filled, computed, machine, everything):
    toy = machine("two")
    done = toy.run(**filled.env)
    assert toy.runs == [] and done.statuses == dict.fromkeys(everything, "cached")
    assert "cut: fetched from s3://bucket/prefix" in done.err and toy.result == computed[1]
    asked = len(filled.asked)
    assert toy.ran(**filled.env) == [] and len(filled.asked) == asked  # all is here: nobody is asked


def test_a_changed_parameter_fetches_what_is_above_and_computes_what_is_below(filled, machine):
    assert machine("two").ran("--set", "left.word=last", **filled.env) == ["left", "join"]


def test_a_damaged_object_here_is_fetched_again_instead_of_computed(filled, machine):
    toy = machine("one")
    toy.ran("--until", "left", **filled.env)
    damaged = (toy.out / "left" / "out.txt").resolve()
    damaged.chmod(0o644)
    damaged.write_text("DAMAGED")
    assert toy.ran("--until", "left", **filled.env) == [] and (toy.out / "left" / "out.txt").read_text() == "ALPHA"


@pytest.mark.parametrize("what", ["500", "spoil", *(pytest.param(what, marks=pytest.mark.slow) for what in ("403", "cut"))])
def test_a_shared_place_that_fails_never_fails_a_run_nor_gives_it_a_wrong_result(
        filled, computed, machine, everything, what, inside):
    toy = machine("two")
    filled.trouble = lambda method, name: what if "/leases/" not in name else None
    done = toy.run(**filled.env)
    assert done.code == 0 and toy.runs == everything and toy.result == computed[1]
    assert SECRET not in done.err + done.out and "AKIA" not in done.err + done.out
    if what == "spoil":
        assert done.err.count("is not used: ") == 4 and len(filled.names("actions")) == 4
    else:
        assert done.err.count("the run goes on without it") == 1
        assert f"not uploaded: {', '.join(everything)}" in done.err and "`gsac cache push` does it later" in done.err
    filled.trouble = lambda method, name: None
    assert inside(toy, "cache", "push", "--force", toy.out, **filled.env).code == 0
    assert len(inside(machine("three"), "cache", "pull", "--json", **filled.env).json["pulled"]) == 4


def test_a_server_that_is_gone_costs_a_run_a_sentence(server, machine):
    env, toy, began = server.env | {"AWS_ENDPOINT_URL": "http://127.0.0.1:9"}, machine("one"), time.monotonic()
    done = toy.run("--until", "cut", **env)
    assert done.statuses == {"cut": "ran"} and done.err.count("the run goes on without it") == 1
    assert time.monotonic() - began < 30


@pytest.mark.slow
def test_a_server_that_never_answers_costs_a_run_a_bounded_time(server, machine, everything):
    server.trouble, server.slow_s = (lambda method, name: "slow"), 300.0
    toy, began = machine("one"), time.monotonic()
    assert toy.ran(**server.env) == everything and time.monotonic() - began < 90


def test_uploads_that_fail_are_said_once_and_can_be_pushed_later(server, machine, everything, inside):
    one = machine("one")
    server.trouble = lambda method, name: "500" if method == "PUT" and "/objects/" in name else None
    done = one.run(**server.env)
    assert done.code == 0 and one.runs == everything and done.err.count("not uploaded: ") == 1
    assert server.names("actions") == [] and server.names("leases") == []
    server.trouble = lambda method, name: None
    pushed = inside(one, "cache", "push", "--json", **server.env)
    assert pushed.code == 0 and len(pushed.json["pushed"]) == 4 and pushed.json["failed"] == []
    assert inside(one, "cache", "push", one.out, "--json", **server.env).json["there"] == pushed.json["pushed"]
    pulled = inside(machine("two"), "cache", "pull", "--json", **server.env)
    assert sorted(pulled.json["pulled"]) == sorted(pushed.json["pushed"])


@pytest.mark.slow
@pytest.mark.parametrize("request_number", [1, 2, 4, 6, 9, 12, 16, 20])
def test_sigkill_while_a_run_uploads_or_fetches_leaves_nothing_torn_here_nor_there(server, computed, machine, request_number):
    for name in ("uploads", "fetches"):
        toy, reached, ends = machine(name), threading.Event(), len(server.asked) + request_number

        def hold(method, name, ends=ends, reached=reached):
            if len(server.asked) + 1 >= ends:
                reached.set()
                server.stopping.wait(0.3)

        server.trouble = hold
        process = toy.start("run", toy.clip, "--out", toy.out, **server.env)
        while not reached.wait(0.05) and process.poll() is None:
            pass
        process.kill()
        process.communicate()
        server.trouble = lambda method, name: None
        server.settle()
        server.objects = {name: there for name, there in server.objects.items() if "/leases/" not in name}  # they would expire
        assert toy.run(**server.env).code == 0 and toy.result == computed[1]
        assert toy.gsac("cache", "verify").code == 0
    third = machine("third")
    assert third.run(**server.env).code == 0 and third.result == computed[1]


def test_two_machines_at_once_compute_each_stage_once_and_get_the_same(server, machine, everything):
    toys = [machine(name) for name in ("one", "two")]
    running = [toy.start("run", toy.clip, "--out", toy.out, "--set", "cut.pause_s=1", **server.env) for toy in toys]
    said = [process.communicate(timeout=60)[1] for process in running]
    assert [process.returncode for process in running] == [0, 0], said
    assert sorted(toys[0].runs + toys[1].runs) == sorted(everything)
    assert toys[0].result == toys[1].result and "another machine computes the same result" in "".join(said)


def test_a_run_that_waits_for_another_one_here_says_so(server, machine):
    toy = machine("one")
    running = [toy.start("run", toy.clip, "--out", toy.root / out, "--set", "cut.pause_s=2", **server.env) for out in "ab"]
    said = [process.communicate(timeout=60)[1] for process in running]
    assert "another run computes the same result; waiting for it" in "".join(said) and len(toy.runs) == 4


def test_a_stage_that_fails_gives_its_claim_back(server, machine):
    assert machine("one").run("--set", "left.trouble=stage", **server.env).code == 1
    assert server.names("leases") == [] and [name.split("/")[1] for name in server.names("actions")] == ["cut"]


def test_one_stage_by_itself_is_fetched_as_well(filled, machine, inside):
    toy = machine("two")
    toy.ran("--until", "cut", **filled.env)
    done = inside(toy, "stage", "left", "--inputs", toy.out, "--out", toy.root / "left", **filled.env)
    assert done.code == 0 and toy.runs == [] and (toy.root / "left" / "out.txt").read_text() == "ALPHA"


def test_a_forced_stage_is_computed_and_the_shared_result_stays(filled, machine):
    before = dict(filled.objects)
    assert machine("two").ran("--until", "left", "--force", "left", **filled.env) == ["left"] and filled.objects == before


def test_status_and_dry_run_ask_nobody(server, machine):
    machine("one").run("--dry-run", **server.env)
    assert server.asked == []


@pytest.mark.parametrize("place, said", [
    ("s3://key:secret@bucket", "credentials belong into AWS_ACCESS_KEY_ID"), ("ftp://x", "expected s3://bucket/prefix"),
    ("file:///no/such/folder", "there is no such folder"),
])
def test_a_place_that_cannot_be_one_is_a_mistake_before_anything_runs(machine, inside, place, said):
    if "no/such" in place:
        pytest.importorskip("obstore")
    toy = machine("one")
    done = inside(toy, "run", toy.clip, "--out", toy.out, GSAC_REMOTE=place)
    assert done.code == 2 and said in done.err and "secret" not in done.err + done.out and toy.runs == []


def test_a_run_that_shares_nothing_loads_nothing_of_it(machine):
    toy = machine("one")
    code = ("import sys; from gsac.pipeline.cli import execute; "
            f"execute(['run', {str(toy.clip)!r}, '--out', {str(toy.out)!r}, '--until', 'cut']); "
            "print([name for name in sys.modules if 'obstore' in name or 'gsac.cache.remote' in name])")
    done = subprocess.run([sys.executable, "-P", "-c", code], cwd=toy.root, env=toy.env, text=True, capture_output=True)
    assert done.stdout.splitlines()[-1] == "[]", done


def test_keys_can_be_named_by_their_beginning_and_what_is_none_is_named(filled, machine, inside):
    toy = machine("two")
    key = filled.names("actions")[0].removesuffix(".json").rpartition("/")[2]
    assert inside(toy, "cache", "pull", key[:12], "--json", **filled.env).json["pulled"] == [f"cut/{key}"]
    assert inside(toy, "cache", "push", key[:12], "--json", **filled.env).json["there"] == [f"cut/{key}"]
    done = inside(toy, "cache", "push", "feed", **filled.env)
    assert done.code == 2 and "neither the folder of a run nor a key" in done.err
    done = inside(toy, "cache", "push")
    assert done.code == 2 and "GSAC_REMOTE is not set" in done.err


def test_old_results_are_swept_from_the_shared_place(filled, machine, inside):
    toy = machine("two")
    filled.age(3 * 86400)
    assert inside(toy, "cache", "gc", "--remote", "--json", **filled.env).json["records"] == []
    assert len(inside(toy, "cache", "gc", "--remote", "--keep-days", "2", "--json", **filled.env).json["records"]) == 4
    assert filled.names("") == []
    done = inside(toy, "cache", "gc", "--remote", "--max-size", "1G", **filled.env)
    assert done.code == 2 and "--remote goes with --keep-days" in done.err
