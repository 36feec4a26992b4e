"""The Unity package bends an avatar's surface as the Python body does: its scripts over the stubs of Unity, under Mono."""

import numpy as np

from support.bending import MIRROR, pose_in_unity


def test_a_bent_elbow_lies_where_the_python_body_has_it(play, bent_arm, tmp_path):
    posed = pose_in_unity(play, bent_arm.file, bent_arm.pose, tmp_path)
    assert np.linalg.norm(posed - bent_arm.vertices, axis=1).max() < 1e-4, "0.1 mm"


def test_all_instances_share_the_rest_of_a_body_without_correctives(play, mono, files, figure, tmp_path):
    play("frame", files / "figure.gsac", files / "figure.txt", tmp_path / "frame")
    rest = mono.arrays(tmp_path / "frame")["GsacRest"].view(np.float32).reshape(-1, 4)
    np.testing.assert_array_equal(rest[:, :3], figure.vertices * MIRROR.astype(np.float32))


def test_the_reader_has_the_correctives_of_the_python_reader(mono, package, programs_folder, bent_arm, tmp_path):
    sources = [*(package / "Runtime" / "Core").glob("*.cs"), programs_folder / "Dump.cs", programs_folder / "Read.cs"]
    exe = mono.compile_csharp(sources, tmp_path / "read.exe")
    mono.run(exe, "dump", bent_arm.file, tmp_path / "arrays")
    got, want = mono.arrays(tmp_path / "arrays"), bent_arm.avatar.correctives
    np.testing.assert_array_equal(got["corrective_start"], want.start)
    np.testing.assert_array_equal(got["corrective_joint"], want.joint)
    np.testing.assert_array_equal(got["corrective_delta"], want.delta.astype(np.float16).astype(np.float32).ravel())
