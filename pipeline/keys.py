"""Gathers a stage's key: inputs, parameters, code, model files, package versions and device."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Iterable
from functools import cached_property
from pathlib import Path
from typing import Any

from gsac.avatar.cuda import DEVICE, why_not
from gsac.cache.code import code_parts
from gsac.cache.digest import file_digest
from gsac.cache.key import KeyParts
from gsac.cache.store import Store
from gsac.pipeline.model_store import ModelStore, Say
from gsac.pipeline.params import config_values
from gsac.pipeline.project import Project
from gsac.pipeline.versions import ABSENT, PYTHON, package_version, python_version
from gsac.stages.contract import BadInput, Stage

DEVICES = ("cpu", "cuda")
AUTO = "auto"
"""Value of a stage's parameter `device` that leaves the choice to the engine."""
BODY = "body_model"
"""Parameter of every stage that works with a body model."""


class Keys:
    """Makes KeyParts for one project, one set of parameters and one machine."""

    def __init__(self, project: Project, configs: dict[str, Any], store: Store):
        self.project = project
        self.configs = configs
        self.models = ModelStore(store)
        self.memo = store.memo

    @cached_property
    def device(self) -> str:
        """The device class of this machine."""
        return device_class()

    def device_of(self, name: str) -> str:
        """The device class that the stage computes on: its parameter `device`, or this machine's where that is `auto`.

        Empty where the result does not depend on it. BadInput where the parameter names a device that is not there.
        """
        if not self.project.stage(name).uses_device(self.configs[name]):
            return ""
        wanted = getattr(self.configs[name], "device", AUTO)
        if wanted == "cuda" != self.device:
            why = f"{DEVICE} is cpu" if os.environ.get(DEVICE) else why_not()
            raise BadInput(f"{name}.device is cuda, but {why}; or set {name}.device to auto")
        return self.device if wanted == AUTO else wanted

    def check(self, names: Iterable[str]) -> None:
        """Raises BadInput where a stage of a run asks for a device or a model file that is not there, before anything runs."""
        names = list(names)
        for name in names:
            stage, config = self.project.stage(name), self.configs[name]
            stage.check_on(config, self.device_of(name) or self.device)
            for model in stage.models(config):
                self._check_model(stage, config, model)
            one_of = stage.any_of(config)
            if one_of and not any(model in self.models.brought for model in one_of):
                raise BadInput(f"{_asked_by(stage, config, stage.any_of, one_of[0])}none of {' and '.join(one_of)} is here; bring "
                               f"one with `gsac models add {one_of[0]} FILE`")
        self._check_bodies(names)

    def pull_models(self, names: Iterable[str], say: Say) -> None:
        """Pulls the networks that are not here and that the stages need, where they can be kept."""
        missing = self.missing_models(names)
        if missing and self.models.writable:
            self.models.pull(missing, say)

    def missing_models(self, names: Iterable[str]) -> list[str]:
        """Model files that the stages need and that are not here."""
        needed = dict.fromkeys(model for name in names for model in self._models(self.project.stage(name), self.configs[name]))
        return [model for model in needed if not self.models.is_here(model)]

    def _check_model(self, stage: Stage, config: Any, model: str) -> None:
        try:
            self.models.sha256(model)
        except BadInput as error:
            raise BadInput(f"{_asked_by(stage, config, stage.models, model)}{error}") from error
        if model in self.models.brought and not self.models.is_here(model):
            raise BadInput(f"{_asked_by(stage, config, stage.models, model)}the file that you brought as {model} is gone from "
                           f"{self.models.path(model)}; bring it again with `gsac models add {model} FILE`")

    def _check_bodies(self, names: list[str]) -> None:
        """BadInput unless all stages of a run that have a body are given the same one."""
        given = {name: self.configs[name].body_model for name in names if hasattr(self.configs[name], BODY)}
        digests = {self.models.sha256(body) if body in self.models.brought else body for body in given.values()}
        if len(digests) > 1:
            told = ", ".join(f"{name}.{BODY} is {body}" for name, body in given.items())
            raise BadInput(f"{told}; give all the same, for short by `--body NAME`")

    def _models(self, stage: Stage, config: Any) -> list[str]:
        """Model files that the stage needs, and optional ones that can be had without a pull."""
        return [*stage.models(config), *(name for name in stage.wishes(config) if self.models.has(name))]

    def _versions(self, stage: Stage, device: str) -> dict[str, str]:
        """Of Python, and of the packages and programs that the stage computes with."""
        versions = {PYTHON: python_version()}
        versions |= {package: package_version(package) for package in (*stage.packages, *stage.packages_on(device))}
        return versions | {name: self._program_version(Path(path)) for name, path in stage.programs().items()}

    def _program_version(self, path: Path) -> str:
        return f"sha256 {file_digest(path, self.memo)[:16]}" if path.is_file() else ABSENT

    def code(self, name: str) -> dict[str, str]:
        """Digests of our modules and files that the stage's result depends on."""
        return code_parts(self.project.entry(name), self.project.stage(name).code, self.memo)

    def parts(self, name: str, inputs: dict[str, str]) -> KeyParts:
        """The key's parts of a stage. inputs: port -> tree digest."""
        return self.shared_parts(name).with_inputs(dict(inputs))

    def shared_parts(self, name: str) -> KeyParts:
        """The key's parts of a stage but its inputs: those that all clips share."""
        stage = self.project.stage(name)
        config, device = self.configs[name], self.device_of(name)
        params = config_values(config)
        if device:
            params.pop("device", None)  # the device that was chosen counts, not how
        return KeyParts(
            stage=name,
            params=params,
            code=self.code(name),
            models={model: self.models.sha256(model) for model in self._models(stage, config)},
            packages=self._versions(stage, device),
            device=device,
        )


class KeysOfOneMoment(Keys):
    """The same for many clips that are judged together: what their keys share is looked at once."""

    def __init__(self, project: Project, configs: dict[str, Any], store: Store):
        super().__init__(project, configs, store)
        self._shared: dict[str, KeyParts] = {}

    def shared_parts(self, name: str) -> KeyParts:
        if name not in self._shared:
            self._shared[name] = super().shared_parts(name)
        return self._shared[name]


def _asked_by(stage: Stage, config: Any, names: Callable[[Any], tuple[str, ...]], model: str) -> str:
    """`train.lpips is loss: `, the parameter by which a configuration comes to name a model file."""
    default = stage.config()
    for parameter, value in config_values(config).items():
        plain = getattr(default, parameter)
        if value != plain and model not in names(dataclasses.replace(config, **{parameter: plain})):
            return f"{stage.name}.{parameter} is {value}: "
    return f"stage {stage.name}: "


def device_class() -> str:
    """`cuda` where a GPU can be used, else `cpu`; GSAC_DEVICE overrules."""
    named = os.environ.get(DEVICE)
    if named and named not in DEVICES:
        raise BadInput(f"{DEVICE}={named}: unknown device; choices: {', '.join(DEVICES)}")
    return named or ("cpu" if why_not() else "cuda")
