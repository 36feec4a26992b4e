"""One trial: a clip with a fault of one severity, fitted by one method, judged by the truth."""

from __future__ import annotations

import json
import os
import time
import traceback
from dataclasses import asdict, dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from gsac.avatar.artifacts import ArtifactError, Clip
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.joints import NAMES
from gsac.benchmarks.clip_runs import HEIGHT, render_clip
from gsac.benchmarks.fit.score import align_joints
from gsac.benchmarks.stability.code import hash_code
from gsac.benchmarks.stability.fault import Fault, Origin
from gsac.benchmarks.stability.faults import FAULTS
from gsac.benchmarks.stability.footage import Film
from gsac.benchmarks.stability.stages import BEFORE, Finding, read_artifact, run_stage, write_artifact
from gsac.benchmarks.stability.take import Take, read_take
from gsac.pipeline.clip_check import LAST, PARAMS, check_clip
from gsac.pipeline.journal import plain_journal
from gsac.stages.contract import StageError
from gsac.stages.findings import Code
from gsac.stages.severity import Severity
from gsac.turntable.options import TurntableOptions

CLEAN = "clean"
"""The fault of severity 0."""
DEFAULT, PAPER = "default", "paper"
METHODS: dict[str, dict[str, dict[str, Any]]] = {
    DEFAULT: {}, PAPER: {"handgap": {"method": "paper"}, "smplx": {"method": "paper"}},
}
"""Method -> stage -> parameters."""
TRAIN = {"steps": 300, "gaussians": 3000}
"""Of the short trainings of `--until train`."""
OFF_MM = 100.0
"""A joint farther than this from the truth is off."""
WORST = 5
"""A joint's worst frames."""
CLIP = (Origin.TAKE, Origin.FILM, Origin.PERSON)
"""Origins of faults that are in the clip's file, as `gsac check` gets it."""
CRF = 4
"""Of persons who are rendered anew; their file is read once more before it is a clip."""


class End(StrEnum):
    """How a trial ended."""

    DONE = "done"
    REFUSED = "refused"
    """One sentence to the user, exit code 1 or 2."""
    CRASHED = "crashed"
    HUNG = "hung"


@dataclass(frozen=True)
class Task:
    """What to run."""

    clip: Path
    """Folder of the clean truth clip."""
    fault: str
    severity: int
    seed: int
    method: str
    out: Path
    """Folder for all results."""
    frames: int
    height: int
    until: str = "smplx"
    kept: int | None = None
    """Of the clip's frames, those that the run keeps, spread evenly, and `gsac check` then keeps its own; None: both keep all."""

    @property
    def code(self) -> str:
        """Digest of the sources that make its results."""
        return hash_results(self.until)

    @property
    def folder(self) -> Path:
        """Results of this fault, severity and seed, of both methods."""
        name = f"{self.fault}_{self.severity}_{self.seed}" if self.severity else CLEAN
        return self.out / "runs" / self.code / self.clip.name / name

    @property
    def clean(self) -> Task:
        """The same without a fault."""
        return replace(self, fault=CLEAN, severity=0)


@dataclass
class Trial:
    """How a task ended: a line of trials.jsonl. Frames are numbers of pictures of the clean clip."""

    clip: str
    fault: str
    severity: int
    seed: int
    method: str
    end: End = End.DONE
    message: str = ""
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    """Of all cores, with programs that the stages started."""
    code: str = ""
    """Digest of the sources that made it."""
    frames: int = 0
    """That are judged."""
    kept: int = 0
    """Of those, the ones that the fit did not give up."""
    mean_mm: float | None = None
    """Error of the joints of kept frames; pelvis aligned, one scale."""
    worst_mm: float | None = None
    """The mean of the worst five frames of the worst joint."""
    still_mm: float | None = None
    """Error of a body that stands still at the mean of the true joints: nothing retained."""
    psnr: float | None = None
    """Held out, on the person, dB; of a short training."""
    flat_psnr: float | None = None
    """Of a person in one colour, dB: nothing retained."""
    off: dict[str, list[int]] = field(default_factory=dict)
    """Joint -> kept frames in which it is off."""
    touched: list[int] = field(default_factory=list)
    """Frames that the fault touches."""
    checked: list[str] | None = None
    """Codes, mere news left out, that `gsac check` would give; [REFUSED] where it would end; None for faults of artifacts."""
    findings: list[Finding] = field(default_factory=list)
    """What was said: code, severity, frames (empty: the whole clip), figure."""

    def to_json(self) -> dict[str, Any]:
        """As a line of trials.jsonl has it."""
        return asdict(self)

    @classmethod
    def of(cls, task: Task, **values: Any) -> Trial:
        """The trial of a task."""
        return cls(task.clip.name, task.fault, task.severity, task.seed, task.method, code=task.code, **values)


