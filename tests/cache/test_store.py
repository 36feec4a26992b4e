import errno
import os
import subprocess
import sys
from dataclasses import replace

import pytest

from gsac.cache import objects
from gsac.cache.errors import CacheError, IntegrityError
from gsac.cache.listing import ls
from gsac.cache.publish import publish
from gsac.cache.record import RunInfo
from gsac.cache.store import Store
from gsac.cache.verify import verify
from support.poison import hide_damage


def test_a_published_result_is_found_again_with_all_its_content(store, make, parts_of, contents):
    record = make(parts_of(fps=5), "hello")
    found = Store(store.root).lookup(parts_of(fps=5).key)
    assert found == record
    assert contents(store.path(found, "clip.json")) == {"": b"hello"}
    assert contents(store.path(found, "frames")) == {
        **{f"00000{n}.png": f"hello {n}".encode() * 100 for n in range(3)},
        "inner/plate.png": b"hello",
    }


def test_a_key_that_nobody_published_is_a_miss(store, make, parts_of):
    make(parts_of(fps=5))
    assert store.lookup(parts_of(fps=6).key) is None


def test_an_output_keeps_the_suffix_of_its_name(store, make, parts_of):
    record = make(parts_of())
    assert store.path(record, "clip.json").suffix == ".json"
    assert store.path(record, "frames").is_dir()


def test_a_cached_stage_reports_the_time_and_memory_of_the_run_that_made_it(store, fill, parts_of):
    info = RunInfo("2026-01-02T03:04:05Z", 61.5, 118.0, 940.0, "cpu", {"psnr_fg": 25.5}, timings={"seconds": 60.1},
                   warnings=["hand 3 not seen"], log_tail="done\n")
    with store.private("train") as folder:
        publish(store, parts_of("train"), folder, fill(folder), info)
    assert Store(store.root).lookup(parts_of("train").key).info == info


def test_an_equal_output_of_another_key_is_stored_once(store, make, parts_of):
    first, second = make(parts_of(fps=5)), make(parts_of(fps=6))
    assert first.key != second.key
    assert first.outputs == second.outputs
    assert len(list((store.root / "objects").glob("*/*"))) == 2
    assert len(ls(store)) == 2


def test_what_is_in_the_store_is_read_only(store, make, parts_of):
    frames = store.path(make(parts_of()), "frames")
    assert {oct(path.stat().st_mode & 0o222) for path in (frames, *frames.rglob("*"))} == {"0o0"}


def test_a_private_folder_is_gone_at_the_end_whatever_happened(store):
    with pytest.raises(KeyboardInterrupt), store.private("train") as folder:
        (folder / "half").write_text("half")
        raise KeyboardInterrupt
    assert list((store.root / "tmp").iterdir()) == []


def test_the_first_of_two_results_of_one_key_stays_and_a_forced_one_replaces_it(store, make, parts_of):
    first = make(parts_of(), "first")
    assert make(parts_of(), "second") == first == store.lookup(first.key)
    forced = make(parts_of(), "third", replace=True)
    assert store.lookup(first.key) == forced != first


def test_an_output_that_was_not_written_or_is_a_link_is_not_published(store, fill, parts_of, tmp_path):
    with store.private("split") as folder:
        with pytest.raises(CacheError, match="metrics.json was not written"):
            publish(store, parts_of(), folder, (*fill(folder), "metrics.json"), RunInfo())
        (folder / "frames" / "inner" / "away").symlink_to(tmp_path)
        with pytest.raises(CacheError, match="frames holds the link away"):
            publish(store, parts_of(), folder, ("frames",), RunInfo())
    assert store.lookup(parts_of().key) is None


def flip(path, keep_time):
    stat = path.stat()
    data = bytearray(path.read_bytes())
    data[0] ^= 1
    path.chmod(0o644)
    path.write_bytes(data)
    if keep_time:
        os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))


def add(path):
    path.parent.chmod(0o755)
    path.write_text("not of ours")


def lose(path):
    path.parent.chmod(0o755)
    path.unlink()


