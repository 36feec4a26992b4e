"""What runs in a stage's process is the source as it is now, whatever its size and time say."""

import os


def edit_unseen(file, old: str, new: str) -> None:
    """An edit that keeps size and time, as rsync and tar may make it."""
    stat, text = file.stat(), file.read_text()
    assert old in text and len(old) == len(new)
    file.write_text(text.replace(old, new))
    os.utime(file, ns=(stat.st_atime_ns, stat.st_mtime_ns))


def test_an_edit_that_keeps_size_and_time_runs_the_new_code_under_the_new_key(toy):
    for file in toy.package.rglob("*.py"):
        os.utime(file, (10**9, 10**9))
    assert toy.ran(PYTHONDONTWRITEBYTECODE="") == ["cut", "left", "right", "join"] and toy.result == "ALPHA ALPHA"
    edit_unseen(toy.package / "common.py", "text.strip().upper()", "text.strip().lower()")
    assert "left" in toy.ran(PYTHONDONTWRITEBYTECODE="") and toy.result == "alpha alpha"


def test_code_that_was_compiled_from_this_source_is_not_compiled_again(toy):
    toy.ran(PYTHONDONTWRITEBYTECODE="")
    compiled = sorted((toy.package / "__pycache__").glob("common.*.opt-content0.pyc"))
    assert len(compiled) == 1
    before = compiled[0].stat()
    toy.ran("--force", "left", PYTHONDONTWRITEBYTECODE="")
    assert compiled[0].stat().st_ino == before.st_ino, "it was read, not written anew"
    compiled[0].write_bytes(compiled[0].read_bytes()[:40])
    assert toy.ran("--force", "left", PYTHONDONTWRITEBYTECODE="") == ["left"], "a torn one is compiled anew"
    assert compiled[0].stat().st_size == before.st_size
