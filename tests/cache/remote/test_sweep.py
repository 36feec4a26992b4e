"""What goes from the shared results, and what never does."""

import os

import pytest

from gsac.cache.remote.bucket import Bucket
from gsac.cache.remote.claim import claim_name
from gsac.cache.remote.results import Results
from gsac.cache.remote.sweep import sweep_remote

OLD = 2 * 86400.0


def test_objects_of_no_record_and_left_claims_go_and_what_a_record_names_stays(store, make, parts_of, shared, elsewhere, server):
    kept, lost = make(parts_of(word="kept")), make(parts_of(word="lost"), "other")
    results = shared()
    for record in (kept, lost):
        results.push(store, record)
    results.bucket.delete([f"actions/split/{lost.key}.json"])
    results.bucket.put(claim_name("0" * 64), b"{}")
    assert sweep_remote(results.bucket).objects == []  # they may be those of a result that is just being pushed
    server.age(OLD)
    before = server.names("")
    would = sweep_remote(results.bucket, dry_run=True)
    assert server.names("") == before
    report = sweep_remote(results.bucket)
    assert sorted(report.objects) == sorted(lost.outputs.values()) and report.claims == ["0" * 64] and report.records == []
    assert would.objects == report.objects and would.freed_bytes == report.freed_bytes > 0
    assert results.fetch(elsewhere()[0], "split", kept.key).outputs == kept.outputs
    assert results.fetch(elsewhere()[0], "split", lost.key) is None


def test_old_results_go_only_where_a_bound_is_given_and_damaged_records_go(store, make, parts_of, shared, server):
    one, two = make(parts_of(word="one")), make(parts_of(word="two"), "other")
    results = shared()
    results.push(store, one)
    server.age(30 * 86400.0)
    results.push(store, two)
    server.age(OLD)
    server.objects["prefix/actions/split/odd.json"] = (b"no record", server.objects[f"prefix/actions/split/{one.key}.json"][1])
    assert sweep_remote(results.bucket).records == ["split/odd"]
    report = sweep_remote(results.bucket, keep_days=10)
    assert report.records == [f"split/{one.key}"] and sorted(report.objects) == sorted(one.outputs.values())
    assert list(results.keys()) == [("split", two.key)]


@pytest.mark.parametrize("apart_s", [30 * 86400.0, -30 * 86400.0])
def test_a_clock_that_is_apart_makes_nothing_old(store, make, parts_of, shared, server, apart_s):
    server.clock_apart_s = apart_s
    results = shared()
    results.push(store, make(parts_of()))
    results.bucket.put("objects/00/" + "0" * 64 + "/000000", b"just being pushed")
    report = sweep_remote(results.bucket, keep_days=0)
    assert (report.records, report.objects) == ([], [])


def test_what_a_killed_writer_left_in_a_shared_folder_goes(store, make, parts_of, tmp_path):
    pytest.importorskip("obstore")
    (tmp_path / "shared").mkdir()
    results, record = Results(Bucket(f"file://{tmp_path / 'shared'}")), make(parts_of())
    results.push(store, record)
    left = tmp_path / "shared" / "objects" / "ab" / "part#1"
    left.parent.mkdir(exist_ok=True)
    left.write_bytes(b"half")
    assert sweep_remote(results.bucket).unfinished == [] and left.exists()
    os.utime(left, (1, 1))
    assert sweep_remote(results.bucket).unfinished == [str(left)] and not left.exists()
    assert list(results.keys()) == [("split", record.key)]
