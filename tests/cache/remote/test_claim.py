"""One machine computes a key, the others wait; a lost race costs work and nothing else."""

import threading
import time

import pytest

from gsac.cache.remote import claim as claim_module
from gsac.cache.remote.bucket import Bucket
from gsac.cache.remote.claim import Claim, claim_name, claim_or_fetch

KEY = "ab" * 32


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    for name, seconds in (("EXPIRES_S", 0.4), ("BEAT_S", 0.1), ("POLL_S", 0.02)):
        monkeypatch.setattr(claim_module, name, seconds)


def test_of_eight_machines_one_computes_and_the_others_get_its_result(shared, elsewhere, make, parts_of, server):
    computed, outputs, start = [], [None] * 8, threading.Barrier(8)

    def work(number):
        store, results, key = elsewhere(f"host{number}")[0], shared(), parts_of().key
        start.wait()
        found = claim_or_fetch(results.bucket, key, lambda: results.fetch(store, "split", key))
        if isinstance(found, Claim):
            computed.append(number)
            time.sleep(0.1)
            record = make(parts_of(), f"result of {number}", store=store)
            results.push(store, record)
            found.release()
            found = record
        outputs[number] = found.outputs

    threads = [threading.Thread(target=work, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(computed) == 1 and outputs == [outputs[0]] * 8 and None not in outputs
    assert server.names("leases") == []


def abandoned(bucket: Bucket, key: str = KEY) -> None:
    """The claim of a machine that has died."""
    bucket.put_new(claim_name(key), b'{"owner": "host 1 dead", "beats": 3, "expires_s": 120}')


@pytest.mark.parametrize("apart_s", [0.0, 7200.0, -7200.0])
def test_the_claim_of_a_machine_that_died_is_taken_over_however_far_the_clocks_are_apart(shared, server, apart_s):
    server.clock_apart_s = apart_s
    bucket, told = shared().bucket, []
    abandoned(bucket)
    began = time.monotonic()
    found = claim_or_fetch(bucket, KEY, lambda: None, lambda: told.append("waits"))
    assert isinstance(found, Claim) and told == ["waits"] and 0.3 < time.monotonic() - began < 10
    found.release()
    assert server.names("leases") == []


def test_the_claim_of_a_dead_machine_in_a_shared_folder_is_taken_over(tmp_path):
    pytest.importorskip("obstore")
    bucket = Bucket(f"file://{tmp_path}")
    abandoned(bucket)
    found = claim_or_fetch(bucket, KEY, lambda: None)
    assert isinstance(found, Claim)
    found.release()
    assert not list(tmp_path.rglob("*.json"))


def test_a_claim_whose_owner_lives_is_not_taken_over_and_one_that_waits_too_long_computes_by_itself(shared, monkeypatch):
    monkeypatch.setattr(claim_module, "LONGEST_WAIT_S", 1.0)
    mine = claim_or_fetch(shared().bucket, KEY, lambda: None)
    began = time.monotonic()
    assert isinstance(mine, Claim) and claim_or_fetch(shared().bucket, KEY, lambda: None) is None
    assert time.monotonic() - began >= 1.0
    mine.release()


def test_a_claim_that_another_has_taken_over_is_left_to_it(shared, server):
    mine = claim_or_fetch(shared().bucket, KEY, lambda: None)
    assert isinstance(mine, Claim)
    shared().bucket.put(claim_name(KEY), b'{"owner": "another"}')
    mine.release()
    assert server.names("leases") == [claim_name(KEY)]


def test_a_claim_whose_answer_is_lost_is_still_ones_own(shared, server):
    server.trouble = lambda method, name: "lost" if method == "PUT" and len(server.asked) < 2 else None
    found = claim_or_fetch(shared().bucket, KEY, lambda: None)
    assert isinstance(found, Claim)
    found.release()


def test_a_result_that_came_while_the_claim_was_taken_is_used(shared, server):
    answers = iter([None, "record"])
    assert claim_or_fetch(shared().bucket, KEY, lambda: next(answers)) == "record"
    assert server.names("leases") == []


def test_nonsense_in_place_of_a_claim_expires(shared):
    shared().bucket.put(claim_name(KEY), b"\xff[[[")
    found = claim_or_fetch(shared().bucket, KEY, lambda: None)
    assert isinstance(found, Claim)
    found.release()
