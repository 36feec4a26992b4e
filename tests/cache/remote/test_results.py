"""Results of one machine on another: whole or not at all, whatever the server does."""

import json
import threading
import time

import pytest

from gsac.cache.digest import canonical, typed_digest
from gsac.cache.errors import CacheSetupError, IntegrityError
from gsac.cache.record import Footprint, Record, RunInfo
from gsac.cache.remote import pack
from gsac.cache.remote.bucket import Bucket, RemoteError
from gsac.cache.remote.results import Pushed, Results
from gsac.cache.verify import verify
from support.s3 import SECRET


def test_a_result_comes_to_another_machine_as_it_was_with_its_figures(store, make, parts_of, shared, elsewhere, contents):
    record = make(parts_of())
    assert shared().push(store, record) is Pushed.NEW
    other, said = elsewhere()
    fetched = shared().fetch(other, "split", record.key, ("frames", "clip.json"))
    assert fetched.outputs == record.outputs and fetched.info == record.info
    assert contents(other.path(fetched, "frames")) == contents(store.path(record, "frames"))
    assert other.lookup(record.key, deep=True) == fetched and verify(other).sound and said == []


def test_a_folder_that_all_see_serves_as_well_as_a_bucket(store, make, parts_of, elsewhere, tmp_path):
    pytest.importorskip("obstore")
    (tmp_path / "shared").mkdir()
    results, record = Results(Bucket(f"file://{tmp_path / 'shared'}")), make(parts_of())
    assert [results.push(store, record) for _ in range(2)] == [Pushed.NEW, Pushed.THERE]
    assert list(results.keys()) == [("split", record.key)]
    assert results.fetch(elsewhere()[0], "split", record.key).outputs == record.outputs
    assert results.fetch(elsewhere()[0], "split", "0" * 64) is None


def test_a_folder_goes_as_one_pack(store, make, parts_of, shared, server):
    shared().push(store, make(parts_of()))
    assert len(server.names("objects")) == 2 and len(server.names("actions")) == 1


