"""Artifact files: what is damaged is named, and looking at them costs nothing before it is done."""

import subprocess
import sys

import numpy as np
import pytest

from gsac.avatar.artifacts import ArtifactError, check_arrays, read_arrays, write_arrays


@pytest.mark.parametrize("damage", ["cut", "empty", "flipped", "text"])
def test_a_damaged_npz_is_named(tmp_path, damage):
    path = tmp_path / "body.npz"
    write_arrays(path, betas=np.arange(5000, dtype=np.float32))
    whole = bytearray(path.read_bytes())
    whole[len(whole) // 2] ^= 0xFF
    path.write_bytes({"cut": whole[: len(whole) // 2], "empty": b"", "flipped": whole, "text": b"hello"}[damage])
    with pytest.raises(ArtifactError, match="body.npz"):
        read_arrays(path)


def test_an_array_of_another_length_is_named_with_both(tmp_path):
    write_arrays(tmp_path / "body.npz", transl=np.zeros((3, 3)), jaw=np.zeros((4, 3)))
    with pytest.raises(ArtifactError, match=r"jaw has shape \(4, 3\), expected \(3, 3\)"):
        check_arrays(tmp_path / "body.npz", {"transl": ("T", 3), "jaw": ("T", 3)})


def test_declaring_the_stages_imports_nothing_heavy():
    script = ("import sys, importlib\n"
              "for name in 'split keypoints handgap segment face smplx train export'.split():\n"
              "    importlib.import_module('gsac.stages.' + name)\n"
              "print(*sorted({'numpy', 'cv2', 'torch', 'numba', 'scipy', 'av'} & sys.modules.keys()))")
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
