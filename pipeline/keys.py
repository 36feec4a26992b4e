"""Keys of stages: inputs, parameters, code, model files, package versions and device, gathered."""

from __future__ import annotations

import importlib.util
import os
from functools import cached_property
from pathlib import Path
from typing import Any

from gsac.cache.code import code_parts
from gsac.cache.key import KeyParts
from gsac.cache.store import Store
from gsac.pipeline.models import Models
from gsac.pipeline.packages import package_version
from gsac.pipeline.params import plain
from gsac.pipeline.project import Project
from gsac.stages.contract import BadInput

DEVICE = "GSAC_DEVICE"
"""Environment variable: `cpu` or `cuda`, instead of what is found."""
DEVICES = ("cpu", "cuda")


class Keys:
    """Makes KeyParts for one project, one set of parameters and one machine."""

    def __init__(self, project: Project, configs: dict[str, Any], store: Store):
        self.project = project
        self.configs = configs
        self.models = Models(store)
        self.memo = store.memo

    @cached_property
    def device(self) -> str:
        return device_class()

    def parts(self, name: str, inputs: dict[str, str]) -> KeyParts:
        """inputs: port -> tree digest."""
        stage = self.project.stage(name)
        config = self.configs[name]
        return KeyParts(
            stage=name,
            inputs=dict(inputs),
            params=plain(config),
            code=code_parts(self.project.entry(name), stage.code, self.memo),
            models={model: self.models.sha256(model) for model in stage.models(config)},
            packages={package: package_version(package) for package in stage.packages},
            device=self.device if stage.uses_device else "",
        )


def device_class() -> str:
    """`cuda` where both the driver and the [gpu] extra are there, else `cpu`; GSAC_DEVICE overrules."""
    named = os.environ.get(DEVICE)
    if named and named not in DEVICES:
        raise BadInput(f"{DEVICE}={named}: unknown device; choices: {', '.join(DEVICES)}")
    if named:
        return named
    return "cuda" if Path("/dev/nvidiactl").exists() and importlib.util.find_spec("cuda") is not None else "cpu"
