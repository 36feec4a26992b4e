"""The key of a result, made of everything it depends on; and the specification of every hash in the store.

All digests are sha256 in lower-case hex. Each pre-image except that of a plain file starts with its kind and version,
so no two kinds of thing can collide by having the same bytes:

    file      sha256(content)                                    (what `sha256sum` and S3 say)
    text      sha256("gsac text 1\\n" + UTF-8)
    tree      sha256("gsac tree 1\\n" + canonical({relative path: [file digest, size]}))
    module    sha256("gsac module 1\\n" + canonical(normalised syntax tree))        (see `code`)
    code      sha256("gsac code 1\\n" + canonical({module: module digest, module/file: file digest}))
    action    sha256("gsac action 1\\n" + canonical(KeyParts as a JSON object))     (the key)

canonical(x) is JSON with sorted keys, no spaces, ASCII escapes and floats as Python's shortest repr; NaN and infinity
are refused. A single file's tree has the one entry "", so a file's own name never counts; names inside a folder do.
Inputs are keyed by port name, never as a sorted bag: swapped inputs are different inputs. The clip's name, paths,
thread counts and dates are not in the key, so equal content is shared.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache, cached_property
from typing import Any

from gsac.cache.digest import canonical, typed_digest
from gsac.cache.errors import CacheError

KEY_VERSION = 1
ABSENT = None


class ChangeKind(enum.Enum):
    """Which part of a key changed; the value is the word that the user reads."""

    STAGE = "stage"
    INPUT = "input"
    PARAM = "parameter"
    CODE = "code"
    MODEL = "model file"
    PACKAGE = "package"
    DEVICE = "device"


@dataclass(frozen=True)
class Change:
    """One difference between two keys; before or after is None where the name is on one side only."""

    kind: ChangeKind
    name: str
    before: Any
    after: Any
    added: bool = False
    removed: bool = False

    @property
    def sentence(self) -> str:
        what = self.kind.value if self.name == self.kind.value else f"{self.kind.value} {self.name}"
        if self.kind in (ChangeKind.PARAM, ChangeKind.PACKAGE, ChangeKind.DEVICE, ChangeKind.STAGE):
            before, after = repr(self.before), repr(self.after)
        else:
            before, after = str(self.before)[:12], str(self.after)[:12]
        if self.added:
            return f"{what} is new ({after})"
        if self.removed:
            return f"{what} is no longer used (was {before})"
        return f"{what} changed from {before} to {after}"


@dataclass(frozen=True)
class KeyParts:
    """Everything that a stage's result may depend on. Not to be changed once made: its key is computed once."""

    stage: str
    inputs: dict[str, str] = field(default_factory=dict)
    """Port -> tree digest."""
    params: dict[str, Any] = field(default_factory=dict)
    """The parameters that the stage reads; plain JSON values."""
    code: dict[str, str] = field(default_factory=dict)
    """First-party module -> digest of its normalised syntax tree."""
    models: dict[str, str] = field(default_factory=dict)
    """Model file's name -> sha256."""
    packages: dict[str, str] = field(default_factory=dict)
    """Declared distribution -> version; the interpreter -> version, and programs that are run -> digest, beside them."""
    device: str = ""
    """Device class (cpu, cuda) where the stage says that it matters, else empty."""

    @cached_property
    def key(self) -> str:
        """The action digest. CacheError names a parameter that JSON cannot hold."""
        try:
            return typed_digest(f"action {KEY_VERSION}", self._whole())
        except (TypeError, ValueError):
            for name, value in self.params.items():
                if not _plain(value):
                    raise CacheError(f"parameter {self.stage}.{name} = {value!r} is not a plain finite value") from None
            raise

    def _whole(self) -> bytes:
        """The canonical JSON of all parts, of those that are written out already where some are."""
        if not self._texts:
            return canonical({name: getattr(self, name) for name in _names()})
        return b"{" + b",".join(f'"{name}":'.encode() + self._text(name) for name in _names()) + b"}"

    def _text(self, name: str) -> bytes:
        texts = self._texts
        if name not in texts:
            texts[name] = canonical(getattr(self, name))
        return texts[name]

    @cached_property
    def _texts(self) -> dict[str, bytes]:
        """Part -> its canonical JSON, as far as written out."""
        return {}

    def with_inputs(self, inputs: dict[str, str]) -> KeyParts:
        """The same of other inputs (port -> tree digest); what the two share is written out once."""
        other = replace(self, inputs=inputs)
        other._texts.update((name, self._text(name)) for name in _names() if name != "inputs")
        return other

    def diff(self, other: KeyParts) -> list[Change]:
        """What changes from self (before) to other (after), in the order of the key's parts."""
        changes = []
        if self.stage != other.stage:
            changes.append(Change(ChangeKind.STAGE, "stage", self.stage, other.stage))
        for kind, before, after in (
            (ChangeKind.INPUT, self.inputs, other.inputs),
            (ChangeKind.PARAM, _named(self.stage, self.params), _named(other.stage, other.params)),
            (ChangeKind.CODE, self.code, other.code),
            (ChangeKind.MODEL, self.models, other.models),
            (ChangeKind.PACKAGE, self.packages, other.packages),
        ):
            for name in sorted({*before, *after}):
                if name not in before:
                    changes.append(Change(kind, name, ABSENT, after[name], added=True))
                elif name not in after:
                    changes.append(Change(kind, name, before[name], ABSENT, removed=True))
                elif canonical(before[name]) != canonical(after[name]):
                    changes.append(Change(kind, name, before[name], after[name]))
        if self.device != other.device:
            changes.append(Change(ChangeKind.DEVICE, "device", self.device, other.device))
        return changes


@cache
def _names() -> list[str]:
    """The parts' names in the order of canonical JSON."""
    return sorted(one.name for one in fields(KeyParts))


def _named(stage: str, params: Mapping[str, Any]) -> dict[str, Any]:
    return {f"{stage}.{name}": value for name, value in params.items()}


def _plain(value: Any) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, (list, tuple)):
        return all(map(_plain, value))
    if isinstance(value, dict):
        return all(isinstance(k, str) and _plain(v) for k, v in value.items())
    return value is None or isinstance(value, (str, int, bool))