def stages_until(last: str) -> tuple[str, ...]:
    """Stages that follow `split`, up to the last."""
    return *BEFORE, "handgap", "smplx", *(["train"] if last == "train" else [])


def hash_results(last: str) -> str:
    """Digest of the sources that make the results of trials up to the stage `last`."""
    return hash_code(__name__, *(f"gsac.stages.{name}.stage" for name in ("split", *stages_until(last))))


def run_trial(task: Task) -> Trial:
    """Puts the fault in, runs the stages and judges. A stage's failure is the trial's end, never this function's."""
    fault, trial = FAULTS[task.fault] if task.severity else None, Trial.of(task)
    take = read_take(task.clip, task.frames, task.height)
    trial.still_mm = _error_of_still_body(take)
    if fault and fault.origin is Origin.PERSON:
        take = read_take(render_person(task, fault), task.frames, task.height)
    if fault and fault.origin is Origin.TAKE:
        take, touched = fault.inject(take, task.severity, task.seed)
        trial.touched = take.number[touched].tolist()
    trial.checked = [End.REFUSED.value] if fault is None or fault.origin in CLIP else None
    began, cpu_began = time.perf_counter(), sum(os.times()[:4])
    try:
        ports, take = _run(task, fault, take, trial)
    except (StageError, ArtifactError) as error:
        trial.end, trial.message = End.REFUSED, str(error)
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{Path(last.filename).name}:{last.lineno}"
        trial.end, trial.message = End.CRASHED, f"{type(error).__name__}: {error} ({place})"
    else:
        _judge(trial, take, ports)
    trial.seconds, trial.cpu_seconds = time.perf_counter() - began, sum(os.times()[:4]) - cpu_began
    return trial


def render_person(task: Task, fault: Fault) -> Path:
    """Folder of the clip of the same person who behaves otherwise; rendered unless it is there.

    It has no more frames and rows than the trial looks at, at the clean clip's times and with the noise of its scaled frames.
    The clip's name tells its seed.
    """
    rate = Film(read_take(task.clip, task.frames, task.height)).rate
    options, _ = fault.inject({"seed": seed_of(task.clip)}, task.severity, task.seed)
    options |= {"frames": task.frames, "height": task.height, "fps": rate, "crf": CRF,
                "noise": TurntableOptions.noise * task.height / HEIGHT}
    folder = task.out / "clips" / hash_code("gsac.turntable.clip")
    return render_clip(folder / f"{task.clip.name}_{fault.name}_{task.severity}", plain_journal(), **options)


def seed_of(clip: Path) -> int | None:
    """Of a clip that is named seedN, N or seedN_FRAMES; None where the name tells none."""
    digits = clip.name.removeprefix("seed").split("_")[0]
    return int(digits) if digits.isdecimal() else None


def _run(task: Task, fault: Fault | None, take: Take, trial: Trial) -> tuple[dict[str, Path], Take]:
    """Runs all stages on a take; faults of the file and of artifacts are put in on the way.

    Returns ports -> files and folders, and the take that the stages after `split` saw.
    """
    folder = task.folder if fault and fault.origin in CLIP else task.clean.folder
    film = Film(take)
    if fault and fault.origin is Origin.FILM:
        film, touched = fault.inject(film, task.severity, task.seed)
        trial.touched = take.number[touched].tolist()
    ports, said, take = _split(film, folder, {"count": task.kept or len(film.take.frames)})
    trial.findings += [f | {"frames": _numbers(f["frames"], take.number)} for f in said]
    if trial.checked is not None and task.kept is None:
        trial.checked = _check(dict(ports), said, folder / "check", folder)
    elif trial.checked is not None:
        own, heard, _ = _split(film, folder / "check", PARAMS["split"])
        trial.checked = _check(own, heard, folder / "check")
    for name in stages_until(task.until):
        values = METHODS[task.method].get(name, {}) | (TRAIN if name == "train" else {})
        found = run_stage(name, values, ports, folder / name if name in BEFORE else folder / task.method / name)
        trial.findings += [f | {"frames": _numbers(f["frames"], take.number)} for f in found]
        if fault and fault.origin.startswith(f"{name}/"):
            port, folder = fault.origin.value, task.folder
            value, touched = fault.inject(read_artifact(fault.origin, ports[port]), task.severity, task.seed)
            ports[port] = folder / "spoiled" / task.method / port
            write_artifact(fault.origin, value, ports[port])
            trial.touched = take.number[touched].tolist()
    return ports, take


