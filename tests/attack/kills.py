"""SIGKILL of runs, at random moments and at single system calls, each followed by the next start and now and then by a whole rerun.
"""

from __future__ import annotations

import contextlib
import os
import random
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Protocol

from gsac.cache.digest import tree_digest
from gsac.cache.half_made import sweep
from gsac.cache.objects import NO_MEMO
from gsac.cache.store import Store
from gsac.cache.verify import verify
from gsac.pipeline.run_folder import RunFolder
from support.leftovers import find_leftovers

from .tally import Fault, Tally

OUTLIVES_S = 2.0
"""A process whose parent was killed ends within this time."""
SETTLES_S = 0.05
"""A dying process loses its environment, by which it is found here, a moment before its locks."""
RERUN_S = 600.0
CALLS = ("rename", "link", "symlink", "unlink", "rmdir", "mkdir", "fsync", "fchmodat", "chmod", "flock", "ftruncate", "write")
"""System calls at which a run is killed."""
TIMES = ("run.json", "report.html", ".placed.json")
"""Files of a folder that tell of the run and not of the result."""


class Subject(Protocol):
    """A project whose runs are killed."""

    root: Path
    cache: Path
    out: Path
    clip: Path

    @property
    def env(self) -> dict[str, str]: ...

    def command(self, *arguments: object) -> list[str]: ...


class Chain:
    """Runs of one project, killed over and over until one comes to its end; then all begins anew."""

    def __init__(self, subject: Subject, tally: Tally):
        self.subject, self.tally = subject, tally
        self.temporary = subject.root / "temporary"
        self.temporary.mkdir(exist_ok=True)
        self.heard = subject.root / "stderr.txt"
        self.known: set[str] = set()
        self.at_work: set[int] = set()
        """Processes of the run that is killed, as they were right before."""
        began = time.monotonic()
        self._rerun()
        self.whole_s = time.monotonic() - began
        self.reference = self._bytes()
        self.clear()

    def clear(self) -> None:
        """Begins anew, with the models still there."""
        for name in ("objects", "actions", "tmp", "leases", "partial", "quarantine", "roots"):
            subprocess.run(["chmod", "-R", "u+w", str(self.subject.cache / name)], check=False, capture_output=True)
            shutil.rmtree(self.subject.cache / name, ignore_errors=True)
        shutil.rmtree(self.subject.out, ignore_errors=True)

    def start(self, *before: str) -> subprocess.Popen:
        """A run of the clip. before: words of the command line before the run's own."""
        command = [*before, *self.subject.command("run", self.subject.clip, "--out", self.subject.out)]
        with self.heard.open("wb") as heard:
            return subprocess.Popen(command, cwd=self.subject.root, env=self.subject.env | {"TMPDIR": str(self.temporary)},
                                    stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=heard, start_new_session=True)

    def trial(self, kill: Callable[[], bool]) -> None:
        """One kill, by a function that tells whether the run was killed, and what is there after the next start."""
        before = self._done()
        killed = kill()
        self.tally.trials += killed
        self._outlived()
        store = Store(self.subject.cache)
        if not verify(store).sound:
            self.tally.fault(Fault.TORN, f"verify after {self._stage()}")
        if lost := before - self._done():
            self.tally.fault(Fault.LOST, ", ".join(sorted(lost)))
        self._next_start(store)
        if not killed:
            self._judge_end()

    def finish(self) -> None:
        """A last whole run, undisturbed."""
        if self._rerun():
            self._judge_end()

    def _judge_end(self) -> None:
        if self._bytes() != self.reference:
            self.tally.fault(Fault.WRONG, "a whole run gave other bytes")
        if left := [*{*find_leftovers(self.subject.cache, self.subject.out, self.temporary)} - self.known]:
            self.known.update(left)
            self.tally.fault(Fault.LEFT, ", ".join(left[:3]))
        self.clear()

    def _next_start(self, store: Store) -> None:
        from gsac.cache.gc import sweep_store

        sweep_store(store)
        sweep(self.temporary)
        if self.subject.out.exists():
            with RunFolder(self.subject.out).hold():
                pass
        left = find_leftovers(self.subject.cache, self.subject.out, self.temporary)
        left = [path for path in left if "/partial/" not in path and path not in self.known]  # the next run takes up the partial
        self.known.update(left)
        if left:
            self.tally.fault(Fault.LEFT, f"{', '.join(left[:3])} after {self._stage()}")

    def _rerun(self) -> bool:
        try:
            code = self.start().wait(RERUN_S)
        except subprocess.TimeoutExpired:
            code = "no end"
        if code:
            self.tally.fault(Fault.STUCK, f"{code}: {self.heard.read_text(errors='replace')[-300:]}")
        return not code

    def _outlived(self) -> None:
        """Waits for the end of what the run has started, and tells of what outlives it for long."""
        began, alive, self.at_work = time.monotonic(), self.at_work, set()
        while alive := {*processes_with(self.temporary), *filter(is_alive, alive)}:
            time.sleep(0.005)
            if time.monotonic() - began > 30:
                break
        lasted = time.monotonic() - began
        self.tally.longest_s = max(self.tally.longest_s, lasted)
        time.sleep(SETTLES_S)
        if lasted > OUTLIVES_S:
            self.tally.fault(Fault.STUCK, f"{len(alive)} processes outlived the run by {lasted:.1f} s, in {self._stage()}")

    def _stage(self) -> str:
        """The stage at work when the run was killed."""
        said = re.findall(r"^\d+/\d+ (\w+): starts|^(verdict|report):", self.heard.read_text(errors="replace"), re.MULTILINE)
        return (said[-1][0] or "report") if said else "start"

    def _done(self) -> set[str]:
        """Results that count."""
        return {f"{file.parent.name}/{file.stem}" for file in (self.subject.cache / "actions").glob("*/*.json")}

    def _bytes(self) -> dict[str, str]:
        """Digests of what the folder holds, without what tells of times."""
        found = [path for path in sorted(self.subject.out.glob("*/*")) if path.parent.name != "logs" and path.name not in TIMES]
        return {str(path.relative_to(self.subject.out)): tree_digest(path.resolve(), NO_MEMO)[0] for path in found}


