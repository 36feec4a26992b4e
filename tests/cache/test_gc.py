import os

from gsac.cache import gc
from gsac.cache.gc import collect
from gsac.cache.lease import in_use
from gsac.cache.lock import if_free
from gsac.cache.verify import verify

DAY = 86400.0
USE = """
with in_use(store, [parts_of(fps=5).key]) as lease:
    lease.add(parts_of(fps=6).key)
    print("using", flush=True)
    sys.stdin.readline()
"""


def test_gc_never_removes_what_a_run_in_progress_needs(store, make, parts_of, unused, child):
    records = [make(parts_of(fps=fps), f"{fps}") for fps in (5, 6, 7)]
    for record in records:
        unused(record, 100 * DAY)
    run = child(USE)
    assert run.stdout.readline() == "using\n"
    report = collect(store, keep_days=0, max_bytes=0, grace_s=0)
    assert report.records == [f"split/{records[2].key}"]
    assert all(store.lookup(record.key, deep=True) for record in records[:2])
    assert not store.path(records[2], "clip.json").exists()
    run.kill()
    run.wait()
    for record in records[:2]:
        unused(record, 100 * DAY)
    assert len(collect(store, keep_days=1, grace_s=0).records) == 2
    assert list((store.root / "objects").glob("*/*")) == []


RUN_ON = """
for number in range(25):
    parts = parts_of(number=number % 5)
    with in_use(store) as lease:
        lease.add(parts.key)
        with single_flight(store, parts.key) as record:
            record = record or make(parts, f"text {number % 5}")
        time.sleep(0.002)
        assert store.lookup(parts.key, deep=True) is not None
        assert store.path(record, "frames").joinpath("000002.png").read_bytes() == f"text {number % 5} 2".encode() * 100
"""


def test_gc_beside_runs_at_full_speed_takes_nothing_from_them(store, child):
    runs = [child(RUN_ON) for _ in range(2)]
    removed = 0
    while any(run.poll() is None for run in runs):
        removed += len(collect(store, keep_days=0, grace_s=0).records)
    assert [run.returncode for run in runs] == [0, 0]
    assert removed > 0
    assert verify(store).sound


def test_what_was_used_just_now_stays_without_a_lease(store, make, parts_of):
    record = make(parts_of())
    assert collect(store, keep_days=0, max_bytes=0).records == []
    assert store.lookup(record.key, deep=True) == record


def test_results_not_used_for_long_go_and_a_hit_is_a_use(store, make, parts_of, unused):
    old, used, new = (make(parts_of(fps=fps), f"{fps}") for fps in (5, 6, 7))
    unused(old, 31 * DAY)
    unused(used, 31 * DAY)
    store.lookup(used.key)
    report = collect(store, keep_days=30)
    assert report.records == [f"split/{old.key}"]
    assert report.freed_bytes == old.bytes
    assert report.kept_bytes == used.bytes + new.bytes
    assert store.lookup(old.key) is None


def test_the_longest_unused_go_until_the_rest_fits_and_shared_objects_count_once(store, make, parts_of, unused):
    records = [make(parts_of(fps=fps), text) for fps, text in ((5, "aa"), (6, "bb"), (7, "bb"), (8, "cc"))]
    for number, record in enumerate(records):
        unused(record, (10 - number) * DAY)
    report = collect(store, max_bytes=2 * records[0].bytes)
    assert report.records == [f"split/{records[0].key}"]
    report = collect(store, max_bytes=2 * records[0].bytes - 1)
    assert set(report.records) == {f"split/{records[1].key}", f"split/{records[2].key}"}
    assert store.lookup(records[3].key, deep=True) is not None


def test_without_a_bound_only_rubbish_goes(store, make, parts_of, unused):
    record, lost = make(parts_of(fps=5), "kept"), make(parts_of(fps=6), "lost")
    store.record_path("split", lost.key).unlink()
    unused(record, 1000 * DAY)
    report = collect(store)
    assert report.records == []
    assert len(report.objects) == 2
    assert store.lookup(record.key, deep=True) == record


def test_gc_keeps_a_result_in_use_that_a_forced_run_has_replaced(store, make, parts_of, contents):
    first = make(parts_of(), "first")
    with in_use(store, [first.key]):
        forced = make(parts_of(), "forced", replace=True)
        collect(store, keep_days=0, max_bytes=0, grace_s=0)
        assert store.path(first, "clip.json").read_text() == "first"
        assert store.lookup(forced.key, deep=True) == forced
        assert verify(store).sound
    collect(store, keep_days=0, grace_s=0)
    assert list((store.root / "objects").glob("*/*")) == []


def test_folders_of_dead_runs_go_and_those_of_living_ones_stay(store, child):
    dead = child("folder = store.private('train'); folder.__enter__(); print('in', flush=True); time.sleep(60)")
    dead.stdout.readline()
    with store.private("train") as living:
        (living / "half").write_text("half")
        assert collect(store).temps == []
        dead.kill()
        dead.wait()
        assert len(collect(store).temps) == 2
        assert {path.name for path in (store.root / "tmp").iterdir()} == {living.name, f"{living.name}.lock"}
        assert (living / "half").read_text() == "half"


