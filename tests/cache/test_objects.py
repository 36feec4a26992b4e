import errno
import os
import shutil
import stat as modes

import pytest

from gsac.cache import objects
from gsac.cache.gc import collect
from gsac.cache.store import Store


def keep_times(act):
    """Does something to files and gives them their times back, as rot and `cp -p` do."""

    def change(frames):
        before = {path: path.stat() for path in frames.rglob("*") if path.is_file()}
        for folder in (frames, frames / "inner"):
            folder.chmod(0o755)
        act(frames)
        for path, stat in before.items():
            if path.exists():
                os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))

    return change


def flip(frames):
    data = bytearray((frames / "000001.png").read_bytes())
    data[7] ^= 4
    (frames / "000001.png").chmod(0o644)
    (frames / "000001.png").write_bytes(data)


def zero(frames):
    path = frames / "000002.png"
    path.chmod(0o644)
    path.write_bytes(bytes(path.stat().st_size))


def swap(frames):
    first, second = frames / "000000.png", frames / "000001.png"
    times = {path: path.stat() for path in (first, second)}
    first.rename(frames / "aside")
    second.rename(first)
    (frames / "aside").rename(second)
    for path in (first, second):
        os.utime(path, ns=(times[path].st_atime_ns, times[path].st_mtime_ns))


DAMAGE = {
    "a flipped bit": flip,
    "zeros": zero,
    "two files swapped": swap,
    "a file renamed": lambda frames: (frames / "000001.png").rename(frames / "000007.png"),
    "a file moved into a folder": lambda frames: (frames / "000001.png").rename(frames / "inner" / "000001.png"),
    "a link to an equal file": lambda frames: (shutil.copy2(frames / "000001.png", frames.parent / "copy"), (
        frames / "000001.png").unlink(), (frames / "000001.png").symlink_to(frames.parent / "copy")),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_the_glance_finds_damage_that_keeps_size_and_date(store, make, parts_of, contents, damage):
    record = make(parts_of())
    good = contents(store.path(record, "frames"))
    keep_times(DAMAGE[damage])(store.path(record, "frames"))
    assert Store(store.root).lookup(record.key) is None
    assert len(list((store.root / "quarantine").iterdir())) == 1
    assert contents(store.path(make(parts_of()), "frames")) == good


def relink(path):
    os.link(path, path.with_name("second name"))
    path.with_name("second name").unlink()


CHANGES = {
    "touched": lambda file: os.utime(file),
    "older than it can be": lambda file: os.utime(file, (0, 0)),
    "other modes": lambda file: file.chmod(0o640),
    "a second name for a while": relink,
    "copied and put back": lambda file: (shutil.copy(file, file.with_name("copy")), file.with_name("copy").replace(file)),
}


@pytest.mark.parametrize("change", CHANGES)
def test_what_changes_times_but_no_content_is_no_miss(store, make, parts_of, change):
    record = make(parts_of())
    frames = store.path(record, "frames")
    frames.chmod(0o755)
    CHANGES[change](frames / "000001.png")
    for _ in range(2):
        assert Store(store.root).lookup(record.key) == record
    assert list((store.root / "quarantine").iterdir()) == []


def test_gc_and_publishing_the_same_content_again_leave_footprints_as_they_are(store, make, parts_of):
    record = make(parts_of(fps=5))
    make(parts_of(fps=6))
    collect(store)
    store.lookup(record.key, deep=True)
    for output, footprint in record.footprints.items():
        assert objects.measure(store.path(record, output)) == footprint


def test_a_store_that_was_copied_still_answers(store, make, parts_of, tmp_path):
    record = make(parts_of())
    shutil.copytree(store.root, tmp_path / "copy", symlinks=True)
    assert Store(tmp_path / "copy").lookup(record.key) == record


def test_only_plain_files_and_folders_have_a_footprint(tmp_path):
    (tmp_path / "folder").mkdir()
    assert objects.measure(tmp_path / "folder").files == 0
    (tmp_path / "file").write_text("x")
    assert objects.measure(tmp_path / "file").bytes == 1
    (tmp_path / "link").symlink_to(tmp_path / "file")
    os.mkfifo(tmp_path / "folder" / "pipe")
    for odd in ("link", "folder", "nothing"):
        assert objects.measure(tmp_path / odd) is None


@pytest.mark.parametrize("umask, shared", [(0o022, 0o755), (0o077, 0o700), (0o002, 0o775), (0o000, 0o775), (0o027, 0o750)])
def test_every_folder_of_a_store_is_for_those_that_its_root_is_for_and_none_for_all(tmp_path, make, parts_of, umask, shared):
    before = os.umask(umask)
    try:
        record = make(parts_of(), store=Store(tmp_path / "new"))
        os.umask(0o077)  # another user's, or another day's
        second = make(parts_of(fps=2), "other", store=Store(tmp_path / "new"))
    finally:
        os.umask(before)
    root = tmp_path / "new"
    folders = [root, *(root / name for name in ("objects", "actions", "tmp", "leases", "partial", "roots", "actions/split"))]
    folders += [Store(root).path(one, "frames").parent for one in (record, second)]
    assert {modes.S_IMODE(folder.stat().st_mode) for folder in folders} == {shared}
    assert modes.S_IMODE((root / "lock").stat().st_mode) == shared & 0o666
    for file in root.glob("actions/*/*.json"):
        assert modes.S_IMODE(file.stat().st_mode) == 0o444


def test_every_file_and_folder_of_a_tree_reaches_the_disk_and_a_failure_is_raised(tmp_path, monkeypatch):
    (tmp_path / "tree" / "deep").mkdir(parents=True)
    for number in range(20):
        (tmp_path / "tree" / "deep" / f"{number}.txt").write_text("words")
    synced = set()
    monkeypatch.setattr(os, "fsync", lambda descriptor: synced.add(os.readlink(f"/proc/self/fd/{descriptor}")))
    objects.sync(tmp_path / "tree")
    assert synced == {str(tmp_path / "tree"), *map(str, (tmp_path / "tree").rglob("*"))}

    def fail(descriptor: int) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(OSError, match="Input/output error"):
        objects.sync(tmp_path / "tree")


def test_the_memo_that_remembers_nothing_takes_what_a_memo_takes(tmp_path):
    (tmp_path / "file").write_text("a")
    objects.NO_MEMO.put("file", (tmp_path / "file").stat(), "digest", sealed=True)
    objects.NO_MEMO.flush()
    assert objects.NO_MEMO.get("file", (tmp_path / "file").stat()) is None
