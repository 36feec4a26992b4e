import signal
import threading
import time

from gsac.cache.lease import in_use, live_names, single_flight
from gsac.cache.lock import shared

COMPUTE_ONCE = """
with single_flight(store, parts_of().key) as found:
    if found is None:
        print("computed")
        time.sleep(0.3)
        make(parts_of(), sys.argv[2])
    else:
        print("found")
"""
HOLD = """
with single_flight(store, "k" * 64):
    print("held", flush=True)
    time.sleep(60)
"""


def test_two_runs_at_once_compute_equal_work_once(store, child):
    told = [process.communicate()[0].strip() for process in [child(COMPUTE_ONCE, n) for n in range(5)]]
    assert sorted(told) == ["computed"] + ["found"] * 4
    assert list((store.root / "leases").iterdir()) == []


def test_a_key_whose_holder_was_killed_goes_to_the_next_one_at_once(store, child):
    holder = child(HOLD)
    assert holder.stdout.readline() == "held\n"
    waited, got = [], threading.Event()

    def wait():
        with single_flight(store, "k" * 64, lambda: waited.append(1)):
            got.set()

    waiter = threading.Thread(target=wait)
    waiter.start()
    assert not got.wait(0.2)
    assert waited == [1]
    holder.send_signal(signal.SIGKILL)
    assert got.wait(5)
    waiter.join()


def test_other_keys_do_not_wait(store, child):
    holder = child(HOLD)
    assert holder.stdout.readline() == "held\n"
    waited = []
    with single_flight(store, "j" * 64, lambda: waited.append(1)):
        assert waited == []


def test_threads_of_one_process_take_turns_too(store, make, parts_of):
    computed = []

    def compute():
        with single_flight(store, parts_of().key) as found:
            if found is None:
                computed.append(1)
                time.sleep(0.05)
                make(parts_of())

    threads = [threading.Thread(target=compute) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert computed == [1]


def test_a_key_is_free_again_after_a_failure(store):
    for _ in range(2):
        try:
            with single_flight(store, "k" * 64) as found:
                assert found is None
                raise RuntimeError
        except RuntimeError:
            pass


def test_keys_are_live_while_their_run_lives_and_no_longer(store, child):
    with in_use(store, ["a" * 64]) as lease, single_flight(store, "c" * 64):
        lease.add("b" * 64)
        assert live_names(store) == {"a" * 64, "b" * 64, "c" * 64}
    assert live_names(store) == set()
    holder = child(HOLD)
    assert holder.stdout.readline() == "held\n"
    assert live_names(store) == {"k" * 64}
    holder.kill()
    holder.wait()
    assert live_names(store) == set()
    assert list((store.root / "leases").iterdir()) == []


def test_no_two_ever_hold_one_key(store):
    inside, overlaps = [], []

    def take_turns():
        for _ in range(40):
            with single_flight(store, "k" * 64):
                inside.append(1)
                time.sleep(0.0005)
                overlaps.append(len(inside) > 1)
                inside.pop()

    threads = [threading.Thread(target=take_turns) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(overlaps) == 240
    assert not any(overlaps)


def test_a_key_cannot_be_claimed_while_gc_sweeps(store):
    claimed = threading.Event()
    with in_use(store) as lease:
        claim = threading.Thread(target=lambda: (lease.add("k" * 64), claimed.set()))
        with shared(store.root / "lock", alone=True):
            claim.start()
            assert not claimed.wait(0.2)
        assert claimed.wait(5)
        claim.join()
