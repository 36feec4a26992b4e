"""A run says how long it will take before it starts, and keeps how wrong that was."""

import json
import struct
from dataclasses import replace
from pathlib import Path

import pytest

from gsac.cache.publish import publish
from gsac.cache.record import RunInfo
from gsac.cache.store import Store
from gsac.pipeline import cost_model
from gsac.pipeline.cost_forecast import Forecast, Forecaster, Time, count_cores
from gsac.pipeline.cost_model import stage_cost
from gsac.pipeline.footage import Footage
from gsac.pipeline.keys import Keys
from gsac.pipeline.params import resolve
from gsac.pipeline.plan import plan_waiting
from gsac.pipeline.project import Project
from gsac.stages.train import config

PROJECT = Project.at_hand()
STAGES = list(PROJECT.graph.steps)
DEMO = Footage(60, 720, 1280)
SMALL = replace(DEMO, frames=4)
DEMO_TOOK = {"split": 6.1, "keypoints": 9.3, "handgap": 0.6, "segment": 30.0, "face": 2.2, "smplx": 5.8, "train": 118.3,
             "export": 3.9}
"""CPU s of a clip of the demo's length and size on the machine that the coefficients were measured on."""
FORECAST = Forecast({"split": Time(2, 4), "face": Time(0.3, 1), "train": Time(36.6, 53)}, (), 2, known_here=True, exact=True)


@pytest.fixture(autouse=True)
def on_the_cpu(monkeypatch):
    monkeypatch.setenv("GSAC_DEVICE", "cpu")


def costs(footage: Footage = DEMO, *sets: str, device: str = "cpu") -> dict[str, float | None]:
    configs = resolve(PROJECT, None, sets)
    found = {name: stage_cost(name, configs[name], footage, device) for name in STAGES}
    return {name: cost.cpu_seconds if cost is not None else None for name, cost in found.items()}


def test_the_demo_clip_is_foretold_within_a_quarter():
    told = costs()
    assert sum(DEMO_TOOK.values()) / 1.25 <= sum(told.values()) <= 1.25 * sum(DEMO_TOOK.values())
    assert all(DEMO_TOOK[name] / 2 <= told[name] <= 2 * DEMO_TOOK[name] for name in STAGES)


def test_the_model_follows_the_recipes_own_steps_sizes_and_coarse_share(monkeypatch):
    told = [costs()["train"]]
    for change in (lambda: monkeypatch.setattr(config, "SIZES", (40000, 50000)),
                   lambda: monkeypatch.setattr(config, "LARGE", (1.6e5, 0.2)),
                   lambda: monkeypatch.setitem(config.FAST_STEPS, "cpu", 3000)):
        change()
        told.append(costs()["train"])
    assert told == sorted(set(told)), "each of them makes it longer"


@pytest.mark.parametrize("device", ["cpu", "cuda"])
def test_more_frames_pixels_steps_or_gaussians_cost_more(device):
    few = costs(replace(DEMO, frames=30), device=device)
    for name, more in costs(device=device).items():
        assert more > few[name] or name == "export"
    train = [costs(DEMO, "train.gaussians=6000", "train.height=540", *more, device=device)["train"] for more in (
        [], ["train.height=1280"], ["train.height=null"], ["train.steps=6000"], ["train.gaussians=12000"],
        ["train.gaussians=auto"])]
    assert all(more > train[0] for more in train[1:])


def test_methods_that_were_never_measured_have_no_cost():
    unknown = costs(DEMO, "train.recipe=paper", "smplx.method=paper", "keypoints.detector=onnx-wholebody",
                    "segment.method=sapiens")
    assert [name for name, cost in unknown.items() if cost is None] == ["keypoints", "segment", "smplx", "train"]


def test_cores_help_what_is_shared_out_only():
    cost = cost_model.Cost(10.0, 0.4)
    assert cost.seconds(1) == 10 and cost.seconds(2) == pytest.approx(7) and cost.seconds(600) == pytest.approx(4, rel=0.01)


