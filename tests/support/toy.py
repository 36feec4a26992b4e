"""A toy project of four small stages, run by the real command."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

DAG = """stages:
  cut:
    cmd: gsac stage cut
    deps: [clip]
    params: [cut]
    outs:
      - cut/words: {cache: false}
  left:
    cmd: gsac stage left
    deps: [cut/words]
    params: [left]
    outs:
      - left/out.txt: {cache: false}
  right:
    cmd: gsac stage right
    deps: [cut/words]
    params: [right]
    outs:
      - right/out.txt: {cache: false}
  join:
    cmd: gsac stage join
    deps: [left/out.txt, right/out.txt]
    params: [join]
    outs:
      - join/out.txt: {cache: false}
      - join/metrics.json: {cache: false}
"""

DECLARATION = '''
from dataclasses import dataclass
from pathlib import Path

from gsac.stages.contract import BadInput, Output, Stage


def check(path: Path) -> None:
    for file in [path] if path.is_file() else path.iterdir():
        if file.stat().st_size == 0:
            raise ValueError(f"{file} is empty")


@dataclass
class Config:
    word: str = "first"
    """Which word: `first` or `last`."""
    keep: int = 100
    """Words kept at most."""
    pause_s: float = 0.0
    """Seconds to sleep before writing."""
    trouble: str = ""
    """What goes wrong, if anything."""
    model: str = ""
    """Name of a model file to read, if any."""

    def check(self) -> None:
        if self.word not in ("first", "last"):
            raise BadInput(f"NAME.word is {self.word!r}; choices: first, last")


STAGE = Stage(
    name="NAME",
    inputs=INPUTS,
    outputs=tuple(Output(path, check) for path in OUTPUTS),
    config=Config,
    packages=("toyware",) if "NAME" == "left" else (),
    models=lambda config: (config.model,) if config.model else (),
    uses_device=lambda config: "NAME" == "right",
)
'''

COMMON = '''
import os
import signal
import time
from pathlib import Path

from gsac.stages.contract import BadInput, StageError
from gsac.stages.findings import Code, Finding


def begin(job, name):
    """Notes the run, then does what `trouble` says."""
    with open(os.environ["TOY_RUNS"], "a") as log:
        log.write(name + "\\n")
    print(f"{name} at work")
    job.progress(1, 2, "words")
    trouble = job.config.trouble
    if trouble == "stage":
        raise StageError(f"{name}: frame 3 has no person; record again")
    if trouble == "bad input":
        raise BadInput(f"{name}: the clip holds no words")
    if trouble == "bug":
        raise KeyError("surprise")
    if trouble == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    if trouble == "warning":
        job.warn(Finding.of(Code.OTHER, what=f"{name}: word 2 is short"))
    if trouble == "hopeless":
        job.warn(Finding.of(Code.HARDLY_ANY_PERSON, figure=1, given=40))
    if trouble == "note":
        job.note("words are taken as they come")
    return trouble


def end(job):
    time.sleep(job.config.pause_s)


def spell(text):
    return text.strip().upper()
'''

BODIES = {
    "cut": '''
def run(job):
    begin(job, "cut")
    folder = job.out / "words"
    (folder / "more").mkdir(parents=True)
    for i, word in enumerate(job.inputs["clip"].read_text().split()[: job.config.keep]):
        (folder / f"{i:06d}.txt").write_text(word)
    (folder / "more.txt").write_text("beside a folder of nearly the same name")
    (folder / "more" / "1.txt").write_text("deep")
    end(job)
''',
    "side": '''
def run(job):
    trouble = begin(job, "NAME")
    words = sorted(job.inputs["cut/words"].glob("[0-9]*.txt"))
    word = words[0 if job.config.word == "first" else -1].read_text()
    model = job.models[job.config.model].read_text() if job.config.model else ""
    (job.out / "out.txt").write_text("half")
    end(job)
    if trouble == "silent":
        (job.out / "out.txt").unlink()
    else:
        (job.out / "out.txt").write_text("" if trouble == "empty" else spell(word) + model)
''',
    "join": '''
import json


def run(job):
    begin(job, "join")
    left, right = (job.inputs[f"{side}/out.txt"].read_text() for side in ("left", "right"))
    (job.out / "metrics.json").write_text(json.dumps({"length": len(left + right)}))
    (job.out / "out.txt").write_text("half")
    end(job)
    (job.out / "out.txt").write_text(f"{left} {right}")
''',
}


def forget_toys() -> None:
    """Drops the modules of all toy projects from this process, and where they were found."""
    from gsac.cache import code

    for name in [name for name in sys.modules if name.startswith("gsac.toy")]:
        del sys.modules[name]
    code._installed.cache_clear()


@dataclasses.dataclass
class Done:
    """One finished `gsac`."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> dict:
        return json.loads(self.out.splitlines()[-1])

    @property
    def statuses(self) -> dict[str, str]:
        return {stage["name"]: stage["status"] for stage in self.json["stages"]}


