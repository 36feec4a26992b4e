import os

from gsac.cache.verify import verify


def test_a_sound_store_verifies_and_counts_its_bytes(store, make, parts_of):
    record = make(parts_of())
    report = verify(store)
    assert report.sound
    assert (report.objects, report.bytes) == (2, record.bytes)


def test_verify_names_what_is_damaged_and_drops_every_result_that_used_it(store, make, parts_of):
    first, second, other = make(parts_of(fps=5)), make(parts_of(fps=6)), make(parts_of(fps=7), "other")
    file = store.path(first, "clip.json")
    stat = file.stat()
    file.chmod(0o644)
    file.write_bytes(b"RESULT")
    os.utime(file, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    report = verify(store)
    assert report.damaged == [file.name]
    assert report.lost == sorted(f"split/{record.key}" for record in (first, second))
    assert not report.sound
    assert verify(store).sound
    assert store.lookup(first.key) is None
    assert store.lookup(other.key) == other


def test_verify_drops_a_record_that_is_not_whole(store, make, parts_of):
    record = make(parts_of())
    store.record_path("split", record.key).write_text("{")
    assert verify(store).lost == [f"split/{record.key}"]
    assert not store.record_path("split", record.key).exists()
