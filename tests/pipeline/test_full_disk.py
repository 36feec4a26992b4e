"""A disk that fills while a real stage writes: its run says so, and no cut file is published."""

import os
import resource
import signal
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from gsac.cache.store import Store

SIZE = 64, 60


def full_at(limit: int) -> None:
    """In a new process: no file may grow beyond `limit` bytes, and who tries gets an error."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))


@pytest.mark.parametrize("missing", [1, 100, 4000])
def test_a_frame_that_does_not_fit_on_the_disk_is_never_published_and_the_run_names_disk_and_cure(tmp_path, missing):
    photos, cache, out = tmp_path / "photos", tmp_path / "cache", tmp_path / "out"
    photos.mkdir()
    noise = np.random.default_rng(0).integers(0, 255, (*SIZE, 3)).astype(np.uint8)
    Image.fromarray(noise).save(photos / "1.png")
    command = [sys.executable, "-P", "-m", "gsac.pipeline.cli", "run", str(photos), "--out", str(out), "--until", "split"]
    size = 11_664  # of the frame
    done = subprocess.run(command, env=os.environ | {"GSAC_CACHE": str(cache), "PYTHONDONTWRITEBYTECODE": "1"}, text=True,
                          capture_output=True, preexec_fn=lambda: full_at(size - missing), restore_signals=False)
    assert done.returncode == 1 and "Traceback" not in done.stderr
    assert f"no room in the cache folder {cache} for a file of that size" in done.stderr and "ulimit -f" in done.stderr
    assert "000000.png" in done.stderr and not Store(cache).record_files()