def put(store: Store, name: str, times: float, sets: tuple[str, ...] = (), timings: dict | None = None, waiting: float = 1) -> None:
    """A made-up run of a stage on a few frames, which took so many times what the model says, and waited for others."""
    keys = Keys(PROJECT, resolve(PROJECT, None, sets), store)
    with store.private("split") as folder:
        (folder / "frames").mkdir()
        for i in range(SMALL.frames):
            (folder / "frames" / f"{i:06d}.png").write_bytes(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + struct.pack(">2I", 720, 1280))
        (folder / "clip.json").write_text(json.dumps({"width": 720, "height": 1280, "timestamps_s": [0.0] * SMALL.frames}))
        split = publish(store, keys.parts("split", {"clip": "a" * 64}), folder, ("frames", "clip.json"), info("split", times, sets))
    if name != "split":
        inputs = {port: split.outputs.get(port.removeprefix("split/"), "b" * 64) for port in PROJECT.graph.step(name).deps}
        with store.private(name) as folder:
            (folder / "result").write_text(name)
            told = info(name, times, sets)
            told.timings, told.seconds = timings or {}, waiting * told.seconds
            publish(store, keys.parts(name, inputs), folder, ("result",), told)


def info(name: str, times: float, sets: tuple[str, ...]) -> RunInfo:
    cost = stage_cost(name, resolve(PROJECT, None, sets)[name], SMALL, "cpu")
    return RunInfo(seconds=times * cost.seconds(count_cores()), cpu_seconds=times * cost.cpu_seconds)


def tell(store: Store, tmp_path: Path, *sets: str, stages: list[str] = STAGES) -> Forecast:
    keys = Keys(PROJECT, resolve(PROJECT, None, ("split.count=4", "split.max_height=1280", *sets)), store)
    clip = tmp_path / "clip.webm"
    clip.touch()
    return Forecaster(keys, store).foretell([plan_waiting(name, []) for name in stages], clip)


def test_the_first_run_goes_by_the_machine_that_was_measured(tmp_path):
    told = tell(Store(tmp_path / "store"), tmp_path)
    assert not told.known_here and not told.exact and told.unknown == ()
    assert told.whole.cpu_seconds == pytest.approx(sum(costs(SMALL).values()))


def test_earlier_runs_here_scale_their_stage_and_those_that_never_ran(tmp_path):
    store = Store(tmp_path / "store")
    put(store, "train", 3.0)
    told = tell(store, tmp_path, "train.steps=2000", "train.gaussians=6000")
    expected = costs(SMALL, "train.steps=2000", "train.gaussians=6000")
    assert told.known_here
    assert told.stages["train"].cpu_seconds == pytest.approx(3 * expected["train"]), "other parameters, the same machine"
    assert told.stages["smplx"].cpu_seconds == pytest.approx(3 * expected["smplx"])


def test_the_newest_run_counts_most(tmp_path):
    store = Store(tmp_path / "store")
    put(store, "train", 3.0, ("train.seed=1",))
    put(store, "train", 1.0, ("train.seed=2",))
    assert 1.0 < tell(store, tmp_path).stages["train"].cpu_seconds / costs(SMALL)["train"] < 2.0


def test_of_wall_time_the_run_counts_that_waited_least_for_others(tmp_path):
    store = Store(tmp_path / "store")
    free = tell(store, tmp_path).stages["train"].seconds
    put(store, "train", 1.0, ("train.seed=1",), waiting=1.1)
    put(store, "train", 1.0, ("train.seed=2",), waiting=5.0)
    assert tell(store, tmp_path).stages["train"].seconds == pytest.approx(1.1 * free)


