"""A file is written whole, or an error names it."""

import json
import subprocess
import sys

SHORT = """
import errno, json, resource, signal, sys
from pathlib import Path
import numpy as np
from gsac.avatar.artifacts import Clip, write_arrays
from gsac.avatar.frame_files import write_alpha, write_frame

signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
rng = np.random.default_rng(0)
rgb, alpha = rng.integers(0, 255, (64, 60, 3)).astype(np.uint8), rng.random((64, 60))
writers = {
    "a.png": lambda path: write_frame(path, rgb), "a.exr": lambda path: write_alpha(path, alpha),
    "a.npz": lambda path: write_arrays(path, rgb=rgb, alpha=alpha),
    "a.json": lambda path: Clip(1.0, [float(t) for t in range(400)], 3, 4, None, "").write(path),
}
for name, write in writers.items():
    whole = Path(sys.argv[1], name)
    write(whole)
    size, path = whole.stat().st_size, whole.with_stem("cut")
    for limit in sorted({*range(0, size, size // 40), *range(size - 9, size)}):
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
        try:
            write(path)
            told = None
        except OSError as error:
            told = error.errno == errno.EFBIG and error.filename == str(path)
        resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        if not told:
            print(json.dumps([name, size, limit, told]))
"""


def test_a_disk_that_fills_at_any_byte_of_an_artifact_is_an_error_that_names_the_file(tmp_path):
    done = subprocess.run([sys.executable, "-c", SHORT, str(tmp_path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert [json.loads(line) for line in done.stdout.splitlines()] == []
