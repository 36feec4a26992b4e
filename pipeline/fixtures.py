"""Fixtures: the inputs of stages as plain files, cut from a finished run, with which a stage is replayed elsewhere.

    clip  params.yaml  <stage>/<output>
    manifest.json           digest of each of them; each stage's command line and, where they are known, its outputs' digests
"""

from __future__ import annotations

import json
import shlex
from collections import Counter
from pathlib import Path
from typing import Any

from gsac.avatar.artifacts import Clip, frame_paths
from gsac.avatar.frame_files import image_size
from gsac.avatar.frame_range import CLIP_FILE, copy_frames, count_frames
from gsac.cache.digest import tree_digest
from gsac.pipeline.graph import CLIP
from gsac.pipeline.params import config_values, resolve, to_yaml
from gsac.pipeline.project import Project
from gsac.pipeline.rows import read_rows, result_row
from gsac.pipeline.run_folder import PARAMS, RunFolder
from gsac.pipeline.versions import package_version
from gsac.stages.contract import BadInput
from gsac.stages.counting import counted

MANIFEST = "manifest.json"
REPLAYS = "replay"
"""Folder beside the fixtures into which the manifest's command lines write."""


def cut_fixtures(run: RunFolder, project: Project, folder: Path, frames: int | None = None) -> dict[str, Any]:
    """Writes the inputs of every stage that a run has into an empty folder; returns what its manifest holds.

    frames: the first so many only, of all artifacts but the clip itself; None: all. BadInput where the run has none.
    """
    steps = [step for step in project.graph.steps.values() if all(run.path(port).exists() for port in step.deps)]
    if not steps:
        raise BadInput(f"{run.root} holds neither its clip nor a stage's outputs; `gsac run CLIP --out {run.root}` makes them")
    ports = dict.fromkeys(port for step in steps for port in step.deps)
    held = [count for port in ports if port != CLIP and (count := count_frames(run.path(port))) is not None]
    if frames is not None and held and frames > held[0]:
        raise BadInput(f"--frames {frames}: the run has {counted(held[0], 'frame')}; leave --frames out to keep all")
    digests = {}
    for port in ports:
        copy_frames(run.require(port), folder / port, None if port == CLIP else frames)
        digests[port] = tree_digest(folder / port)[0]
    configs = resolve(project, run.params)
    (folder / PARAMS).write_text(to_yaml(configs, notes=False))
    rows = {name: result_row(row) or {} for name, row in read_rows(run).items()}
    stages = {}
    for step in steps:
        row = rows.get(step.name, {})
        same = row.get("inputs") == {port: digests[port] for port in step.deps} and row.get("params") == config_values(
            configs[step.name])
        stages[step.name] = {"command": replay_command(step.name), "outputs": row["outputs"] if same else None}
    manifest = {"gsac": package_version("gsac"), "frames": frames, "inputs": digests, "stages": stages}
    (folder / MANIFEST).write_text(json.dumps(manifest, indent=1) + "\n")
    return manifest


def replay_command(name: str) -> str:
    """The command line that replays a stage, for a shell in the folder of the fixtures."""
    return shlex.join(["gsac", "stage", name, "--inputs", ".", "--out", f"{REPLAYS}/{name}", "--params", PARAMS, "--json"])


def fixture_paths(project: Project, name: str, folder: Path) -> dict[str, Path]:
    """Port -> path under the folder of artifacts, each checked as the stage that makes it declares, and that all speak of as many
    frames of one size."""
    graph = project.graph
    paths = {}
    for port in graph.step(name).deps:
        path = (folder / port).resolve()
        if not path.exists():
            raise BadInput(f"{folder / port}: missing; stage {name} reads {', '.join(graph.step(name).deps)}")
        if port != CLIP:
            maker = graph.producer[port]
            output = next(o for o in project.stage(maker).outputs if port == f"{maker}/{o.path}")
            try:
                output.check(path)
            except Exception as error:
                raise BadInput(f"{folder / port} is not what {port} promises: {error}") from error
        paths[port] = path
    made = {port: folder / port for port in paths if port != CLIP}
    _check_lengths(made)
    _check_sizes(made)
    return paths


def _check_lengths(made: dict[str, Path]) -> None:
    counts = {port: count for port, path in made.items() if (count := count_frames(path)) is not None}
    for most, _ in Counter(counts.values()).most_common(1):
        others = ", ".join(port for port in counts if counts[port] == most)
        for port, count in counts.items():
            if count != most:
                raise BadInput(f"{made[port]} speaks of {count} frames, but {others} of {most}; take all from one run")


def _check_sizes(made: dict[str, Path]) -> None:
    images = [image for path in made.values() if path.is_dir() for image in frame_paths(path)]
    sizes = {path: (clip.width, clip.height) for path in made.values() if path.name == CLIP_FILE for clip in [Clip.read(path)]}
    sizes |= {image: image_size(image) for image in images}
    for most, _ in Counter(sizes.values()).most_common(1):
        for path, (width, height) in sizes.items():
            if (width, height) != most:
                raise BadInput(f"{path} is of {width}x{height} px, others of {most[0]}x{most[1]}; take all from one run")
