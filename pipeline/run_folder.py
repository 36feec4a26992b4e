"""The folder of one clip: dvc.yaml, params.yaml, `clip`, and the outputs of every stage.

    clip  dvc.yaml  params.yaml  dvc.lock
    <stage>/<output>        link into the store (a copy where links cannot be made)
    export/<output>         the user's own files
    .placed.json            real files as they were placed: what differs from it was edited
    logs/<stage>.log        what the stage printed
    run.json  metrics.json  report.html
    events.jsonl            what the runs here have told
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from gsac.cache.digest import tree_digest, typed_digest
from gsac.cache.folder_lock import alone_in
from gsac.cache.half_made import half_made, sweep
from gsac.cache.objects import object_name
from gsac.cache.record import Record
from gsac.cache.roots import find_links, register
from gsac.cache.store import Store
from gsac.pipeline.graph import CLIP, Graph
from gsac.pipeline.params import to_yaml
from gsac.pipeline.placing import are_real, content, is_known, is_link_to, keep_aside, link, place, stands_in_the_way
from gsac.pipeline.project import Project, shipped_dag
from gsac.stages.contract import BadInput
from gsac.stages.split.film import find_photos

DAG, LOCK, PARAMS, RUN, METRICS, REPORT = "dvc.yaml", "dvc.lock", "params.yaml", "run.json", "metrics.json", "report.html"
LOGS = "logs"
EVENTS, OLDER_EVENTS = "events.jsonl", "events.1.jsonl"
PLACED = ".placed.json"
"""Port or file -> digests of the real files that were placed here: the last, and the one before while that may still lie there."""

OWN_STORE = ".store"
"""Holds the results of a run whose cache cannot be written."""


class RunFolder:
    """Paths of one clip's folder."""

    def __init__(self, root: Path):
        self.root = Path(root).absolute()
        self.say: Callable[[str], None] = lambda message: print(message, file=sys.stderr, flush=True)
        """Told of what was moved aside."""
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
        but = ", but for gsac's own" if shipped_dag().parent in (start, *start.parents) else ""
        raise BadInput(f"{start} is not in the output folder of a run: no {DAG} here or above{but}; {hint}")

    @property
    def is_run(self) -> bool:
        """Whether it is a run's folder already: others, too, keep a dvc.yaml."""
        return (self.root / DAG).is_file() and os.path.lexists(self.clip)

    @property
    def outer(self) -> Path | None:
        """The folder of another run in which it lies, or would lie, links followed; None where it lies in none."""
        return next((folder for folder in Path(os.path.realpath(self.root)).parents if RunFolder(folder).is_run), None)

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

    @contextlib.contextmanager
    def hold(self) -> Iterator[None]:
        """Makes the folder and works in it alone: a second command waits, and says so. What killed ones left half made goes.

        A folder that was made here and holds nothing at the end is removed.
        """
        if os.path.lexists(self.root) and not self.root.is_dir():
            what = "a file" if self.root.exists() else "a link that leads to nothing"
            raise BadInput(f"{self.root} is {what}; --out must be a folder")
        self._made = [folder for folder in (self.root, *self.root.parents) if not folder.exists()]
        here = None
        try:
            with alone_in(self.root, self._waiting):
                for folder in (self.root, *filter(Path.is_dir, self.root.iterdir())):
                    sweep(folder)
                here = self.root.stat()
                yield
        except FileNotFoundError as error:
            if here is None:
                raise BadInput(f"{self.root} cannot be made ({error.strerror}); choose another --out") from error
            if self.root.is_dir() and os.path.samestat(self.root.stat(), here):
                raise
            raise BadInput(f"{self.root} was removed while a command worked in it; run the command again") from error
        finally:
            for folder in self._made:
                with contextlib.suppress(OSError):
                    folder.rmdir()

    def _waiting(self) -> None:
        self.say(f"another command works in {self.root}; this one waits for its end (Ctrl-C stops the wait)")

    def prepare(self, clip: Path, project: Project, configs: dict[str, Any], store: Store) -> None:
        """Makes it the folder of this clip and these parameters. store: which files it has read already."""
        self.refuse_foreign(clip, project)
        self.root.mkdir(parents=True, exist_ok=True)
        self.write(DAG, project.dag.read_text())
        self.write(PARAMS, to_yaml(configs, notes=False))
        if (self.root / LOGS).is_symlink() or (self.root / LOGS).is_file():
            keep_aside(self.root / LOGS, self.say)
        self._show_clip(clip, store)

    def _show_clip(self, clip: Path, store: Store) -> None:
        """Makes `clip` a link to the source clip; a copy where the file system has no links, which is noted and may be replaced."""
        if self.clip.exists() and not self.clip.is_symlink():
            found = content(self.clip, store)
            if self.clip.samefile(clip) or (found is not None and found == content(clip.resolve(), store)):
                return
            if not is_known(found, self._placed().get(CLIP)):
                raise BadInput(f"{self.clip} is there and is not this clip, nor a copy that gsac made; move it away or choose "
                               "another --out")
        link(clip, self.clip)
        copied = None if self.clip.is_symlink() else content(self.clip, store)
        placed = self._placed()
        if placed.get(CLIP) != copied:
            others = {name: digests for name, digests in placed.items() if name != CLIP}
            self._write_placed(others | {CLIP: copied} if copied else others)

    def discard(self) -> None:
        """Removes the folder, where `prepare` has made it and it holds nothing but what a run writes, and those made above it."""
        ours = {CLIP, DAG, LOCK, PARAMS, RUN, METRICS, REPORT, LOGS, PLACED, OWN_STORE, EVENTS}
        for folder in self._made:
            with contextlib.suppress(OSError):
                if folder == self.root and {entry.name for entry in folder.iterdir()} <= ours:
                    shutil.rmtree(folder)
                else:
                    folder.rmdir()

    def place(self, store: Store, record: Record, into: Path | None = None) -> None:
        """Shows a finished stage's outputs in `<stage>/`, or in the folder `into`; gc then keeps what is shown."""
        register(store, self.root)
        before, folder = self._placed(), into or self.root / record.parts.stage
        if into is None and os.path.lexists(folder) and (
                not folder.is_dir() or (folder.is_symlink() and stands_in_the_way(record, folder, store, before))):
            keep_aside(folder, store.say)
        folder.mkdir(exist_ok=True)  # not its parents: a folder that was removed meanwhile is not made anew
        if are_real(record.parts.stage):
            self._know({f"{record.parts.stage}/{output}": digest for output, digest in record.outputs.items()})
        after = place(store, record, folder, self._placed())
        if after != self._placed():
            self._write_placed(after)

    def objects(self) -> set[str]:
        """Names of the store's objects that this folder shows, as links or as copies."""
        copies = {object_name(digest, port) for port, placed in self._placed().items() if "/" in port for digest in placed.split()}
        return {*self.links().values(), *copies}

    def links(self) -> dict[str, str]:
        """Relative path -> object's name, of this run's links into a store: not those of runs in folders below."""
        return {path: name for path, name in find_links(self.root).items() if self._is_own(self.root / path)}

    def _is_own(self, path: Path) -> bool:
        return next(folder for folder in path.parents if folder == self.root or RunFolder(folder).is_run) == self.root

    def _placed(self) -> dict[str, str]:
        with contextlib.suppress(OSError, ValueError):
            placed = json.loads((self.root / PLACED).read_text())
            return {str(name): str(digests) for name, digests in placed.items()} if isinstance(placed, dict) else {}
        return {}

    def _know(self, coming: dict[str, str]) -> None:
        """Notes what is about to be placed, so that it is known even if the process is killed right after. Name -> digest."""
        placed = self._placed()
        known = {name: " ".join([*placed.get(name, "").split()[-1:], digest]) for name, digest in coming.items()
                 if placed.get(name, "").split()[-1:] != [digest]}
        if known:
            self._write_placed(placed | known)

    def _write_placed(self, placed: dict[str, str]) -> None:
        write_text(self.root / PLACED, json.dumps(placed, indent=1) + "\n")

    def shows(self, store: Store, record: Record) -> bool:
        """Whether the outputs in this folder are those of the record."""
        return all(self._shows(store, record, output) for output in record.outputs)

    def _shows(self, store: Store, record: Record, output: str) -> bool:
        path = self.root / record.parts.stage / output
        if is_link_to(path, store.path(record, output)):
            return True
        return path.exists() and tree_digest(path.resolve(), store.memo)[0] == record.outputs[output]

    def refuse_foreign(self, clip: Path, project: Project) -> None:
        """BadInput where the folder is that of the photos, holds files of another project, which would be overwritten, or lies in
        another run's."""
        if clip.is_dir() and clip in (self.root.resolve(), *self.root.resolve().parents):
            raise BadInput(f"{self.root} lies in the folder of the photos, which is left as it is; give --out a folder elsewhere")
        if self.root == project.dag.parent:
            raise BadInput(f"{self.root} is where gsac itself lies; choose another --out")
        if (self.root / DAG).exists():
            try:
                if not is_same_file(self.root / DAG, project.dag):  # as it is nearly always; reading YAML takes long
                    Graph.load(self.root / DAG)
            except BadInput as e:
                raise BadInput(f"{self.root} holds another project's {DAG} ({e}); choose another --out") from e
            return
        if self.outer is not None:
            raise BadInput(f"{self.root} lies in {self.outer}, the folder of another run; choose another --out")
        photos = find_photos(self.root) if self.root.is_dir() else []
        if len(photos) > 1:
            raise BadInput(f"{self.root} holds {len(photos)} photos, a clip of its own, which would hold results then; "
                           "choose another --out")
        for name in (*project.graph.steps, PARAMS, RUN, METRICS, REPORT, LOGS, EVENTS, OLDER_EVENTS):
            if os.path.lexists(self.root / name):
                raise BadInput(f"{self.root} is not the folder of a run and holds {name}, which would be written over; "
                               "choose another --out, or move it away")

    def write_json(self, name: str, content: Any) -> None:
        """Writes one of the folder's own files as JSON."""
        self.write(name, json.dumps(content, indent=1) + "\n")

    def write(self, name: str, text: str, is_ours: Callable[[Path], bool] = lambda path: True) -> None:
        """Writes one of the folder's own files whole or not at all; one that the user edited is moved aside.

        is_ours: whether a file is of gsac's making, asked where no file of this name was placed here before.
        """
        if not self._holds(name, text):
            self._make_way(name, is_ours)
        self._know({name: text_digest(text)})
        write_text(self.root / name, text)

    def _holds(self, name: str, text: str) -> bool:
        """Whether a file of this name and content is there, whoever wrote it."""
        with contextlib.suppress(OSError):
            return not (self.root / name).is_symlink() and (self.root / name).read_bytes() == text.encode()
        return False

    def forget(self, name: str) -> None:
        """Removes one of the folder's own files; one that the user edited is moved aside."""
        self._make_way(name)
        (self.root / name).unlink(missing_ok=True)

    def _make_way(self, name: str, is_ours: Callable[[Path], bool] = lambda path: True) -> None:
        path, placed = self.root / name, self._placed().get(name)
        if not os.path.lexists(path):
            return
        with contextlib.suppress(OSError):
            if not path.is_symlink() and (is_ours(path) if placed is None else is_known(text_digest(path.read_bytes()), placed)):
                return
        keep_aside(path, self.say)

    def outputs(self, ports: Iterable[str]) -> dict[str, str]:
        """Port -> absolute path, of the ports that the folder shows."""
        return {port: str(self.path(port)) for port in ports if self.path(port).exists()}


def avatar_name(clip: Path, number: int = 1) -> str:
    """Name of a clip's folder: `<clip>-avatar`, where the ending of a video is left out. number: of clips of that name, if not
    the first."""
    name = clip.name if clip.is_dir() else clip.stem
    return f"{name}{f'-{number}' if number > 1 else ''}-avatar"


def text_digest(text: str | bytes) -> str:
    """Digest of a file of the folder's own by its content."""
    return typed_digest("text", text.encode() if isinstance(text, str) else text)


def is_same_file(one: Path, other: Path) -> bool:
    """Whether two files can be read and hold the same bytes."""
    try:
        return one.read_bytes() == other.read_bytes()
    except OSError:
        return False


def write_text(path: Path, text: str) -> None:
    """Writes a file whole or not at all; a file of equal content is left untouched."""
    with contextlib.suppress(OSError):
        if path.read_bytes() == text.encode():
            return
    try:
        with half_made(path.parent) as (folder, _):
            (folder / path.name).write_text(text, encoding="utf-8")
            os.replace(folder / path.name, path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