def test_of_eight_machines_that_push_one_key_exactly_one_wins_and_all_read_the_same(parts_of, make, shared, elsewhere, server):
    stores = [elsewhere(f"host{number}")[0] for number in range(8)]
    records = [make(parts_of(), f"result of host {number}", store=store) for number, store in enumerate(stores)]
    start, won = threading.Barrier(8), [None] * 8

    def push(number):
        results = shared()
        start.wait()
        won[number] = results.push(stores[number], records[number])

    threads = [threading.Thread(target=push, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert won.count(Pushed.NEW) == 1 and won.count(Pushed.THERE) == 7
    winner = records[won.index(Pushed.NEW)]
    readers = [elsewhere(f"reader{number}")[0] for number in range(8)]
    assert [shared().fetch(reader, "split", winner.key).outputs for reader in readers] == [winner.outputs] * 8


def test_a_push_that_was_cut_goes_on_where_it_stopped(store, make, parts_of, shared, elsewhere, server, monkeypatch):
    monkeypatch.setattr(pack, "PART", 1000)
    record = make(parts_of(), "a long result " * 10)
    puts = []

    def fail_at_the_third(method, name):
        puts.extend([name] if method == "PUT" else [])
        return "cut" if method == "PUT" and len(set(puts)) > 2 else None

    server.trouble = fail_at_the_third
    with pytest.raises(RemoteError):
        shared().push(store, record)
    server.trouble = lambda method, name: None
    assert server.names("actions") == [] and shared().fetch(elsewhere()[0], "split", record.key) is None
    assert shared().push(store, record) is Pushed.NEW
    assert shared().fetch(elsewhere()[0], "split", record.key).outputs == record.outputs


def test_an_answer_that_is_lost_after_the_record_was_put_loses_nothing(store, make, parts_of, shared, elsewhere, server):
    record, lost = make(parts_of()), []

    def lose_each_first_answer(method, name):
        if method == "PUT" and name not in lost:
            lost.append(name)
            return "lost"
        return None

    server.trouble = lose_each_first_answer
    shared().push(store, record)
    assert shared().fetch(elsewhere()[0], "split", record.key).outputs == record.outputs


@pytest.mark.parametrize("what", ["500", "403", "cut", "spoil"])
@pytest.mark.parametrize("where", ["actions", "objects"])
def test_a_server_that_fails_cuts_or_spoils_gives_no_wrong_result(store, make, parts_of, shared, elsewhere, server, what, where):
    record = make(parts_of())
    shared().push(store, record)
    other, said = elsewhere()
    server.trouble = lambda method, name: what if method == "GET" and f"/{where}/" in name else None
    results = shared()
    if what == "spoil":
        assert results.fetch(other, "split", record.key) is None
        assert len(said) == 1 and f"{record.key[:12]} in s3://bucket/prefix is not used" in said[0]
    else:
        with pytest.raises(RemoteError, match=r"s3://bucket/prefix (failed|does not allow)") as error:
            results.fetch(other, "split", record.key)
        assert SECRET not in str(error.value) and "AKIA" not in str(error.value)
    assert other.lookup(record.key) is None and verify(other).sound and list((other.root / "tmp").iterdir()) == []
    server.trouble = lambda method, name: None
    assert shared().fetch(other, "split", record.key).outputs == record.outputs


def damage(server, table, change):
    for name, (data, at) in list(server.objects.items()):
        if f"/{table}/" in name:
            server.objects[name] = (change(data), at)


@pytest.mark.parametrize("change", [
    lambda data: data[:-1], lambda data: b"", lambda data: data + b"x", lambda data: data[:40] + b"X" + data[41:],
], ids=["truncated", "emptied", "longer", "other"])
@pytest.mark.parametrize("table", ["actions", "objects"])
def test_what_is_damaged_there_is_not_used_and_is_written_over_by_who_found_it(
        store, make, parts_of, shared, elsewhere, server, table, change):
    record = make(parts_of())
    shared().push(store, record)
    damage(server, table, change)
    other, said = elsewhere()
    results = shared()
    assert results.fetch(other, "split", record.key) is None and len(said) == 1
    again = make(parts_of(), "computed here", store=other)
    assert results.push(other, again) is Pushed.NEW
    assert shared().fetch(elsewhere("third")[0], "split", record.key).outputs == again.outputs


def test_a_missing_part_is_a_result_that_is_not_used(store, make, parts_of, shared, elsewhere, server, monkeypatch):
    monkeypatch.setattr(pack, "PART", 1000)
    record = make(parts_of(), "a long result " * 10)
    shared().push(store, record)
    del server.objects[next(name for name in sorted(server.objects) if name.endswith("/000001"))]
    other, said = elsewhere()
    assert shared().fetch(other, "split", record.key) is None and "ends too early" in said[0]


def test_a_record_under_another_key_or_of_other_outputs_is_not_believed(store, make, parts_of, shared, elsewhere, server):
    one, two = make(parts_of(word="one")), make(parts_of(word="two"), "other")
    for record in (one, two):
        shared().push(store, record)
    first, second = (f"prefix/actions/split/{record.key}.json" for record in (one, two))
    server.objects[first] = server.objects[second]
    other, said = elsewhere()
    assert shared().fetch(other, "split", one.key) is None and "another's" in said[0]
    assert shared().fetch(other, "split", two.key, ("frames",)) is None


@pytest.mark.parametrize("name", ["../../evil", "frames/../../evil"])
def test_a_hostile_record_and_pack_that_agree_write_nothing_outside_of_it(parts_of, shared, elsewhere, server, name):
    parts, text = parts_of(), canonical({name: ["e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855", 0]})
    digest = typed_digest("tree 1", text)
    record = Record(parts.key, parts, {"frames": digest}, RunInfo(), {"frames": Footprint(1, 0, "")})
    server.objects[f"prefix/actions/split/{parts.key}.json"] = (record.to_json().encode(), time.time())
    server.objects[f"prefix/objects/{digest[:2]}/{digest}/000000"] = (pack.HEAD % len(text) + text, time.time())
    other, said = elsewhere()
    before = sorted(other.root.parent.rglob("*"))
    assert shared().fetch(other, "split", parts.key) is None and len(said) == 1
    assert sorted(other.root.parent.rglob("*")) == before


def test_a_record_that_names_more_bytes_than_the_disk_has_is_not_fetched(parts_of, shared, elsewhere, server):
    from gsac.cache.errors import CacheFullError

    parts = parts_of()
    for sizes, error in (((1 << 60,), CacheFullError), ((1 << 60, -(1 << 60)), None)):
        names = ("frames", "more")[: len(sizes)]
        record = Record(parts.key, parts, dict.fromkeys(names, "0" * 64), RunInfo(),
                        {name: Footprint(1, size, "") for name, size in zip(names, sizes, strict=True)})
        server.objects[f"prefix/actions/split/{parts.key}.json"] = (record.to_json().encode(), time.time())
        if error is None:
            assert shared().fetch(elsewhere()[0], "split", parts.key) is None
        else:
            with pytest.raises(error, match="shared result of"):
                shared().fetch(elsewhere()[0], "split", parts.key)
    assert not [name for _, name in server.asked if "/objects/" in name]


def test_a_record_larger_than_any_is_not_read(parts_of, shared, elsewhere, server, monkeypatch):
    from gsac.cache.remote import results

    monkeypatch.setattr(results, "LARGEST", 100)
    server.objects[f"prefix/actions/split/{parts_of().key}.json"] = (b"x" * 101, time.time())
    with pytest.raises(RemoteError, match="expected at most 100"):
        shared().fetch(elsewhere()[0], "split", parts_of().key)


def test_a_damaged_object_here_is_not_pushed(store, make, parts_of, shared, server):
    record = make(parts_of())
    file = store.path(record, "clip.json")
    file.chmod(0o644)
    file.write_text("resulx")
    with pytest.raises(IntegrityError, match="damaged"):
        shared().push(store, record)
    assert server.names("actions") == []


@pytest.mark.parametrize("url, said", [
    ("s3://key:secret@bucket/prefix", "credentials belong into AWS_ACCESS_KEY_ID"), ("s3://bucket?secret=x", "credentials belong"),
    ("https://bucket", "expected s3://bucket/prefix or file:///folder"), ("bucket", "expected s3"), ("s3://", "expected s3"),
    ("file:///no/such/folder", "no such folder"), ("file://relative", "expected s3"),
])
def test_a_place_that_cannot_be_one_is_named_and_no_secret_of_it(url, said):
    if "no/such" in url:
        pytest.importorskip("obstore")
    with pytest.raises(CacheSetupError, match=said) as error:
        Bucket(url)
    assert "secret" not in str(error.value)


def test_without_obstore_the_line_that_installs_it_is_said(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "obstore.store", None)
    with pytest.raises(CacheSetupError, match=r"pip install 'gsac\[s3\]'"):
        Bucket("s3://bucket")


def test_a_server_that_is_down_or_does_not_answer_is_given_up_soon(parts_of, shared, elsewhere, server):
    results = shared()
    server.trouble = lambda method, name: "slow"
    began = time.monotonic()
    with pytest.raises(RemoteError, match="no connection, or no answer in time"):
        results.fetch(elsewhere()[0], "split", parts_of().key)
    assert time.monotonic() - began < 5


def test_the_record_there_is_the_text_of_the_record_here(store, make, parts_of, shared, server):
    record = make(parts_of())
    shared().push(store, record)
    text = server.objects[f"prefix/actions/split/{record.key}.json"][0].decode()
    assert text == store.record_path("split", record.key).read_text() and json.loads(text)["key"] == record.key
