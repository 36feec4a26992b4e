import hashlib
import os
from dataclasses import replace

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


def test_verify_drops_what_was_made_of_a_damaged_result_and_keeps_what_is_right_for_its_own_inputs(store, make, parts_of):
    first = make(parts_of("split"), "frames")
    child, other = (make(replace(parts_of("train", seed=seed), inputs={"split/frames": digest}), f"avatar {seed}")
                    for seed, digest in enumerate((first.outputs["frames"], "d" * 64)))
    grandchild = make(replace(parts_of("export"), inputs={"train/clip.json": child.outputs["clip.json"]}), "files")
    file = store.path(first, "frames") / "000001.png"
    file.chmod(0o644)
    file.write_bytes(file.read_bytes()[::-1])
    report = verify(store)
    assert (report.lost, report.derived) == ([f"split/{first.key}"], [f"train/{child.key}"]) and not report.sound
    assert [store.lookup(record.key) for record in (child, other, grandchild)] == [None, other, grandchild]
    assert verify(store).sound


def test_verify_looks_into_records_and_model_files(store, make, parts_of):
    metrics, foreign, kept = (make(parts_of(number=number), str(number)) for number in range(3))
    for record, old, new in ((metrics, "12.5", "99.9"), (foreign, "clip.json", "clap.json")):
        file = store.record_path("split", record.key)
        file.chmod(0o644)
        file.write_text(file.read_text().replace(old, new))
    content = hashlib.sha256(b"weights").hexdigest()
    for name, data in (("net", b"weights"), ("other", b"weighty")):
        (store.root / "models" / content).mkdir(exist_ok=True)
        (store.root / "models" / content / name).write_bytes(data)
    report = verify(store)
    assert report.lost == sorted(f"split/{record.key}" for record in (metrics, foreign))
    assert (report.models, report.damaged_models) == (2, ["other"])
    assert [path.name.split(".")[0] for path in (store.root / "quarantine").iterdir()] == ["other"]
    assert verify(store).sound and store.lookup(kept.key) == kept


def test_verify_holds_records_against_the_outputs_that_are_declared(store, make, parts_of):
    record, unknown = make(parts_of()), make(parts_of("other"))
    declared = {"split": ("clip.json", "frames")}
    assert verify(store, lambda parts: declared.get(parts.stage)).sound
    declared["split"] = ("clip.json", "frames", "metrics.json")
    assert verify(store, lambda parts: declared.get(parts.stage)).lost == [f"split/{record.key}"]
    assert store.lookup(unknown.key) == unknown