def _split(film: Film, folder: Path, values: dict[str, Any]) -> tuple[dict[str, Path], list[Finding], Take]:
    """Runs `split` on the film and gives its pictures their own times. values: its parameters that differ from the defaults.

    Returns its ports, what it said, and the take that it kept.
    """
    ports = {"clip": folder / f"clip-{os.getpid()}.mp4"}
    film.write(ports["clip"])
    said = run_stage("split", values, ports, folder / "split")
    ports["clip"].unlink()
    clip = Clip.read(ports["split/clip.json"])
    take = film.take.at(film.number(np.array(clip.timestamps_s)))
    quarters = [int(finding["figure"]) for finding in said if finding["code"] == Code.TURNED_UPRIGHT.word]
    take = take.turned(quarters[0]) if quarters else take
    if film.plain:  # the file's own fault is in its times
        ports["split/clip.json"] = folder / "clip.json"
        half = folder / f"clip-{os.getpid()}.json"  # trials beside this one read the clean clip's, too
        replace(clip, timestamps_s=take.times.tolist(), focal_px=take.focal).write(half)
        half.replace(ports["split/clip.json"])
    return ports, said, take


def _check(ports: dict[str, Path], said: list[Finding], folder: Path, shared: Path | None = None) -> list[str]:
    """Codes of `gsac check`, mere news left out, by the frames at these ports.

    said: by split; folder: for its results; shared: the run's, where both look at the same frames.
    """
    found = list(said)
    try:
        for name in stages_until(LAST):
            kept = shared if shared is not None and name in BEFORE and name not in PARAMS else folder
            found += run_stage(name, PARAMS.get(name, {}), ports, kept / name)
            if any(finding["severity"] == Severity.HOPELESS for finding in found):
                break
    except (StageError, ArtifactError):
        return [End.REFUSED.value]
    check = check_clip(ports["split/clip.json"], ports["keypoints/keypoints.npz"],
                       [(finding["message"], finding) for finding in found])
    return sorted({entry["code"] for _, entry in check.findings if entry["severity"] != Severity.NEWS})


def _numbers(runs: list[list[int]], number: np.ndarray) -> list[int]:
    """Pictures' numbers of runs of frames [first, last]."""
    return sorted({int(number[t]) for first, last in runs for t in range(first, min(last, len(number) - 1) + 1)})


def _judge(trial: Trial, take: Take, ports: dict[str, Path]) -> None:
    """Fills in the errors of the fit, and the quality of the training where there was one."""
    params, body = BodyParams.read(ports["smplx/body.npz"]), Body.load()
    good = take.asked & ~params.lost
    trial.frames, trial.kept = int(take.asked.sum()), int(good.sum())
    if trial.kept:
        true = np.einsum("tab,tjb->tja", take.rotation, take.truth.joints[take.number])
        off = align_joints(body.posed(params)[1][good][:, take.truth.joint], true[good])
        trial.mean_mm = float(off[:, 1:].mean())
        trial.worst_mm = float(np.sort(off, axis=0)[-WORST:].mean(0).max())
        joints = [NAMES[j] for j in take.truth.joint]
        trial.off = {name: take.number[good][column > OFF_MM].tolist() for name, column in zip(joints, off.T, strict=True)
                     if (column > OFF_MM).any()}
    if "train/metrics.json" in ports:
        trial.psnr = json.loads(ports["train/metrics.json"].read_text())["psnr_fg"]
        colours = take.frames[take.masks].astype(float)
        trial.flat_psnr = float(10 * np.log10(255**2 / np.square(colours - colours.mean(0)).mean()))


def _error_of_still_body(take: Take) -> float:
    """Mean error, mm, of a body that stands still at the mean of the true joints."""
    true = take.truth.joints[:, 1:] - take.truth.joints[:, :1]
    return float(np.linalg.norm(true - true.mean(0), axis=-1).mean() * 1e3)
