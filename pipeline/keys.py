"""Gathers a stage's key: inputs, parameters, code, model files, package versions and device."""

from __future__ import annotations

import os
from functools import cached_property
from typing import Any

from gsac.avatar.cuda import why_not
from gsac.cache.code import code_parts
from gsac.cache.key import KeyParts
from gsac.cache.store import Store
from gsac.pipeline.model_store import ModelStore
from gsac.pipeline.params import config_values
from gsac.pipeline.project import Project
from gsac.pipeline.versions import package_version
from gsac.stages.contract import BadInput, Stage

DEVICE = "GSAC_DEVICE"
"""Environment variable: `cpu` or `cuda`, instead of the device that is found."""
DEVICES = ("cpu", "cuda")
AUTO = "auto"
"""Value of a stage's parameter `device` that leaves the choice to the engine."""


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
        if not self.project.stage(name).uses_device:
            return ""
        wanted = getattr(self.configs[name], "device", AUTO)
        if wanted == "cuda" != self.device:
            why = f"{DEVICE} is cpu" if os.environ.get(DEVICE) else why_not()
            raise BadInput(f"{name}.device is cuda, but {why}; or set {name}.device to auto")
        return self.device if wanted == AUTO else wanted

    def _models(self, stage: Stage, config: Any) -> list[str]:
        """Model files that the stage needs, and optional ones that the user has added."""
        return [*stage.models(config), *(name for name in stage.wishes(config) if name in self.models.brought)]

    def code(self, name: str) -> dict[str, str]:
        """Digests of our modules and files that the stage's result depends on."""
        return code_parts(self.project.entry(name), self.project.stage(name).code, self.memo)

    def parts(self, name: str, inputs: dict[str, str]) -> KeyParts:
        """The key's parts of a stage. inputs: port -> tree digest."""
        stage = self.project.stage(name)
        config, device = self.configs[name], self.device_of(name)
        params = config_values(config)
        if device:
            params.pop("device", None)  # the device that was chosen counts, not how
        return KeyParts(
            stage=name,
            inputs=dict(inputs),
            params=params,
            code=self.code(name),
            models={model: self.models.sha256(model) for model in self._models(stage, config)},
            packages={package: package_version(package) for package in stage.packages},
            device=device,
        )


def device_class() -> str:
    """`cuda` where a GPU can be used, else `cpu`; GSAC_DEVICE overrules."""
    named = os.environ.get(DEVICE)
    if named and named not in DEVICES:
        raise BadInput(f"{DEVICE}={named}: unknown device; choices: {', '.join(DEVICES)}")
    return named or ("cpu" if why_not() else "cuda")