def processes_with(temporary: Path) -> list[int]:
    """Processes that were told this folder of temporary files."""
    found, needle = [], f"TMPDIR={temporary}".encode()
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if needle in (process / "environ").read_bytes():
                found.append(int(process.name))
    return found


def is_alive(process: int) -> bool:
    """Whether a process runs, and does not only wait to be buried."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] not in "ZX"
    return False


def kill_at_random(subject: Subject, trials: int, seed: int, attack: str, end: float = float("inf")) -> Tally:
    """Kills runs at random moments until there are so many trials, or until the clock (time.monotonic) shows `end`."""
    tally, pick = Tally(attack), random.Random(seed)
    chain = Chain(subject, tally)

    def kill() -> bool:
        process = chain.start()
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(pick.uniform(0.05, 0.8) * chain.whole_s)
        killed = process.poll() is None
        if killed:
            chain.at_work = {*processes_with(chain.temporary)}
            process.kill()
            process.wait()
            tally.where[chain._stage()] += 1
        return killed

    while tally.trials < trials and time.monotonic() < end:
        chain.trial(kill)
    chain.finish()
    return tally


def moments(pick: random.Random) -> Iterator[tuple[str, int]]:
    """System calls, and at the how-manieth of it to kill."""
    while True:
        for call in CALLS:
            yield call, pick.randint(1, {"write": 300, "flock": 60, "mkdir": 60, "unlink": 60}.get(call, 25))


def kill_at_calls(subject: Subject, trials: int, seed: int, attack: str, end: float = float("inf")) -> Tally:
    """Kills runs at single system calls of their main process, by strace. Needs strace."""
    tally, pick = Tally(attack), random.Random(seed)
    chain, choices = Chain(subject, tally), moments(pick)

    def kill() -> bool:
        call, when = next(choices)
        traced = ["strace", "-o", "/dev/null", "-e", f"trace={call}", "-e", f"inject={call}:signal=KILL:when={when}"]
        process = chain.start(*traced)
        try:
            code = process.wait(RERUN_S)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            tally.fault(Fault.STUCK, f"a run killed at {call} {when} did not end")
            return True
        killed = code in (-signal.SIGKILL, 128 + signal.SIGKILL)
        if killed:
            tally.where[call] += 1
        return killed

    while tally.trials < trials and time.monotonic() < end:
        chain.trial(kill)
    chain.finish()
    return tally
