"""A batch on a Ray cluster of several nodes, all of them on this machine."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import pytest

pytestmark = pytest.mark.slow
CLIPS = ("one", "two", "three", "four")
POISONED = """
import os, signal

def run(job):
    if (job.inputs["cut/words"] / "000000.txt").read_text() == "poison":
        os.kill(os.getpid(), signal.SIGKILL)
"""
HOLDING = """
import os, time

def run(job):
    began = time.time()
    time.sleep(1.5)
    with open(os.environ["TOY_RUNS"] + "." + __name__.split(".")[-2], "a") as log:
        log.write(f"{os.environ.get('CUDA_VISIBLE_DEVICES')} {began} {time.time()}\\n")
"""
"""A stage that notes which GPUs it sees, and from when to when."""
AT_WORK = """
import os, time

def run(job):
    for word, pause in (("begin", 4), ("end", 0)):
        with open(os.environ["TOY_RUNS"] + ".join", "a") as log:
            log.write(word + "\\n")
        time.sleep(pause)
"""
"""A stage that notes when it begins and when it is about to end."""
CORES = 2
"""Of a node: room for one clip."""


@pytest.fixture
def cluster(toy, monkeypatch) -> Iterator[Any]:
    """Its nodes have the toy project."""
    pytest.importorskip("ray", reason="needs ray: pip install 'gsac[ray]'")
    monkeypatch.setenv("RAY_raylet_start_wait_time_s", "180")
    for name in ("PYTHONPATH", "GSAC_STAGES", "GSAC_CACHE", "TOY_RUNS"):
        monkeypatch.setenv(name, toy.env[name])
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0})
    yield cluster
    cluster.shutdown()


@pytest.fixture
def clips(toy):
    folder = toy.root / "clips"
    folder.mkdir()
    for name in CLIPS:
        (folder / f"{name}.mp4").write_text(f"{name} alpha")
    return folder


def records(toy):
    """Stage -> number of results in the store."""
    return {stage.name: len(list(stage.glob("*.json"))) for stage in (toy.cache / "actions").iterdir()}


def test_a_batch_ends_complete_when_a_node_is_lost_in_the_middle_of_it(toy, clips, cluster):
    def joins_at_work():
        log = toy.runs_file.with_name(f"{toy.runs_file.name}.join")
        return log.read_text().count("begin") - log.read_text().count("end") if log.exists() else 0

    toy.edit("join/stage.py", "def run(job):\n", AT_WORK)
    nodes = [cluster.add_node(num_cpus=CORES) for _ in range(2)]
    process = toy.start("batch", clips, "--out", toy.root / "avatars", "--executor", "ray", "--address", cluster.address, "--json")
    try:
        toy.wait_for(lambda: joins_at_work() == len(nodes), 120)  # a node has room for one: each of them is at one
        cluster.remove_node(nodes.pop(), allow_graceful=False)
        out, err = process.communicate(timeout=180)
    finally:
        process.kill()
        for node in nodes:
            cluster.remove_node(node)
    assert process.returncode == 0, err
    for name in CLIPS:
        assert (toy.root / "avatars" / f"{name}-avatar" / "join" / "out.txt").read_text() == f"{name} {name}".upper()
    once = len(CLIPS) * len(records(toy))
    assert once <= len(toy.runs) <= once + 2, "no more than what the node was at runs again"
    assert set(records(toy).values()) == {len(CLIPS)} and not list((toy.cache / "quarantine").iterdir())


def test_a_poison_clip_is_set_aside_and_the_others_end(toy, clips, cluster):
    node = cluster.add_node(num_cpus=CORES)
    (clips / "one.mp4").write_text("poison")
    toy.edit("left/stage.py", "def run(job):\n", POISONED)
    try:
        done = toy.gsac("batch", clips, "--out", toy.root / "avatars", "--executor", "ray", "--address", cluster.address, "--json")
    finally:
        cluster.remove_node(node)
    rows = {row["clip"].rsplit("/", 1)[1]: row for row in done.json["clips"]}
    assert done.code == 1 and [name for name, row in rows.items() if row["status"] == "failed"] == ["one.mp4"]
    assert "2 times" in rows["one.mp4"]["error"] and "not tried again" in rows["one.mp4"]["error"]


def held(toy, stage):
    """What each run of a stage with HOLDING saw: the GPUs by their numbers, s of its begin and end, in order of the begin."""
    lines = [line.split() for line in toy.runs_file.with_name(f"{toy.runs_file.name}.{stage}").read_text().splitlines()]
    return sorted(((gpus, float(began), float(ended)) for gpus, began, ended in lines), key=lambda run: run[1])


def test_the_stages_of_a_gpu_hold_one_each_and_see_no_other(toy, clips, cluster):
    for stage in ("left", "right"):
        toy.edit(f"{stage}/stage.py", "def run(job):\n", HOLDING)
    node = cluster.add_node(num_cpus=CORES * 3, num_gpus=2)  # made up: nothing is computed on them
    try:
        done = toy.gsac("batch", clips, "--out", toy.root / "avatars", "--executor", "ray", "--address", cluster.address, "--json")
    finally:
        cluster.remove_node(node)
    assert done.code == 0, done.err
    runs = held(toy, "right")
    assert len(runs) == len(CLIPS) and {gpus for gpus, *_ in runs} == {"0", "1"}
    for gpu in ("0", "1"):
        turns = [run for run in runs if run[0] == gpu]
        assert all(before[2] <= after[1] for before, after in itertools.pairwise(turns)), "one clip at a time"
    assert {gpus for gpus, *_ in held(toy, "left")}.isdisjoint({"0", "1"}), "stages before it are another task, which holds none"


def test_no_cluster_at_the_address_is_said_before_anything_runs(toy, clips):
    pytest.importorskip("ray", reason="needs ray: pip install 'gsac[ray]'")
    done = toy.gsac("batch", clips, "--executor", "ray", "--address", "127.0.0.1:1")
    assert done.code == 2 and "no Ray cluster answers there" in done.err and toy.runs == []
    assert "as many clips run at once as it has room for" in toy.gsac("batch", clips, "--executor", "ray", "-j", "2").err
    assert "only --executor ray has one" in toy.gsac("batch", clips, "--address", "127.0.0.1:1").err
