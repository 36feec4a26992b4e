"""Two users on one store share it, or are told."""

import os
import shutil
import tempfile
import time
from pathlib import Path

import pytest

FIRST, SECOND, TEAM = 61001, 61002, 61000

AS_USER = """
import concurrent.futures.thread, shutil, sqlite3, gsac.cache.gc, gsac.cache.verify
root, user, umask, group = sys.argv[2:]
os.umask(int(umask, 8))
os.setgroups([])
os.setgid(int(group))
os.setuid(int(user))
store = Store(root)
"""
USE = AS_USER + """
print(store.writable)
with in_use(store, [parts_of(fps=5).key]), single_flight(store, parts_of(fps=5).key) as found:
    print(found is not None)
print(time.time() - store.record_path("split", parts_of(fps=5).key).stat().st_mtime < 3600)
if store.writable:
    with in_use(store), single_flight(store, parts_of(fps=6).key):
        make(parts_of(fps=6), "second")
    make(parts_of(fps=5), "again", replace=True)
    print(gsac.cache.verify.verify(store).sound, store.lookup(parts_of(fps=6).key, deep=True) is not None)
    store.memo.put("test", os.stat("/"), "seen")
    store.memo.flush()
    print(store.memo.get("test", os.stat("/")))
"""
HEAL = AS_USER + """
said = []
store.say = said.append
print(store.lookup(parts_of(fps=5).key) is None)
try:
    make(parts_of(fps=5), "first")
    print("healed")
except Exception as error:
    print(type(error).__name__, error)
print(store.lookup(parts_of(fps=5).key) is not None)
"""


@pytest.fixture
def root():
    """A folder that everybody can reach and a team can write to."""
    if os.geteuid() != 0:
        pytest.skip("other users can only be acted by root")
    folder = Path(tempfile.mkdtemp())
    folder.chmod(0o755)
    (folder / "store").mkdir()
    os.chown(folder / "store", FIRST, TEAM)
    yield folder / "store"
    shutil.rmtree(folder)


def age(root):
    """Makes every record look as if it was last used yesterday."""
    for file in root.glob("actions/*/*.json"):
        os.utime(file, (time.time() - 86400,) * 2)


@pytest.mark.parametrize("umask", ["022", "002", "077", "000"])
def test_a_team_shares_a_store_whose_folder_it_may_write_whatever_the_umask(root, child, umask):
    root.chmod(0o2775)
    child(AS_USER + "make(parts_of(fps=5), 'first')", root, FIRST, umask, TEAM).wait()
    age(root)
    told = child(USE, root, SECOND, umask, TEAM).communicate()[0].split("\n")
    assert told[:5] == ["True", "True", "True", "True True", "seen"], "writable, found, its use is noted, sound, remembered"


def test_who_may_only_read_a_store_uses_it_and_is_told_that_it_cannot_be_written(root, child):
    root.chmod(0o755)
    child(AS_USER + "make(parts_of(fps=5), 'first')", root, FIRST, "000", FIRST).wait()
    age(root)
    assert child(USE, root, SECOND, "000", SECOND).communicate()[0].split() == ["False", "True", "False"]


def test_damage_in_another_users_object_is_never_served_and_healed_or_told(root, child):
    root.chmod(0o2775)
    child(AS_USER + "make(parts_of(fps=5), 'first')", root, FIRST, "002", TEAM).wait()
    [frames] = (path for path in root.glob("objects/*/*") if path.is_dir())
    (frames / "000001.png").write_bytes(b"x" * 700)
    told = child(HEAL, root, SECOND, "002", TEAM).communicate()[0].splitlines()
    assert told[0] == "True"
    assert told[1:] == ["healed", "True"] or "IntegrityError" in told[1] and "its owner can" in told[1] and told[2] == "False"
    assert child(HEAL, root, FIRST, "002", TEAM).communicate()[0].splitlines() == ["True", "healed", "True"]
