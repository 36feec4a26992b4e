"""Reading every byte of the store: what is not what it was is moved to quarantine/, and will be computed again."""

from __future__ import annotations

from dataclasses import dataclass, field

from gsac.cache import objects
from gsac.cache.store import Store


@dataclass
class VerifyReport:
    """What a whole check found; names are `<stage>/<key>` and object names."""

    objects: int = 0
    bytes: int = 0
    damaged: list[str] = field(default_factory=list)
    """Objects whose content is not what their name says."""
    lost: list[str] = field(default_factory=list)
    """Records dropped because an output is damaged or missing, or because they are not whole themselves."""

    @property
    def sound(self) -> bool:
        return not self.damaged and not self.lost


def verify(store: Store) -> VerifyReport:
    """Checks every object and record; after it, every record that is left is whole."""
    report = VerifyReport()
    for path in sorted((store.root / "objects").glob("*/*")):
        digest = path.name[:64]
        report.objects += 1
        if objects.is_sound(path, digest):
            report.bytes += objects.measure(path).bytes
        elif path.exists():  # gc may have taken it meanwhile
            report.damaged.append(path.name)
            store.quarantine(path, digest)
    for file in sorted(store.record_files()):
        if store.lookup(file.stem) is None:
            report.lost.append(f"{file.parent.name}/{file.stem}")
    return report
