"""The contract of a stage: what it declares, what it is handed, and how it fails.

A stage folder holds `__init__.py` with one `STAGE = Stage(...)` and no heavy import, and `stage.py` with one
`run(job: Job) -> None`. The engine reads `STAGE`, builds the cache key, and calls `run` with read-only inputs and a private
output folder. A stage never imports another stage, the engine or the cache. `stage.py` may also hold `warm(device: str) -> None`,
which prepares what does not depend on the inputs; it is called in the process that will run, and results must not depend on it.
"""

from __future__ import annotations

import contextlib
import math
import typing
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gsac.stages.findings import Finding  # it loads numpy


@dataclass(frozen=True)
class Output:
    """One declared output: a file or folder of the stage's output folder."""

    path: str
    """Relative path, e.g. `keypoints.npz` or `frames`."""
    check: Callable[[Path], object]
    """Raises `avatar.artifacts.ArtifactError` when the file or folder is not what the port promises."""


@dataclass(frozen=True)
class Stage:
    """The declaration of one step; `dvc.yaml` declares the same, and a test compares the two."""

    name: str
    inputs: tuple[str, ...]
    """Ports that it reads, `<stage>/<output path>`; the source clip is the port `clip`."""
    outputs: tuple[Output, ...]
    config: type
    """Dataclass; its fields are the parameters `<stage>.<field>`, its defaults are params.yaml's."""
    packages: tuple[str, ...] = ()
    """Distributions whose version is part of the key, Python's own beside them: all that its process loads and that may decide a
    number."""
    packages_on: Callable[[str], tuple[str, ...]] = lambda device: ()
    """Those that it loads besides on a device class (cpu, cuda)."""
    programs: Callable[[], dict[str, str]] = dict
    """Programs that it runs, name -> path; their digests are part of the key."""
    models: Callable[[Any], tuple[str, ...]] = lambda config: ()
    """Names of the model files that this configuration needs (`avatar.network_files`); their digests are part of the key."""
    wishes: Callable[[Any], tuple[str, ...]] = lambda config: ()
    """Names of model files that are used if they are here, brought or pulled; then their digests are part of the key too."""
    any_of: Callable[[Any], tuple[str, ...]] = lambda config: ()
    """Names among the wishes of which this configuration needs at least one."""
    check_on: Callable[[Any, str], None] = lambda config, device: None
    """Raises BadInput where this configuration cannot be met on a device class (cpu, cuda); called before anything runs."""
    uses_device: Callable[[Any], bool] = lambda config: False
    """Whether this configuration's result depends on the device class (cpu, cuda), which then is part of the key."""
    code: tuple[str, ...] = ()
    """First-party modules that its result depends on beside those found from its imports."""


@dataclass
class Job:
    """All that `run` is handed."""

    inputs: dict[str, Path]
    """Port -> read-only file or folder."""
    out: Path
    """Private, empty, writable folder; everything the stage declares is written here."""
    config: Any
    """Instance of the stage's config dataclass."""
    models: dict[str, Path] = field(default_factory=dict)
    """Model name -> file; a wish that is not here is not among them."""
    scratch: Path | None = None
    """Folder that is kept when a run is killed or stopped, for the next run of the same key; the stage makes it when it has
    something to keep. None: nothing is kept."""
    resumed: Callable[[int, int, str], None] = lambda done, total, what: None
    """Tells that it goes on from what a stopped run left in `scratch`: done, total, unit."""
    device: str = "cpu"
    progress: Callable[[int, int, str], None] = lambda done, total, what: None
    """Reports progress: done, total, unit (`frames`, `steps`)."""
    warn: Callable[[Finding], None] = lambda finding: None
    """Warns the user; kept in the cache record and the report."""
    note: Callable[[str], None] = lambda message: None
    """Tells the user what holds for nearly every clip and is no fault of this one; kept as warnings are."""
    timing: Callable[[str, Any], None] = lambda name, value: None
    """Tells a figure that another run of equal inputs would not repeat: name, and seconds, or a list of rows with seconds; kept in
    the cache record, in no output."""


class StageError(Exception):
    """A stage cannot give a right result. The message says what failed, where, and what to do (exit code 1)."""


class BadInput(StageError):  # noqa: N818, reads as what the user did
    """The user's file or parameter is at fault (exit code 2)."""


def make_config(stage: Stage, values: dict[str, Any]) -> Any:
    """The stage's config from parameter values; raises `BadInput` that names an unknown parameter or a wrong value."""
    known = typing.get_type_hints(stage.config)
    for name in values:
        if name not in known:
            raise BadInput(f"unknown parameter {stage.name}.{name}{did_you_mean(name, known, f'{stage.name}.')}; "
                           f"known: {', '.join(sorted(known)) or 'none'}")
    config = stage.config(**{name: _typed(f"{stage.name}.{name}", v, known[name]) for name, v in values.items()})
    check = getattr(config, "check", None)
    if check is not None:
        check()
    return config


def did_you_mean(word: str, known: Iterable[str], before: str = "") -> str:
    """` (did you mean train?)` for a word that is nearly a known one, else empty. before: put in front of the suggestion."""
    import difflib

    near = difflib.get_close_matches(word, list(known), n=1)
    return f" (did you mean {before}{near[0]}?)" if near else ""


def _typed(name: str, value: Any, hint: Any) -> Any:
    """The value as the field's type, or one of its `Literal`'s; 1 becomes 1.0 for a float, YAML 1.1's text `4e-4` a number."""
    kinds = typing.get_args(hint) or (hint,)
    if typing.get_origin(hint) is typing.Literal:
        if value not in kinds:
            raise BadInput(f"{name} is {value!r}; choices: {', '.join(map(str, kinds))}")
        return value
    if float in kinds and isinstance(value, (int, str)) and not isinstance(value, bool):
        with contextlib.suppress(ValueError):
            value = float(value)
    if isinstance(value, float) and not math.isfinite(value):
        raise BadInput(f"parameter {name} is {value!r}; expected a finite number")
    if type(value) in kinds:
        return value
    words = " or ".join("null" if k is type(None) else k.__name__ for k in kinds)
    raise BadInput(f"parameter {name} is {value!r}; expected {words}")
