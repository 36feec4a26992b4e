"""What is shipped agrees with itself: dvc.yaml, the stages' declarations, params.yaml, the compose file, the imports."""

import importlib
import os
import re
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from gsac.cache.code import code_parts
from gsac.pipeline.graph import Graph
from gsac.pipeline.params import defaults_yaml, meanings
from gsac.pipeline.project import Project, check_agreement, shipped_dag

ROOT = shipped_dag().parent
STAGES = list(Graph.load(shipped_dag()).steps)
PROJECT = Project("gsac.stages", shipped_dag())


@pytest.mark.parametrize("name", STAGES)
def test_dvc_yaml_and_the_stages_declaration_say_the_same(name):
    stage = importlib.import_module(f"gsac.stages.{name}").STAGE
    check_agreement(PROJECT.graph.step(name), stage)
    assert PROJECT.graph.step(name).params == (name,)


@pytest.mark.parametrize("name", STAGES)
def test_every_parameter_has_a_line_of_meaning_and_defaults_that_pass(name):
    config = PROJECT.stage(name).config
    instance = config()
    if hasattr(instance, "check"):
        instance.check()
    assert meanings(config).keys() == vars(instance).keys()


def test_params_yaml_holds_the_defaults_of_the_dataclasses():
    assert (ROOT / "params.yaml").read_text() == defaults_yaml(PROJECT), "run `make params`"


def test_the_yaml_beside_the_engine_is_the_one_at_the_top():
    assert (ROOT / "pipeline" / "dvc.yaml").read_text() == (ROOT / "dvc.yaml").read_text()


@pytest.mark.parametrize("name", STAGES)
def test_declarations_are_light_and_stages_import_neither_engine_nor_cache_nor_each_other(name):
    script = f"import sys, gsac.stages.{name}; print(' '.join(sys.modules))"
    loaded = subprocess.run([sys.executable, "-P", "-c", script], capture_output=True, text=True, check=True).stdout.split()
    assert not {"torch", "cv2", "numba", "scipy", "onnxruntime", "OpenEXR"} & set(loaded)
    closure = code_parts(f"gsac.stages.{name}.stage", PROJECT.stage(name).code)
    others = "|".join(other for other in STAGES if other != name)
    for module in closure:
        assert not re.match(rf"gsac\.(pipeline|cache|benchmarks|stages\.({others}))(\.|$)", module), module


def test_docker_compose_accepts_its_file():
    compose = next((c for c in (["docker", "compose"], ["docker-compose"]) if shutil.which(c[0]) and not subprocess.run(
        [*c, "version"], capture_output=True).returncode), None)
    if compose is None:
        pytest.skip("needs `docker compose` (Debian package docker-compose)")
    done = subprocess.run([*compose, "config"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    services = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"]
    assert set(services) == {"cpu", "gpu", "ray-head", "ray-worker", "batch", "store"}
    for service in (service for service in services.values() if "build" in service):
        dockerfile = (ROOT / service["build"]["dockerfile"]).read_text()
        assert '"batch", "/clips"' in dockerfile and "\nUSER gsac\n" in dockerfile
        assert "GSAC_COPY=1" in dockerfile, "links into the volume /cache lead nowhere on the host"
        assert {volume.rsplit(":ro", 1)[0].rsplit(":", 1)[1] for volume in service["volumes"]} == {"/clips", "/avatars", "/cache"}


def children_cpu(command: list[str], **options) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, capture_output=True, **options)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def test_a_run_of_eight_stages_with_nothing_to_do_costs_at_most_half_a_cpu_second(tmp_path):
    """The real eight declarations, code closures and model names; only the work itself is already in the cache."""
    script = Path(__file__).with_name("fill_store.py")
    clip = tmp_path / "clip.mp4"
    clip.write_bytes(b"clip" * 1000)
    env = os.environ | {"GSAC_CACHE": str(tmp_path / "cache")}
    subprocess.run([sys.executable, "-P", str(script), str(clip)], env=env, check=True)
    command = [str(Path(sys.executable).with_name("gsac")), "run", str(clip), "--out", str(tmp_path / "out"), "--json"]
    subprocess.run(command, env=env, check=True, capture_output=True)
    (tmp_path / "out" / "report.html").write_text("there already")
    costs = [children_cpu(command, env=env)]
    while min(costs) > 0.5 and len(costs) < 15:  # the same run costs a third more while others use the machine
        costs.append(children_cpu(command, env=env))
    assert min(costs) <= 0.5, costs
