"""Checks every byte of the store; what is damaged is moved to quarantine/ and made again when needed."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from pathlib import Path

from gsac.cache import objects
from gsac.cache.digest import plain_digest
from gsac.cache.key import KeyParts
from gsac.cache.record import Record, is_digest, is_of_other_version
from gsac.cache.store import DIGITS, Store, read_text


@dataclass
class VerifyReport:
    """The outcome of a check; records are named `<stage>/<key>`, objects by their file names."""

    objects: int = 0
    bytes: int = 0
    models: int = 0
    damaged: list[str] = field(default_factory=list)
    """Objects whose content does not have the digest in their name."""
    damaged_models: list[str] = field(default_factory=list)
    """Model files, likewise."""
    lost: list[str] = field(default_factory=list)
    """Records dropped because an output is damaged or missing, or because they are not as they were written."""
    derived: list[str] = field(default_factory=list)
    """Records dropped because a damaged object was an input, and may have been damaged when it was read."""

    @property
    def sound(self) -> bool:
        """Whether nothing was damaged or lost."""
        return not (self.damaged or self.damaged_models or self.lost or self.derived)


def verify(store: Store, declared: Callable[[KeyParts], Collection[str] | None] = lambda parts: None) -> VerifyReport:
    """Checks every object, model file and record; every record that is left is sound, and of sound inputs.

    declared: outputs that a result of this key must have, None where that is not known. What is made of a dropped result has
    that result's content in its key, and so stays right. Records of another version of gsac are left to gc.
    """
    report = VerifyReport()
    for path in sorted((store.root / "objects").glob("*/*")):
        report.objects += 1
        footprint = objects.measure(path)
        if footprint is not None and objects.is_sound(path, path.name[:DIGITS]):
            report.bytes += footprint.bytes
        elif path.exists() or path.is_symlink():  # gc may have taken it meanwhile
            report.damaged.append(path.name)
            store.quarantine(path, path.name[:DIGITS])
    for path in sorted((store.root / "models").glob("*/[!.]*")):
        if is_digest(path.parent.name):
            report.models += 1
            _check_model(store, path, report)
    damaged = {name[:DIGITS] for name in report.damaged}
    for file in sorted(store.record_files()):
        text = read_text(file)
        record = store.sound(file, text)
        if record is None and is_of_other_version(text):
            continue
        title = f"{file.parent.name}/{file.stem}"
        if record is None or not _holds(store, record, declared(record.parts)):
            report.lost.append(title)
        elif not damaged.isdisjoint(record.parts.inputs.values()):
            report.derived.append(title)
        else:
            continue
        store.drop_unchanged(file, text)
    return report


def _holds(store: Store, record: Record, declared: Collection[str] | None) -> bool:
    """Whether a record names the declared outputs, and all are there."""
    named = declared is None or record.outputs.keys() == set(declared)
    return named and all(objects.object_path(store.root, digest, output).exists() for output, digest in record.outputs.items())


def _check_model(store: Store, path: Path, report: VerifyReport) -> None:
    """A model, a file or a folder of several, lies in a folder that is named by its digest."""
    if path.exists() and plain_digest(path, objects.NO_MEMO) == path.parent.name:
        return
    report.damaged_models.append(path.name)
    try:
        store.say(f"the model file {path.name} was damaged: moved to {store.set_aside(path)}")
    except OSError as error:
        store.say(f"the model file {path} is damaged and cannot be moved away ({error.strerror})")