def test_runs_that_went_on_from_a_checkpoint_ran_elsewhere_or_tell_no_time_do_not_count(tmp_path, monkeypatch):
    store = Store(tmp_path / "store")
    put(store, "train", 3.0, ("train.seed=1",), {"resumed_at_step": 900})
    monkeypatch.setenv("GSAC_DEVICE", "cuda")
    monkeypatch.setattr("gsac.pipeline.keys.why_not", lambda: None)
    put(store, "train", 3.0, ("train.seed=2",))
    monkeypatch.setenv("GSAC_DEVICE", "cpu")
    for file in store.record_files("split"):
        store.drop(file)
    put(store, "train", float("nan"), ("train.seed=3",))
    assert tell(store, tmp_path, stages=["train"]).whole.cpu_seconds == pytest.approx(costs(SMALL)["train"])


def test_a_run_whose_frames_are_gone_from_the_store_does_not_count(tmp_path):
    store = Store(tmp_path / "store")
    put(store, "keypoints", 3.0)
    for file in store.record_files("split"):
        (store.path(store.read(file), "frames")).rename(tmp_path / "gone")
        store.drop(file)
    assert not tell(store, tmp_path).known_here


def test_the_sentence_names_what_takes_time():
    assert FORECAST.sentence("standard") == "About 39 s on this machine (2 cores): split 2 s, train 37 s; quality standard"
    guessed = replace(FORECAST, unknown=("smplx",), cores=1, known_here=False, exact=False)
    assert guessed.sentence("draft") == ("At most about 39 s on a machine like the one that was measured (1 core), half a minute "
                                         "more the first time, while kernels compile: split 2 s, train 37 s, without smplx, of "
                                         "which no time is known; quality draft")


def test_a_busy_machine_is_said_to_be_busy():
    said = replace(FORECAST, load=6).sentence("fine")
    assert said.startswith("About 39 s on this machine (2 cores), longer while others keep it as busy as now: split 2 s")


def test_what_ran_is_held_against_what_was_told_of_it():
    judged = FORECAST.judged({"train": Time(73.2, 53.0)})
    assert judged["took"] == {"seconds": 73.2, "cpu_seconds": 53.0} and (judged["ratio"], judged["cpu_ratio"]) == (2.0, 1.0)
    assert FORECAST.judged({})["ratio"] is None


def test_a_batch_reckons_with_its_share_of_the_cores(monkeypatch):
    monkeypatch.setenv("NUMBA_NUM_THREADS", "1")
    assert count_cores() == 1
    monkeypatch.setenv("NUMBA_NUM_THREADS", "many")
    assert count_cores() >= 1


def test_a_run_says_it_before_the_first_stage_and_keeps_it_beside_what_it_took(toy):
    toy.ran("--set", "left.pause_s=0.7")
    done = toy.run("--set", "left.pause_s=0.7", "--force", "left")
    lines = done.err.splitlines()
    said = next(line for line in lines if line.startswith("About 1 s on "))
    assert "left 1 s; quality standard" in said and lines.index(said) < lines.index("2/4 left: starts (forced)")
    kept = done.json["forecast"]
    assert 0.3 < kept["ratio"] < 3 and kept["took"]["seconds"] > 0.7
    toy.ran("--set", "left.pause_s=0.7")
    assert json.loads((toy.out / "run.json").read_text())["forecast"] == kept, "a run with nothing to do keeps the last one"


def test_a_dry_run_tells_it_and_cached_stages_cost_nothing(toy):
    toy.ran()
    told = toy.run("--dry-run", "--force", "join").json["forecast"]
    assert list(told["stages"]) == ["join"] and told["stages"]["join"]["seconds"] < 1
    assert toy.run("--dry-run").json["forecast"]["seconds"] == 0


def test_a_run_with_nothing_to_do_does_not_even_load_it(toy):
    loads = [toy.run(PYTHONPROFILEIMPORTTIME="1").err.count("gsac.pipeline.cost_") for _ in range(2)]
    assert loads == [2, 0]


def test_telling_it_loads_nothing_heavy(toy):
    err = toy.run(PYTHONPROFILEIMPORTTIME="1").err
    loaded = {line.rsplit("|", 1)[1].strip() for line in err.splitlines() if line.startswith("import time:")}
    assert not loaded & {"numpy", "av", "cv2", "numba", "scipy", "torch", "PIL"}
