"""The folder of one clip: dvc.yaml, params.yaml, `clip`, and the outputs of every stage.

    clip  dvc.yaml  params.yaml  dvc.lock
    <stage>/<output>        link into the store (a copy where links cannot be made)
    export/<output>         the user's own files; .placed.json knows them as they were placed
    logs/<stage>.log        what the stage printed
    run.json  metrics.json  report.html
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from gsac.cache.digest import tree_digest
from gsac.cache.objects import object_name
from gsac.cache.record import Record
from gsac.cache.roots import find_links, register
from gsac.cache.store import Store
from gsac.pipeline.graph import CLIP, Graph
from gsac.pipeline.params import to_yaml
from gsac.pipeline.placing import is_link_to, link, place
from gsac.pipeline.project import Project, shipped_dag
from gsac.stages.contract import BadInput

DAG, LOCK, PARAMS, RUN, METRICS, REPORT = "dvc.yaml", "dvc.lock", "params.yaml", "run.json", "metrics.json", "report.html"
LOGS = "logs"
PLACED = ".placed.json"
"""Port -> tree digest, of the real files that were placed here."""

OWN_STORE = ".store"
"""Holds the results of a run whose cache cannot be written."""


class RunFolder:
    """Paths of one clip's folder."""

    def __init__(self, root: Path):
        self.root = Path(root).absolute()
        self._made: list[Path] = []

    @classmethod
    def around(cls, start: Path) -> RunFolder:
        """The nearest folder with a dvc.yaml, from `start` upwards."""
        start = Path(start).absolute()
        if not start.exists():
            raise BadInput(f"{start}: no such folder; give the folder of a run")
        for folder in (start, *start.parents):
            if (folder / DAG).is_file() and folder != shipped_dag().parent:
                return cls(folder)
        below = sorted(str(run.parent.relative_to(start)) for at in ("*", "*/avatar") for run in start.glob(f"{at}/{RUN}"))
        hint = f"give one of: {', '.join(below)}" if below else "give the folder, or `gsac run` first"
        raise BadInput(f"{start} is not in the output folder of a run: no {DAG} here or above; {hint}")

    @property
    def clip(self) -> Path:
        """The link to the source clip."""
        return self.root / CLIP

    @property
    def clip_name(self) -> str:
        """File or folder name of the source clip, be it there or gone."""
        return Path(os.readlink(self.clip)).name if self.clip.is_symlink() else self.clip.name

    @property
    def params(self) -> Path | None:
        """params.yaml, None without one."""
        path = self.root / PARAMS
        return path if path.is_file() else None

    def project(self, at_hand: Project) -> Project:
        """The stages at hand, joined as this folder's dvc.yaml says."""
        return Project(at_hand.package, self.root / DAG)

    def path(self, port: str) -> Path:
        """Where the folder shows a port."""
        return self.root / port

    def require_clip(self) -> Path:
        """The source clip, links followed."""
        if not self.clip.exists():
            dead = f" (a link to {os.readlink(self.clip)}, which is gone)" if self.clip.is_symlink() else ""
            raise BadInput(f"{self.clip}: no clip here{dead}; `gsac run CLIP --out {self.root}` puts it there")
        return self.clip.resolve()

    def require(self, port: str) -> Path:
        """The file or folder at a port, links followed. BadInput where there is none."""
        if port == CLIP:
            return self.require_clip()
        path = self.path(port)
        if not path.exists():
            maker = port.partition("/")[0]
            raise BadInput(f"{path} is missing; run `gsac stage {maker}` or `gsac run` first")
        return path.resolve()

    def prepare(self, clip: Path, project: Project, configs: dict[str, Any]) -> None:
        """Makes it the folder of this clip and these parameters."""
        self._refuse_foreign(project)
        if clip.is_dir() and clip in (self.root.resolve(), *self.root.resolve().parents):
            raise BadInput(f"--out {self.root} lies in the folder of the photos, which is left as it is; give --out a "
                           "folder elsewhere")
        self._made = [folder for folder in (self.root, *self.root.parents) if not folder.exists()]
        self.root.mkdir(parents=True, exist_ok=True)
        write_text(self.root / DAG, project.dag.read_text())
        write_text(self.root / PARAMS, to_yaml(configs, notes=False))
        if self.clip.is_symlink() or not self.clip.exists():
            if not self.clip.is_symlink() or os.readlink(self.clip) != str(clip):
                link(clip, self.clip)
        elif not self.clip.samefile(clip):
            raise BadInput(f"{self.clip} is there and is not a link; move it away or choose another --out")

    def discard(self) -> None:
        """Removes the folder, where `prepare` has made it and it holds nothing but what a run writes, and those made above it."""
        ours = {CLIP, DAG, LOCK, PARAMS, RUN, METRICS, REPORT, LOGS, PLACED, OWN_STORE}
        for folder in self._made:
            with contextlib.suppress(OSError):
                if folder == self.root and {entry.name for entry in folder.iterdir()} <= ours:
                    shutil.rmtree(folder)
                else:
                    folder.rmdir()

    def place(self, store: Store, record: Record, into: Path | None = None) -> None:
        """Shows a finished stage's outputs in `<stage>/`, or in the folder `into`; gc then keeps what is shown."""
        register(store, self.root)
        before = self._placed()
        after = place(store, record, into or self.root / record.parts.stage, before)
        if after != before:
            self.write_json(PLACED, after)

    def objects(self) -> set[str]:
        """Names of the store's objects that this folder shows, as links or as copies."""
        return {*find_links(self.root).values(), *(object_name(digest, port) for port, digest in self._placed().items())}

    def _placed(self) -> dict[str, str]:
        with contextlib.suppress(OSError, ValueError):
            placed = json.loads((self.root / PLACED).read_text())
            return placed if isinstance(placed, dict) else {}
        return {}

    def shows(self, store: Store, record: Record) -> bool:
        """Whether the outputs in this folder are those of the record."""
        return all(self._shows(store, record, output) for output in record.outputs)

    def _shows(self, store: Store, record: Record, output: str) -> bool:
        path = self.root / record.parts.stage / output
        if is_link_to(path, store.path(record, output)):
            return True
        return path.exists() and tree_digest(path.resolve(), store.memo)[0] == record.outputs[output]

    def _refuse_foreign(self, project: Project) -> None:
        """BadInput where the folder holds files of another project, which would be overwritten."""
        if self.root.exists() and not self.root.is_dir():
            raise BadInput(f"{self.root} is a file; --out must be a folder")
        if self.root == project.dag.parent:
            raise BadInput(f"--out {self.root} is where gsac itself lies; choose another folder")
        if (self.root / DAG).exists():
            try:
                Graph.load(self.root / DAG)
            except BadInput as e:
                raise BadInput(f"--out {self.root} holds another project's {DAG} ({e}); choose another folder") from e
            return
        for name in (*project.graph.steps, PARAMS, RUN, METRICS, REPORT, LOGS):
            if os.path.lexists(self.root / name):
                raise BadInput(f"--out {self.root} is not the folder of a run and holds {name}, which would be written "
                               "over; choose another folder, or move it away")

    def write_json(self, name: str, content: Any) -> None:
        """Writes a JSON file into the folder."""
        write_text(self.root / name, json.dumps(content, indent=1) + "\n")

    def outputs(self, ports: Iterable[str]) -> dict[str, str]:
        """Port -> absolute path, of the ports that the folder shows."""
        return {port: str(self.path(port)) for port in ports if self.path(port).exists()}


def write_text(path: Path, text: str) -> None:
    """Writes a file whole or not at all; a file of equal content is left untouched."""
    with contextlib.suppress(OSError, UnicodeDecodeError):
        if path.read_text() == text:
            return
    temp = path.with_name(f".{path.name}-{os.getpid()}")
    try:
        temp.write_text(text)
        os.replace(temp, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            temp.unlink()
        raise OSError(error.errno, error.strerror, str(path)) from error
