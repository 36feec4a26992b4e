import hashlib
import os

import pytest

from gsac.cache import digest, memo
from gsac.cache.digest import file_digest, tree_digest, typed_digest
from gsac.cache.errors import CacheError
from gsac.cache.memo import Memo, memo_in


@pytest.fixture
def settled_at_once(monkeypatch):
    monkeypatch.setattr(memo, "SETTLED_NS", -(10**18))


@pytest.fixture
def reads(monkeypatch):
    """Counts how often a file is read for its digest."""
    count = []
    true = hashlib.file_digest
    monkeypatch.setattr(digest.hashlib, "file_digest", lambda *a: count.append(1) or true(*a))
    return count


def test_a_file_digest_is_what_sha256sum_says(store, tmp_path):
    (tmp_path / "a").write_bytes(b"abc")
    assert file_digest(tmp_path / "a") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def test_the_name_of_a_file_or_folder_is_not_in_its_digest_and_names_inside_are(store, tmp_path):
    for folder, inside in (("a", "x.png"), ("b", "x.png"), ("c", "y.png")):
        (tmp_path / folder / "deep").mkdir(parents=True)
        (tmp_path / folder / "deep" / inside).write_text("same")
    a, b, c = (tree_digest(tmp_path / name)[0] for name in "abc")
    assert a == b != c
    assert tree_digest(tmp_path / "a/deep/x.png") == tree_digest(tmp_path / "c/deep/y.png")
    assert list(tree_digest(tmp_path / "a/deep/x.png")[1]) == [""]


def test_two_files_with_swapped_contents_are_another_tree(store, tmp_path):
    for folder, (first, second) in (("a", "12"), ("b", "21")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "0.png").write_text(first)
        (tmp_path / folder / "1.png").write_text(second)
    assert tree_digest(tmp_path / "a")[0] != tree_digest(tmp_path / "b")[0]


def test_things_of_two_kinds_never_share_a_digest():
    assert len({typed_digest("action 1", b"{}"), typed_digest("tree 1", b"{}"), hashlib.sha256(b"{}").hexdigest()}) == 3


def test_an_unchanged_file_is_read_once(store, tmp_path, settled_at_once, reads):
    (tmp_path / "a").write_bytes(b"abc")
    assert len({file_digest(tmp_path / "a") for _ in range(3)}) == 1
    assert len(reads) == 1


def test_a_file_that_was_never_read_before_is_memoised_on_its_first_reading(store, tmp_path, settled_at_once, reads):
    (tmp_path / "a").write_bytes(b"abc")
    mtime = (tmp_path / "a").stat().st_mtime_ns
    os.utime(tmp_path / "a", ns=(10**18, mtime))
    file_digest(tmp_path / "a")
    file_digest(tmp_path / "a")
    assert len(reads) == 1


def test_the_memo_outlives_the_process_that_filled_it(store, tmp_path, settled_at_once, reads):
    (tmp_path / "a").write_bytes(b"abc")
    for _ in range(2):
        file_digest(tmp_path / "a", Memo(tmp_path / "memo.sqlite"))
    assert len(reads) == 1


def test_an_edit_that_keeps_size_and_mtime_is_noticed(store, tmp_path, settled_at_once):
    (tmp_path / "a").write_bytes(b"abc")
    before, stat = file_digest(tmp_path / "a"), (tmp_path / "a").stat()
    (tmp_path / "a").write_bytes(b"abd")
    os.utime(tmp_path / "a", ns=(stat.st_atime_ns, stat.st_mtime_ns))
    assert file_digest(tmp_path / "a") != before


def test_a_file_touched_within_two_seconds_is_never_memoised(store, tmp_path, reads):
    (tmp_path / "a").write_bytes(b"abc")
    file_digest(tmp_path / "a")
    file_digest(tmp_path / "a")
    assert len(reads) == 2


def test_a_file_from_the_future_is_never_memoised(store, tmp_path, reads):
    (tmp_path / "a").write_bytes(b"abc")
    os.utime(tmp_path / "a", (4e9, 4e9))
    file_digest(tmp_path / "a")
    file_digest(tmp_path / "a")
    assert len(reads) == 2


@pytest.mark.parametrize("damage", ["deleted", "garbage", "truncated"])
def test_losing_the_memo_only_costs_time(store, tmp_path, settled_at_once, damage):
    (tmp_path / "a").write_bytes(b"abc")
    file = tmp_path / "memo.sqlite"
    before = file_digest(tmp_path / "a", Memo(file))
    if damage == "deleted":
        file.unlink()
    else:
        file.write_bytes(b"not a database, but long enough to look like one" * 100 if damage == "garbage" else b"SQLite")
    assert file_digest(tmp_path / "a", Memo(file)) == before


def test_many_processes_fill_one_memo(store, tmp_path, child, settled_at_once, reads):
    (tmp_path / "many").mkdir()
    for number in range(50):
        (tmp_path / "many" / f"{number}").write_text(f"{number}")
    code = "from gsac.cache import memo, digest; memo.SETTLED_NS = -10**18\n"
    code += "print(digest.tree_digest(Path(sys.argv[2]), store.memo)[0])"
    printed = [process.communicate()[0].strip() for process in [child(code, tmp_path / "many") for _ in range(4)]]
    assert set(printed) == {tree_digest(tmp_path / "many", memo_in(store.root))[0]}
    assert not reads


def test_a_link_to_a_file_counts_as_the_file_and_a_link_to_a_folder_is_refused(store, tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    (tmp_path / "a" / "x").write_text("x")
    (tmp_path / "b" / "x").symlink_to(tmp_path / "a" / "x")
    assert tree_digest(tmp_path / "a")[0] == tree_digest(tmp_path / "b")[0]
    (tmp_path / "b" / "y").symlink_to(tmp_path / "a")
    with pytest.raises(CacheError, match="b/y"):
        tree_digest(tmp_path / "b")


def test_names_that_are_not_utf8_are_no_trouble(store, tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / os.fsdecode(b"caf\xe9.jpg")).write_text("x")
    assert len(tree_digest(tmp_path / "a")[0]) == 64
