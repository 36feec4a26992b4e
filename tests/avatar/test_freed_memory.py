"""What was freed can be handed back to the system."""

import os
import platform
import subprocess
import sys

import pytest

from gsac.avatar.freed_memory import hand_back

HELD = """
import os, numpy as np
from gsac.avatar.freed_memory import hand_back
def mb(): return int(open("/proc/self/statm").read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
np.empty(30_000_000, np.uint8)  # blocks as large as that lie on the heap from now on
blocks = [np.ones(2_000_000, np.uint8) for _ in range(100)]
kept, full = blocks[-1], mb()
del blocks
freed = mb()
hand_back()
print(full - freed, full - mb())
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="the C library is not glibc")
def test_pages_between_blocks_in_use_go_back_to_the_system():
    done = subprocess.run([sys.executable, "-c", HELD], capture_output=True, text=True, check=True, env=os.environ)
    kept_by_the_library, handed_back = map(float, done.stdout.split())
    assert handed_back > 150 > kept_by_the_library


def test_it_is_no_trouble_where_there_is_no_such_thing(monkeypatch):
    monkeypatch.setattr("ctypes.CDLL", lambda name: object())
    hand_back()