DAMAGE = {
    "a flipped bit": lambda frames: flip(frames / "000001.png", keep_time=False),
    "a flipped bit that kept the time": lambda frames: flip(frames / "000001.png", keep_time=True),
    "a truncated file": lambda frames: os.truncate(frames / "000001.png", 3),
    "an empty file": lambda frames: os.truncate(frames / "inner" / "plate.png", 0),
    "a file too many": lambda frames: add(frames / "000009.png"),
    "a missing file": lambda frames: lose(frames / "000001.png"),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_corrupt_blob_is_found_quarantined_and_recomputed(store, make, parts_of, contents, damage):
    said = []
    store.say = said.append
    record = make(parts_of(), "hello")
    good = contents(store.path(record, "frames"))
    DAMAGE[damage](store.path(record, "frames"))
    assert store.lookup(record.key, deep="kept the time" in damage) is None
    [moved] = (store.root / "quarantine").iterdir()
    assert moved.name.startswith(record.outputs["frames"])
    assert str(moved) in said[0]
    again = make(parts_of(), "hello")
    assert store.lookup(record.key, deep=True) == again
    assert contents(store.path(again, "frames")) == good
    assert verify(store).sound


def test_an_object_that_another_run_has_healed_is_not_quarantined(store, make, parts_of):
    record = make(parts_of())
    store.quarantine(store.path(record, "frames"), record.outputs["frames"])
    assert store.lookup(record.key, deep=True) == record
    assert list((store.root / "quarantine").iterdir()) == []


def test_an_object_that_is_gone_is_a_miss_and_can_be_published_again(store, make, parts_of):
    record = make(parts_of())
    store.path(record, "clip.json").unlink()
    assert store.lookup(record.key) is None
    assert store.lookup(make(parts_of()).key, deep=True) is not None


def test_publishing_heals_a_corrupt_object_that_nobody_had_noticed(store, make, parts_of):
    record = make(parts_of(fps=5), "hello")
    flip(store.path(record, "clip.json"), keep_time=True)
    make(parts_of(fps=6), "hello")
    assert store.path(record, "clip.json").read_text() == "hello"
    assert len(list((store.root / "quarantine").iterdir())) == 1


@pytest.mark.parametrize("which", ["own", "below"])
def test_a_damaged_object_that_cannot_be_moved_away_is_not_used_and_not_published_as_sound(
        store, make, parts_of, tmp_path, monkeypatch, which):
    record = make(parts_of(), "hello")
    hide = store.path(record, "clip.json")
    flip(hide, keep_time=True)
    hide_damage(store.record_path("split", record.key), "clip.json", hide)
    seen = Store(tmp_path / "top", below=store) if which == "below" else store

    def refuse(path):
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(store, "set_aside", refuse)
    assert seen.lookup(record.key) is not None, "only reading tells"
    assert not seen.is_whole(seen.path(record, "clip.json"))
    assert seen.lookup(record.key) is None
    if which == "below":
        assert seen.path(make(parts_of(), "hello", store=seen), "clip.json").read_text() == "hello"
    else:
        with pytest.raises(IntegrityError, match="its owner can"):
            make(parts_of(), "hello")


def test_a_record_that_lies_under_another_key_or_stage_does_not_count(store, make, parts_of):
    record, wanted = make(parts_of(fps=5)), parts_of(fps=6)
    text = store.record_path("split", record.key).read_text()
    for stage, key in (("split", wanted.key), ("train", record.key)):
        (store.root / "actions" / stage).mkdir(exist_ok=True)
        store.record_path(stage, key).write_text(text)
    assert store.lookup(wanted.key) is None
    assert store.lookup(record.key) == record


def test_an_object_is_read_once_while_it_stays_as_it_is(store, make, parts_of, monkeypatch):
    record = make(parts_of())
    path, read = store.path(record, "frames"), []
    true = objects.read_manifest
    monkeypatch.setattr(objects, "read_manifest", lambda path: read.append(path) or true(path))
    assert store.is_whole(path) and read == [], "it was written by this process"
    other = Store(store.root)
    assert other.is_whole(path) and other.is_whole(path) and read == [path]
    os.utime(path / "000001.png")
    assert other.is_whole(path) and read == [path, path]


def test_new_times_on_sound_files_are_still_a_hit(store, make, parts_of):
    record = make(parts_of())
    os.utime(store.path(record, "clip.json"), (1e9, 1e9))
    assert store.lookup(record.key) == record
    assert list((store.root / "quarantine").iterdir()) == []


@pytest.mark.parametrize(
    "old, new",
    [
        ('"version": 2', '"version": 3'),
        ('"fps": 5', '"fps": 6'),
        ('"outputs"', '"outpust"'),
        ('"clip.json": "', '"clap.json": "'),
        ("}\n", ""),
        (None, ""),
        (None, "[]"),
        (None, "null"),
    ],
)
def test_a_record_that_is_not_whole_or_of_another_version_is_a_miss(store, make, parts_of, old, new):
    record = make(parts_of(fps=5))
    file = store.record_path("split", record.key)
    text = file.read_text()
    assert old is None or old in text
    file.write_text(new if old is None else text.replace(old, new))
    assert store.lookup(record.key) is None
    assert make(parts_of(fps=5)) == store.lookup(record.key)


def test_a_record_found_bad_is_not_dropped_once_a_sound_one_took_its_place(store, make, parts_of, monkeypatch):
    bad = make(parts_of())
    store.path(bad, "clip.json").unlink()
    other = Store(store.root)
    true = store.record_change

    def meanwhile(key):
        if not published:
            published.append(make(parts_of(), "hello", store=other))
        return true(key)

    published = []
    monkeypatch.setattr(store, "record_change", meanwhile)
    store.lookup(bad.key)
    assert store.lookup(bad.key, deep=True) == published[0]


def test_the_most_similar_earlier_run_is_found_for_explaining(store, make, parts_of):
    make(parts_of(fps=5, size=1, rotate=0))
    near = make(parts_of(fps=5, size=2, rotate=0))
    make(parts_of("train", fps=5, size=2, rotate=90))
    like = parts_of(fps=5, size=2, rotate=90)
    previous = store.previous("split", like)
    assert previous == near
    assert [change.sentence for change in previous.parts.diff(like)] == ["parameter split.rotate changed from 0 to 90"]
    assert store.previous("export", like) is None


def test_the_runs_of_a_stage_come_newest_first_with_those_of_the_store_below_last(store, make, parts_of, tmp_path):
    for at, fps in enumerate((5, 6, 7)):
        os.utime(store.record_path("split", make(parts_of(fps=fps)).key), (at, at))
    top = Store(tmp_path / "top", below=store)
    own = make(parts_of(fps=8), store=top)
    assert [record.parts.params["fps"] for record in store.recent("split", 2)] == [7, 6]
    assert [record.key for record in top.recent("split", 2)] == [own.key, parts_of(fps=7).key]
    assert len(top.recent("split", 9)) == 4 and top.recent("train", 9) == []


def test_a_store_reads_from_the_one_below_and_writes_to_itself(store, make, parts_of, tmp_path):
    shared = make(parts_of(fps=5), "shared")
    top = Store(tmp_path / "top", below=store)
    assert top.lookup(shared.key) == shared
    assert top.path(shared, "clip.json").read_text() == "shared"
    own = make(parts_of(fps=6), "own", store=top)
    assert top.lookup(own.key) == own
    assert top.path(own, "clip.json").read_text() == "own"
    assert store.lookup(own.key) is None
    assert top.previous("split", replace(shared.parts, device="cuda")) == shared


def test_the_default_folder_is_that_of_the_environment(tmp_path, monkeypatch):
    monkeypatch.setenv("GSAC_CACHE", str(tmp_path / "named"))
    assert Store.open().root == tmp_path / "named"
    monkeypatch.delenv("GSAC_CACHE")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert Store.open().root == tmp_path / ".cache" / "gsac"


def test_the_listing_tells_stage_size_and_seconds_the_last_used_first(store, make, parts_of, unused):
    old, new = make(parts_of("split"), "longer text"), make(parts_of("train"), "text")
    unused(old, 500)
    first, second = ls(store)
    assert (first.stage, first.key, first.seconds) == ("train", new.key, 12.5)
    assert (second.stage, second.key) == ("split", old.key)
    assert second.age_s >= 500 > first.age_s
    assert second.bytes == 3 * 1300 + 2 * 11


def test_the_cache_knows_only_the_standard_library_and_itself():
    modules = ("code digest errors gc key lease listing lock memo objects publish record root roots store "
               "module_digest verify").split()
    command = f"import sys, {', '.join('gsac.cache.' + m for m in modules)}; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", command], capture_output=True, check=True, text=True).stdout.split()
    before = subprocess.run([sys.executable, "-c", "import sys; print(*sys.modules)"], capture_output=True, text=True)
    tops = {name.split(".")[0] for name in loaded} - {name.split(".")[0] for name in before.stdout.split()}
    assert {top for top in tops if top not in sys.stdlib_module_names} == {"gsac"}
    assert {name.split(".")[1] for name in loaded if name.startswith("gsac.")} == {"cache"}
