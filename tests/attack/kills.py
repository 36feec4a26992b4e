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
from typing import NamedTuple, Protocol

from gsac.cache.digest import tree_digest
from gsac.cache.folder_lock import try_lock
from gsac.cache.half_made import sweep
from gsac.cache.objects import NO_MEMO
from gsac.cache.store import Store
from gsac.cache.verify import verify
from gsac.pipeline.run_folder import RunFolder
from support.leftovers import find_leftovers

from .tally import Fault, Tally

OUTLIVES_S = 2.0
"""A process whose parent was killed ends within this time."""
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


class Kill(NamedTuple):
    """What became of one start."""

    happened: bool
    """Whether something was killed."""
    at_end: bool
    """Whether the command came to its end all the same."""


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

    def words(self) -> list[object]:
        """What is asked of gsac."""
        return ["run", self.subject.clip, "--out", self.subject.out]

    def folders(self) -> list[Path]:
        """Folders of runs that are there."""
        return [self.subject.out] if self.subject.out.exists() else []

    def start(self, *before: str) -> subprocess.Popen:
        """The command. before: words of the command line before its own."""
        command = [*before, *self.subject.command(*self.words())]
        with self.heard.open("wb") as heard:
            return subprocess.Popen(command, cwd=self.subject.root, env=self.subject.env | {"TMPDIR": str(self.temporary)},
                                    stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=heard, start_new_session=True)

    def trial(self, kill: Callable[[], Kill]) -> None:
        """One start that may be killed, and what is there after the next one."""
        before = self._done()
        kill_of = kill()
        self.tally.trials += kill_of.happened
        self._outlived()
        store = Store(self.subject.cache)
        if not verify(store).sound:
            self.tally.fault(Fault.TORN, f"verify after {self._stage()}")
        if lost := before - self._done():
            self.tally.fault(Fault.LOST, ", ".join(sorted(lost)))
        self._next_start(store)
        if kill_of.at_end:
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
        sweep(self.subject.out)
        for folder in self.folders():
            with RunFolder(folder).hold():
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
        while (alive := {*processes_with(self.temporary), *filter(is_alive, alive)}) or is_held(self.temporary):
            time.sleep(0.005)
            if time.monotonic() - began > 30:
                break
        lasted = time.monotonic() - began
        self.tally.longest_s = max(self.tally.longest_s, lasted)
        if lasted > OUTLIVES_S:
            self.tally.fault(Fault.STUCK, f"{len(alive)} processes, or their locks, outlived the run by {lasted:.1f} s, "
                                         f"in {self._stage()}")

    def _stage(self) -> str:
        """The stage at work when the run was killed."""
        said = re.findall(r"^\d+/\d+ (\w+): starts|^(verdict|report):", self.heard.read_text(errors="replace"), re.MULTILINE)
        return (said[-1][0] or "report") if said else "start"

    def _done(self) -> set[str]:
        """Results that count."""
        return {f"{file.parent.name}/{file.stem}" for file in (self.subject.cache / "actions").glob("*/*.json")}

    def _bytes(self) -> dict[str, str]:
        """Digests of what the folder holds, without what tells of times."""
        found = [path for folder in self.folders() for path in sorted(folder.glob("*/*"))
                 if path.parent.name != "logs" and path.name not in TIMES]
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


def is_held(temporary: Path) -> bool:
    """Whether a process that is being taken apart still has the lock of its temporary files."""
    for folder in temporary.iterdir():
        with contextlib.suppress(FileNotFoundError):
            descriptor = os.open(folder, os.O_RDONLY)
            free = try_lock(descriptor)
            os.close(descriptor)
            if free is False:
                return True
    return False


def kill_at_random(subject: Subject, trials: int, seed: int, attack: str, end: float = float("inf")) -> Tally:
    """Kills runs at random moments until there are so many trials, or until the clock (time.monotonic) shows `end`."""
    tally, pick = Tally(attack), random.Random(seed)
    chain = Chain(subject, tally)

    def kill() -> Kill:
        process = chain.start()
        killed = wait_at_random(process, chain, pick)
        if killed:
            chain.at_work = {*processes_with(chain.temporary)}
            process.kill()
            process.wait()
            tally.where[chain._stage()] += 1
        return Kill(killed, not killed)

    while tally.trials < trials and time.monotonic() < end:
        chain.trial(kill)
    chain.finish()
    return tally


def wait_at_random(process: subprocess.Popen, chain: Chain, pick: random.Random) -> bool:
    """Lets a command run for a random while. Returns whether it is still at work."""
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(pick.uniform(0.05, 0.8) * chain.whole_s)
    return process.poll() is None


def moments(pick: random.Random) -> Iterator[tuple[str, int]]:
    """System calls, and at the how-manieth of it to kill."""
    while True:
        for call in CALLS:
            yield call, pick.randint(1, {"write": 300, "flock": 60, "mkdir": 60, "unlink": 60}.get(call, 25))


def kill_at_calls(subject: Subject, trials: int, seed: int, attack: str, end: float = float("inf")) -> Tally:
    """Kills runs at single system calls of their main process, by strace. Needs strace."""
    tally, pick = Tally(attack), random.Random(seed)
    chain, choices = Chain(subject, tally), moments(pick)

    def kill() -> Kill:
        call, when = next(choices)
        traced = ["strace", "-o", "/dev/null", "-e", f"trace={call}", "-e", f"inject={call}:signal=KILL:when={when}"]
        process = chain.start(*traced)
        try:
            code = process.wait(RERUN_S)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            tally.fault(Fault.STUCK, f"a run killed at {call} {when} did not end")
            return Kill(True, False)
        killed = code in (-signal.SIGKILL, 128 + signal.SIGKILL)
        if killed:
            tally.where[call] += 1
        return Kill(killed, not killed)

    while tally.trials < trials and time.monotonic() < end:
        chain.trial(kill)
    chain.finish()
    return tally
