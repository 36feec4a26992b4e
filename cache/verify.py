"""Checks every byte of the store; damaged objects are moved to quarantine/ and computed again when needed."""

from __future__ import annotations

from dataclasses import dataclass, field

from gsac.cache import objects
from gsac.cache.store import Store


@dataclass
class VerifyReport:
    """The outcome of a check; records are named `<stage>/<key>`, objects by their file names."""

    objects: int = 0
    bytes: int = 0
    damaged: list[str] = field(default_factory=list)
    """Objects whose content does not have the digest in their name."""
    lost: list[str] = field(default_factory=list)
    """Records dropped because an output is damaged or missing, or because they are torn."""

    @property
    def sound(self) -> bool:
        """Whether nothing was damaged or lost."""
        return not self.damaged and not self.lost


def verify(store: Store) -> VerifyReport:
    """Checks every object and record; every record that is left is sound."""
    report = VerifyReport()
    for path in sorted((store.root / "objects").glob("*/*")):
        digest = path.name[:64]
        report.objects += 1
        footprint = objects.measure(path)
        if footprint is not None and objects.is_sound(path, digest):
            report.bytes += footprint.bytes
        elif path.exists():  # gc may have taken it meanwhile
            report.damaged.append(path.name)
            store.quarantine(path, digest)
    for file in sorted(store.record_files()):
        if store.lookup(file.stem) is None:
            report.lost.append(f"{file.parent.name}/{file.stem}")
    return report