def test_gc_holds_what_it_takes_from_tmp_until_it_is_moved_so_that_nobody_can_claim_it(store, monkeypatch):
    (store.root / "tmp" / "train-1-abc.lock").touch()
    claims = []
    true = os.rename

    def rename(source, target):
        with if_free(source) as free:
            claims.append(free)
        true(source, target)

    monkeypatch.setattr(gc.os, "rename", rename)
    collect(store)
    assert claims == [False]
    assert list((store.root / "tmp").iterdir()) == []


def test_a_dry_run_tells_the_same_and_removes_nothing(store, make, parts_of, unused):
    record = make(parts_of())
    unused(record, 10 * DAY)
    told = collect(store, keep_days=1, dry_run=True)
    assert store.record_path("split", record.key).exists()
    assert store.path(record, "clip.json").exists()
    done = collect(store, keep_days=1)
    assert (told.records, told.objects, told.freed_bytes) == (done.records, done.objects, done.freed_bytes)
    assert len(done.records) == 1


def test_quarantine_is_kept_for_a_while_and_then_goes(store, make, parts_of, monkeypatch):
    record = make(parts_of())
    os.truncate(store.path(record, "clip.json"), 1)
    store.lookup(record.key)
    assert collect(store).quarantined == []
    monkeypatch.setattr(gc, "QUARANTINE_S", -1.0)
    assert len(collect(store).quarantined) == 1
    assert list((store.root / "quarantine").iterdir()) == []


def test_what_a_stopped_run_left_stays_a_day_for_the_next_and_then_goes(store, make, parts_of, monkeypatch):
    waiting, done = parts_of(fps=5), make(parts_of(fps=6))
    for key in (waiting.key, done.key):
        store.partial(key).mkdir()
        (store.partial(key) / "half").write_text("half")
    assert collect(store).partial == [done.key], "who is done needs it no more"
    monkeypatch.setattr(gc, "PARTIAL_S", -1.0)
    with in_use(store, [waiting.key]):
        assert collect(store).partial == []
    report = collect(store)
    assert report.partial == [waiting.key] and report.freed_bytes == 4
    assert list((store.root / "partial").iterdir()) == []


def test_models_are_never_collected(store):
    (store.root / "models" / "abc").mkdir()
    (store.root / "models" / "abc" / "pose.tflite").write_text("weights")
    with in_use(store):
        collect(store, keep_days=0, max_bytes=0, grace_s=0)
    assert (store.root / "models" / "abc" / "pose.tflite").exists()


HALF = """
with in_use(store, ["k" * 64]), single_flight(store, "l" * 64), store.private("split") as folder:
    (folder / "half.txt").write_text("half")
    print("half", flush=True)
    sys.stdin.readline()
"""


def test_the_next_start_removes_what_a_killed_run_left_and_nothing_of_a_living_one(store, child):
    living, killed = child(HALF), child(HALF.replace('"l"', '"m"'))
    for run in (living, killed):
        assert run.stdout.readline() == "half\n"
    killed.kill()
    killed.wait()
    gc.sweep_store(store)
    assert len(list((store.root / "tmp").glob("*/half.txt"))) == 1
    assert {file.suffix for file in (store.root / "leases").iterdir()} == {".run", ".lock"}
    assert len(list((store.root / "leases").iterdir())) == 2
    living.communicate("\n")
    gc.sweep_store(store)
    assert [*(store.root / "tmp").iterdir(), *(store.root / "leases").iterdir()] == []


def test_the_next_start_removes_partial_work_that_no_run_will_take_up(store, make, parts_of, monkeypatch):
    record = make(parts_of(fps=5))
    for key in (record.key, "a" * 64, "b" * 64):
        store.partial(key).mkdir()
    with in_use(store, ["b" * 64]):
        gc.sweep_store(store)
        assert {path.name for path in (store.root / "partial").iterdir()} == {"a" * 64, "b" * 64}
        monkeypatch.setattr(gc, "PARTIAL_S", -1.0)
        gc.sweep_store(store)
        assert {path.name for path in (store.root / "partial").iterdir()} == {"b" * 64}


def test_gc_spares_an_object_that_is_read_by_name(store, make, parts_of, unused):
    record = make(parts_of())
    unused(record, 100 * DAY)
    with in_use(store, [store.path(record, "frames").name]):
        assert collect(store, keep_days=0, grace_s=0, force=True).in_use == [f"split/{record.key}"]
    assert collect(store, keep_days=0, grace_s=0).records == [f"split/{record.key}"]


def test_a_lock_that_was_made_anew_meanwhile_is_not_taken_for_free(tmp_path, monkeypatch):
    path = tmp_path / "key.lock"
    path.touch()
    opened = os.open

    def open_late(name, flags, *more):
        descriptor = opened(name, flags, *more)
        path.unlink()
        os.close(opened(path, os.O_CREAT | os.O_WRONLY))
        return descriptor

    monkeypatch.setattr(os, "open", open_late)
    with if_free(path) as free:
        assert free is False
