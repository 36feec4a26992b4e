"""The presets of `--quality`: one word that sets parameters of several stages, below --params and --set."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gsac.pipeline.keys import AUTO, device_class
from gsac.pipeline.params import Values, resolve
from gsac.pipeline.project import Project
from gsac.stages.contract import BadInput, did_you_mean

TRAIN = "train"
"""The stage whose device decides what a preset may ask for."""


@dataclass(frozen=True)
class Quality:
    """One preset."""

    name: str
    sentence: str
    values: Values = field(default_factory=dict)
    """What it sets; all else keeps its default."""
    on_gpu: Values = field(default_factory=dict)
    """What it sets besides, or otherwise, where training runs on a GPU."""

    def on(self, device: str) -> Values:
        """What it sets where training runs on a device class (cpu, cuda)."""
        more = self.on_gpu if device == "cuda" else {}
        return {stage: self.values.get(stage, {}) | more.get(stage, {}) for stage in self.values | more}


STANDARD = "standard"
QUALITIES = {quality.name: quality for quality in (
    Quality("draft", "a first look, to see whether the clip is good: few frames, small images",
            {"split": {"count": 40}, "train": {"height": 540, "steps": 700, "gaussians": 6000}}),
    Quality(STANDARD, "every parameter as in params.yaml"),
    Quality("fine", "the most that the clip gives, for several times the time",
            {"split": {"max_height": 1920}, "train": {"steps": 4000}},
            {"train": {"steps": 6000, "gaussians": 25000}}),
)}


def find_quality(name: str) -> Quality:
    """The preset of a name. BadInput names the choices."""
    if name not in QUALITIES:
        raise BadInput(f"--quality {name}: unknown{did_you_mean(name, QUALITIES)}; choices: {', '.join(QUALITIES)}")
    return QUALITIES[name]


def resolve_quality(name: str, project: Project, file: Path | None = None, sets: Iterable[str] = (),
                    options: Mapping[str, Values] | None = None) -> dict[str, Any]:
    """Config instance of every stage, as `params.resolve` gives it, on top of a preset's values."""
    quality, sets = find_quality(name), tuple(sets)

    def resolved(device: str) -> dict[str, Any]:
        known = {stage: values for stage, values in quality.on(device).items() if stage in project.graph.steps}
        return resolve(project, file, sets, options=options, below={f"--quality {name}": known})

    configs = resolved("cpu")
    return resolved("cuda") if quality.on_gpu and training_device(configs) == "cuda" else configs


def training_device(configs: Mapping[str, Any]) -> str:
    """Device class (cpu, cuda) that training is given: by its parameter, else this machine's."""
    wanted = getattr(configs.get(TRAIN), "device", AUTO)
    return device_class() if wanted == AUTO else wanted


def quality_entry(name: str, configs: Mapping[str, Any]) -> dict[str, Any]:
    """Entry `quality` of run.json: the preset's name, and in `otherwise` names `stage.key` among those that presets set whose
    values are not this preset's, since --params or --set gave them."""
    wanted, otherwise = find_quality(name).on(training_device(configs)), []
    for stage, key in dial_names():
        if stage in configs:
            config = configs[stage]
            if getattr(config, key) != wanted.get(stage, {}).get(key, getattr(type(config)(), key)):
                otherwise.append(f"{stage}.{key}")
    return {"name": name, "otherwise": otherwise}


def name_of(entry: Any) -> str:
    """The preset's name; empty of what is no entry of `quality_entry`, or of a preset that is gone."""
    name = entry.get("name") if isinstance(entry, dict) else None
    return name if isinstance(name, str) and name in QUALITIES else ""


def describe_quality(entry: Any) -> str:
    """`draft`, or `draft, but for train.steps`; empty where there is no name."""
    name, otherwise = name_of(entry), entry.get("otherwise") if isinstance(entry, dict) else None
    names = ", ".join(map(str, otherwise)) if isinstance(otherwise, list) else ""
    return f"{name}, but for {names}" if name and names else name


def dial_names() -> list[tuple[str, str]]:
    """Stage and parameter of all that some preset sets."""
    every = [values for quality in QUALITIES.values() for values in (quality.values, quality.on_gpu)]
    return list(dict.fromkeys((stage, key) for values in every for stage, keys in values.items() for key in keys))