class Toy:
    """A project of the stages cut -> left, right -> join, a clip of words, and a cache, all in one folder."""

    def __init__(self, root: Path):
        self.root = root
        self.package = root / "lib" / "gsac" / "toy"
        self.cache = root / "cache"
        self.clip = root / "clip.mp4"
        self.out = root / "out"
        self.runs_file = root / "runs.txt"
        self.clip.write_text("alpha beta gamma")
        self.write("__init__.py", '"""Toy stages."""\n')
        self.write("dvc.yaml", DAG)
        self.write("common.py", COMMON)
        for name, inputs, outputs in (
            ("cut", ("clip",), ("words",)), ("left", ("cut/words",), ("out.txt",)),
            ("right", ("cut/words",), ("out.txt",)),
            ("join", ("left/out.txt", "right/out.txt"), ("out.txt", "metrics.json")),
        ):
            declaration = DECLARATION.replace("INPUTS", repr(inputs)).replace("OUTPUTS", repr(outputs))
            self.write(f"{name}/__init__.py", declaration.replace("NAME", name))
            body = BODIES.get(name, BODIES["side"]).replace("NAME", name)
            self.write(f"{name}/stage.py", "from gsac.toy.common import begin, end, spell\n" + body)
        self.set_package_version("1.0")

    @contextlib.contextmanager
    def importable(self) -> Iterator[None]:
        """Commands in this process see the project, and not another toy's that was imported before."""
        import gsac

        paths, here = list(sys.path), gsac.__path__
        forget_toys()
        gsac.__path__, sys.path[:] = [*here, str(self.root / "lib" / "gsac")], [*paths, str(self.root / "lib")]
        try:
            yield
        finally:
            forget_toys()
            gsac.__path__, sys.path[:] = here, paths

    def write(self, path: str, text: str) -> None:
        file = self.package / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)

    def edit(self, path: str, old: str, new: str) -> None:
        text = (self.package / path).read_text()
        assert old in text
        self.write(path, text.replace(old, new))

    def call_last_stage_export(self) -> None:
        """Renames `join` to the stage whose outputs are the user's own."""
        (self.package / "join").rename(self.package / "export")
        self.edit("dvc.yaml", "join", "export")
        for file in ("__init__.py", "stage.py"):
            self.edit(f"export/{file}", '"join"', '"export"')

    def set_package_version(self, version: str) -> None:
        for old in (self.root / "lib").glob("toyware-*"):
            shutil.rmtree(old)
        info = self.root / "lib" / f"toyware-{version}.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: toyware\nVersion: {version}\n")

    @property
    def env(self) -> dict[str, str]:
        return os.environ | {
            "PYTHONPATH": os.pathsep.join(filter(None, [str(self.root / "lib"), os.environ.get("PYTHONPATH")])),
            "GSAC_STAGES": "gsac.toy", "GSAC_CACHE": str(self.cache),
            "TOY_RUNS": str(self.runs_file), "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
            "PYTHONDONTWRITEBYTECODE": "1",
        }

    def command(self, *arguments: object) -> list[str]:
        return [sys.executable, "-P", "-m", "gsac.pipeline.cli", *map(str, arguments)]

    def start(self, *arguments: object, **env: str) -> subprocess.Popen:
        """With Ctrl-C working, even where the tests themselves run in a shell's background."""
        return subprocess.Popen(self.command(*arguments), cwd=self.root, env=self.env | env, text=True,
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))

    def gsac(self, *arguments: object, cwd: Path | None = None, **env: str) -> Done:
        done = subprocess.run(self.command(*arguments), cwd=cwd or self.root, env=self.env | env, text=True,
                              capture_output=True, timeout=120)
        return Done(done.returncode, done.stdout, done.stderr)

    def run(self, *arguments: object, **env: str) -> Done:
        """`gsac run` of the clip, with --json."""
        return self.gsac("run", self.clip, "--out", self.out, "--json", *arguments, **env)

    def ran(self, *arguments: object, **env: str) -> list[str]:
        """Stages whose code really ran in a run that must succeed."""
        self.runs_file.write_text("")
        done = self.run(*arguments, **env)
        assert done.code == 0, done.err
        return self.runs

    @staticmethod
    def wait_for(what: Callable[[], object], seconds: float = 60.0) -> None:
        """Until `what()` is true."""
        end = time.monotonic() + seconds
        while not what():
            assert time.monotonic() < end, f"waited {seconds} s in vain"
            time.sleep(0.02)

    @property
    def runs(self) -> list[str]:
        return self.runs_file.read_text().split() if self.runs_file.exists() else []

    @property
    def result(self) -> str:
        return (self.out / "join" / "out.txt").read_text()
