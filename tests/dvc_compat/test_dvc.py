"""Real DVC and gsac agree about what is up to date, both ways, over the same folder."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from gsac.pipeline.project import shipped_dag
from support.dvc import Dvc
from support.toy import DAG

pytestmark = pytest.mark.slow


@pytest.fixture
def dvc(toy):
    toy.out.mkdir()
    return Dvc(toy.out, toy.env)


def test_after_gsac_run_dvc_status_is_clean_and_dvc_repro_runs_nothing(toy, dvc):
    toy.ran()
    assert dvc.is_clean
    toy.runs_file.write_text("")
    assert dvc("repro").count("didn't change") == 4
    assert toy.runs == []


def test_a_run_with_nothing_to_do_leaves_the_lock_and_mends_one_that_was_changed(toy, dvc):
    toy.ran()
    lock = toy.out / "dvc.lock"
    text, before = lock.read_text(), lock.stat()
    assert toy.ran() == [] and lock.stat() == before
    lock.write_text(text.replace("size: ", "size: 1"))
    assert toy.ran() == [] and lock.read_text() == text and dvc.is_clean
    lock.write_text("# " + text)
    assert toy.ran() == [] and lock.read_text() == text


def test_after_dvc_repro_gsac_status_is_clean_and_gsac_run_runs_nothing(toy, dvc, everything):
    toy.ran("--set", "left.word=last")
    params = toy.out / "params.yaml"
    params.write_text(params.read_text().replace("word: first", "word: last"))
    assert toy.gsac("status", toy.out).code == 3
    assert "modified" in dvc("status")
    toy.runs_file.write_text("")
    dvc("repro")
    assert toy.runs == ["right", "join"] or toy.runs == ["cut", "right", "join"]
    status = toy.gsac("status", toy.out)
    assert status.code == 0, status.out
    assert toy.result == "GAMMA GAMMA"
    words = [word for name in everything for word in ("--set", f"{name}.word=last")]
    assert toy.ran(*words) == []
    assert dvc.is_clean


def test_dvc_repro_alone_makes_everything_in_a_fresh_folder(toy, dvc, everything):
    toy.ran()
    for name in everything:
        for path in (toy.out / name).iterdir():
            path.unlink()
    (toy.out / "dvc.lock").unlink()
    toy.cache.rename(toy.root / "old cache")
    toy.runs_file.write_text("")
    dvc("repro")
    assert toy.runs == everything and toy.result == "ALPHA ALPHA"
    assert toy.gsac("status", toy.out).code == 0


def test_both_see_a_changed_clip_and_a_lost_output(toy, dvc):
    toy.ran()
    (toy.out / "left" / "out.txt").unlink()
    assert "deleted" in dvc("status") and toy.gsac("status", toy.out).code == 3
    toy.ran()
    assert dvc.is_clean and toy.gsac("status", toy.out).code == 0
    toy.clip.write_text("delta beta gamma")
    assert "modified" in dvc("status") and toy.gsac("status", toy.out).code == 3


def test_dvc_repro_never_harms_what_is_in_the_store(toy, dvc):
    """DVC removes outputs before it runs a step; ours are links, and what they point to must stay."""
    toy.ran()
    before = {p: p.read_bytes() for p in (toy.cache / "objects").rglob("*") if p.is_file()}
    params = toy.out / "params.yaml"
    params.write_text(params.read_text().replace("keep: 100", "keep: 1"))
    dvc("repro")
    assert toy.result == "ALPHA ALPHA"
    assert before.items() <= {p: p.read_bytes() for p in (toy.cache / "objects").rglob("*") if p.is_file()}.items()
    assert toy.gsac("cache", "verify").code == 0


def test_the_shipped_dvc_yaml_is_one_that_dvc_reads(toy, dvc):
    (toy.out / "dvc.yaml").write_text(shipped_dag().read_text())
    (toy.out / "params.yaml").write_text(Path(shipped_dag()).with_name("params.yaml").read_text())
    os.symlink(toy.clip, toy.out / "clip")
    listed = dvc("stage", "list", "--name-only").split()
    assert listed == ["split", "keypoints", "handgap", "segment", "face", "smplx", "train", "export"]
    assert "changed deps" in dvc("status")


def test_dvc_metrics_show_prints_what_the_folder_holds(toy, dvc):
    toy.write("dvc.yaml", DAG + "metrics: [metrics.json]\n")
    toy.ran()
    toy.ran("--until", "cut")
    assert json.loads(dvc("metrics", "show", "--json"))[""]["data"]["metrics.json"]["data"] == {"length": 10}
    assert dvc.is_clean


def test_dvc_draws_the_plots_that_the_shipped_dvc_yaml_names(toy, dvc):
    (toy.out / "dvc.yaml").write_text(shipped_dag().read_text())
    curve = [{"step": step, "loss": 1 / step, "psnr_fg": 20.0} for step in (1, 2, 3)]
    heldout = [{"frame": frame, "psnr_full": 30.0 + frame, "psnr_fg": 25.0} for frame in (4, 9)]
    (toy.out / "metrics.json").write_text(json.dumps({"psnr_fg": 25.0, "curve": curve, "heldout": heldout}))
    assert "25.0" in dvc("metrics", "show")
    for name, x, y, shown in (("loss", "step", "loss", [(1, 1.0), (2, 1 / 2), (3, 1 / 3)]),
                              ("heldout", "frame", "psnr_full", [(4, 34.0), (9, 39.0)])):
        points = json.loads(dvc("plots", "show", name, "--show-vega"))["data"]["values"]
        assert [(row[x], row[y]) for row in points if x in row] == shown


def test_gsac_never_imports_dvc():
    script = "import sys; import gsac.pipeline.run, gsac.pipeline.dvc_sync, gsac.pipeline.commands.stage; " \
             "sys.exit('dvc' in sys.modules)"
    assert subprocess.run([sys.executable, "-P", "-c", script]).returncode == 0
