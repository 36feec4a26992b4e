"""SIGKILL in batches: of the batch's own process, of a clip's run, of a stage, each at a random moment; then `--resume`."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import time
from enum import Enum
from pathlib import Path
from typing import Protocol

from .kills import RERUN_S, Chain, Kill, Subject, is_alive, processes_with, wait_at_random
from .tally import Fault, Tally


class Victim(Enum):
    """What is killed; the value is a word of its command line, by which it is known."""

    DRIVER = "batch"
    CLIP = "gsac.pipeline.tether"
    STAGE = "gsac.pipeline.by_content"


class BatchSubject(Subject, Protocol):
    """A project with a folder of clips."""

    clips: Path


class BatchChain(Chain):
    """Batches of one folder of clips, two at a time, each taken up by `--resume` where the one before was killed."""

    subject: BatchSubject

    def words(self) -> list[object]:
        again = (self.subject.out / "batch.json").exists()
        return ["batch", *(["--resume"] if again else [self.subject.clips]), "--out", self.subject.out, "-j", "2"]

    def folders(self) -> list[Path]:
        return sorted(self.subject.out.glob("*-avatar"))

    def find(self, driver: subprocess.Popen, victim: Victim) -> list[int]:
        """Processes of a kind that are at work. Each leads a group; the one that watches over it, a copy of it, does not."""
        if victim is Victim.DRIVER:
            return [driver.pid]
        return [pid for pid in processes_with(self.temporary)
                if victim.value in words_of(pid) and is_alive(pid) and leads_group(pid)]

    def _done(self) -> set[str]:
        """Results that count, and clips that the batch says have ended."""
        file = self.subject.out / "batch.json"
        clips = json.loads(file.read_text())["clips"] if file.exists() else []
        return super()._done() | {f"end of {Path(clip['clip']).name}" for clip in clips if clip["status"] != "planned"}


def leads_group(process: int) -> bool:
    """Whether a process is the first of its group."""
    try:
        return os.getpgid(process) == process
    except ProcessLookupError:
        return False


def words_of(process: int) -> list[str]:
    """The command line of a process; empty where it has ended."""
    try:
        return Path(f"/proc/{process}/cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        return []


def kill_in_batches(subject: BatchSubject, trials: int, seed: int, attack: str, end: float = float("inf")) -> Tally:
    """Kills a batch, a clip's run or a stage until there are so many trials, or until the clock (time.monotonic) shows `end`.

    Where the batch itself lives on it must end well: a clip whose run or stage was killed once is tried again.
    """
    tally, pick = Tally(attack), random.Random(seed)
    chain = BatchChain(subject, tally)

    def kill() -> Kill:
        driver, victim = chain.start(), pick.choice((Victim.DRIVER, Victim.DRIVER, Victim.CLIP, Victim.STAGE))
        if not wait_at_random(driver, chain, pick):
            return Kill(False, True)
        chain.at_work = {*processes_with(chain.temporary)}
        found = chain.find(driver, victim)
        if found:
            os.kill(pick.choice(found), signal.SIGKILL)
            tally.where[victim.name.lower()] += 1
        try:
            code = driver.wait(RERUN_S)
        except subprocess.TimeoutExpired:
            driver.kill()
            code = "no end"
        if code and not (found and victim is Victim.DRIVER):
            said = chain.heard.read_text(errors="replace")[-300:]
            tally.fault(Fault.STUCK, f"{code} after a {victim.name.lower()} was killed: {said}")
        return Kill(bool(found), not code)

    while tally.trials < trials and time.monotonic() < end:
        chain.trial(kill)
    chain.finish()
    return tally
