import errno
import os
import random
import shutil
import signal
import subprocess
import time

import pytest

from gsac.cache.errors import CacheFullError
from gsac.cache.gc import collect
from gsac.cache.publish import STEPS, publish
from gsac.cache.record import RunInfo
from gsac.cache.store import Store
from gsac.cache.verify import verify

MOMENTS = [(step, 1) for step in STEPS] + [("placed", 2)]
RECORDED = STEPS.index("recorded")


def after(step: str, count: int, act):
    """A step hook that acts when `step` is done for the `count`-th time."""
    left = [count]

    def hook(name: str) -> None:
        if name == step:
            left[0] -= 1
            if left[0] == 0:
                act()

    return hook


DIE_AFTER = """
left = int(sys.argv[3])
def step(name):
    global left
    if name == sys.argv[2]:
        left -= 1
        if not left:
            os.kill(os.getpid(), signal.SIGKILL)
make(parts_of(), "hello", step=step)
"""


@pytest.mark.parametrize("step, count", MOMENTS)
def test_sigkill_at_any_step_never_leaves_a_torn_artifact_that_counts_as_done(store, make, parts_of, contents, child, step, count):
    process = child(DIE_AFTER, step, count)
    process.communicate()
    assert process.returncode == -signal.SIGKILL
    found = store.lookup(parts_of().key)
    assert (found is not None) == (STEPS.index(step) >= RECORDED)
    assert found == store.lookup(parts_of().key, deep=True)
    assert verify(store).sound
    collect(store)
    assert list((store.root / "tmp").iterdir()) == []
    record = make(parts_of(), "hello")
    assert store.lookup(record.key, deep=True) == record
    assert store.path(record, "clip.json").read_text() == "hello"
    assert len(contents(store.path(record, "frames"))) == 4
    collect(store)
    assert len(list((store.root / "objects").glob("*/*"))) == 2


PUBLISH_ON = """
for number in range(10**6):
    make(parts_of(number=number), f"hello {number}", replace=number % 2 == 0)
    print(number, flush=True)
"""


def test_sigkill_at_random_moments_never_leaves_a_torn_artifact_that_counts_as_done(store, child):
    pause = random.Random(1)
    for _ in range(6):
        process = child(PUBLISH_ON)
        process.stdout.readline()
        time.sleep(pause.uniform(0.0, 0.08))
        process.kill()
        process.communicate()
    records = [store.read(file) for file in store.record_files()]
    assert records
    assert None not in records
    assert all(store.lookup(record.key, deep=True) == record for record in records)
    assert verify(store).sound
    collect(store)
    assert list((store.root / "tmp").iterdir()) == []


WRITE_OWN = "print(make(parts_of(), sys.argv[2]).outputs['clip.json'])"


def test_many_writers_make_one_result(store, parts_of, child):
    children = [child(WRITE_OWN, f"writer {number}") for number in range(6)]
    told = {process.communicate()[0].strip() for process in children}
    record = store.lookup(parts_of().key, deep=True)
    assert told == {record.outputs["clip.json"]}
    assert len(store.record_files()) == 1
    collect(store)
    assert len(list((store.root / "objects").glob("*/*"))) == 2


def test_many_writers_of_equal_content_under_their_own_keys_all_count(store, parts_of, child):
    code = "make(parts_of(number=int(sys.argv[2])), 'same')"
    for process in [child(code, number) for number in range(6)]:
        process.communicate()
        assert process.returncode == 0
    assert all(store.lookup(parts_of(number=number).key, deep=True) for number in range(6))
    assert len(list((store.root / "objects").glob("*/*"))) == 2


@pytest.mark.parametrize("step, count", MOMENTS)
def test_a_disk_that_is_full_at_any_step_loses_nothing_and_is_named(store, make, parts_of, step, count):
    def full():
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    before = make(parts_of(fps=5), "before")
    with pytest.raises(CacheFullError, match=str(store.root)) as error:
        make(parts_of(fps=6), "hello", step=after(step, count, full))
    assert "nothing that was kept before is lost" in str(error.value)
    assert ("2,110 bytes" in str(error.value)) == (step != "started")
    assert store.lookup(before.key, deep=True) == before
    assert (store.lookup(parts_of(fps=6).key) is not None) == (STEPS.index(step) >= RECORDED)
    assert list((store.root / "tmp").iterdir()) == []
    record = make(parts_of(fps=6), "hello")
    assert store.lookup(record.key, deep=True) == record


@pytest.fixture
def small_disk(tmp_path):
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=256k", "gsac-test", str(folder)]
    if os.geteuid() != 0 or not shutil.which("mount") or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("a small disk can only be mounted as root; the steps are tested one by one without it")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


def test_a_real_disk_that_fills_up_while_publishing_loses_nothing(small_disk, make, parts_of, fill):
    small = Store(small_disk / "store")
    before = make(parts_of(fps=5), "before", store=small)
    with small.private("split") as folder:
        outputs = fill(folder, "hello")
        other = os.open(small_disk / "other people's data", os.O_WRONLY | os.O_CREAT)
        with pytest.raises(OSError, match="No space left"):
            while True:
                os.write(other, b"\0" * 4096)
        os.close(other)
        with pytest.raises(CacheFullError, match="2,110 bytes"):
            publish(small, parts_of(fps=6), folder, outputs, RunInfo())
    assert small.lookup(before.key, deep=True) == before
    assert small.lookup(parts_of(fps=6).key) is None
    (small_disk / "other people's data").unlink()
    assert small.lookup(make(parts_of(fps=6), "hello", store=small).key, deep=True) is not None


AS_NOBODY = """
if os.geteuid() == 0:
    os.setgroups([]); os.setgid(65534); os.setuid(65534)
from gsac.cache.errors import CacheReadOnlyError
from gsac.cache.gc import collect
store = Store(store.root)
assert not store.writable
record = store.lookup(parts_of(fps=5).key)
print(store.path(record, "clip.json").read_text())
print(store.lookup(parts_of(fps=6).key))
with in_use(store, [record.key]), single_flight(store, record.key) as found:
    print(found == record)
for act in (lambda: make(parts_of(fps=6)), lambda: collect(store)):
    try:
        act()
    except CacheReadOnlyError as error:
        print(error)
"""


def test_a_read_only_cache_still_answers_and_says_what_to_do_when_it_should_keep_something(store, make, parts_of, child, tmp_path):
    make(parts_of(fps=5), "before")
    folders = [store.root, *(path for path in store.root.rglob("*") if path.is_dir())]
    parents = [folder for folder in tmp_path.parents if folder.stat().st_uid == os.geteuid() and folder != folder.parent]
    modes = {folder: folder.stat().st_mode for folder in [*folders, tmp_path, *parents]}
    try:
        for folder in folders:
            folder.chmod(0o555)
        for folder in (tmp_path, *parents):
            folder.chmod(modes[folder] | 0o555)
        printed = child(AS_NOBODY).communicate()[0].splitlines()
    finally:
        for folder, mode in modes.items():
            folder.chmod(mode)
    assert printed[:3] == ["before", "None", "True"]
    assert len(printed) == 5
    for line in printed[3:]:
        assert str(store.root) in line
        assert "runs may go on without keeping their results, or set GSAC_CACHE" in line
