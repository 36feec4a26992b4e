"""Entry of `train`: reads frames, masks and poses, runs the recipe, judges, writes."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from gsac.avatar import rotation
from gsac.avatar.artifacts import Clip, frame_paths
from gsac.avatar.body import BodyParams
from gsac.avatar.camera import Camera
from gsac.avatar.cuda import perceptual, why_not
from gsac.avatar.cuda.device import Device
from gsac.avatar.feature_distance import LEAST_SIDE
from gsac.avatar.files import write_file
from gsac.avatar.frame_files import write_frame
from gsac.avatar.freed_memory import hand_back
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.lpips import Lpips
from gsac.avatar.metrics import figures, mean_psnr, summary
from gsac.avatar.threads import opencv_in_one_thread
from gsac.avatar.vgg_hed import VggHed
from gsac.avatar.yaw import turn_seen
from gsac.stages.body_choice import load_body
from gsac.stages.contract import BadInput, Job, StageError
from gsac.stages.findings import Code, Finding
from gsac.stages.first_look import LEAST_TURN
from gsac.stages.train.checkpoint import Checkpoints, State
from gsac.stages.train.choose_heldout import hold_out, hold_out_for_choosing, hold_out_named
from gsac.stages.train.config import AUTO, NETWORKS, VGG_HED, TrainConfig, read_numbers
from gsac.stages.train.fast.lod import judge_levels
from gsac.stages.train.finite import named_result, named_values, require_finite
from gsac.stages.train.judge.coverage import unseen_parts
from gsac.stages.train.judge.heldout import Candidate, draw_all_round, find_boxes, judge, judge_person
from gsac.stages.train.judge.likeness import judge_likeness
from gsac.stages.train.judge.novel_poses import judge_novel
from gsac.stages.train.judge.surface import seen_area
from gsac.stages.train.poses.photometric import converge
from gsac.stages.train.poses.poses import Poses, carry_to_untrained
from gsac.stages.train.recipes import BACKENDS, RECIPES
from gsac.stages.train.task import Task
from gsac.stages.train.views import View, read_views, read_whole
from gsac.stages.train.warmup import warm_up

LOSS_ROWS = 20
"""Rows of the curve that have the loss."""
TIMES = ("seconds", "cpu_seconds", "gpu_seconds")
"""What a row of the curve holds that another run would not repeat: it goes to the engine, not into metrics.json."""
LEAST_SEEN = 0.8
"""Share of the body's surface in view below which the user is warned."""
TRAIN_SAMPLE = 8
"""Trained frames, at most, that `psnr_fg_train` is the mean of."""
SMALL = 540
"""Height, px, that held-out frames are also judged at, to compare with older figures, and at most that poses are aligned at."""
LAST_ROUNDS = 1
"""Rounds that align poses to frames as filmed after that: without, they are off by 0.7 dB in a frame of 1280 px."""
ALSO_SMALL = ("psnr_fg", "psnr_face", "psnr_hands", "detail", "ssim")
"""Figures that are told at that size, too."""
JUDGING = 4, "parts of judging"
"""What the progress of judging is counted in."""


@threadpool_limits.wrap(limits=1, user_api="blas")  # small matrices, and the same sums whoever else is at work
@opencv_in_one_thread()
def run(job: Job) -> None:
    """The whole stage: job.inputs to job.out."""
    config = job.config
    check_device(job.device)
    clip = Clip.read(job.inputs["split/clip.json"])
    params = BodyParams.read(job.inputs["smplx/body.npz"])
    frames = job.inputs["split/frames"]
    count = len(frame_paths(frames))
    if params.frames != count:
        raise StageError(f"smplx/body.npz has {params.frames} poses, split/frames has {count} frames; run smplx again")
    if config.recipe == "paper":
        params.rest_expression = None  # as published
    body = load_body(job, "train", params.model)
    camera = params.camera(clip.width, clip.height)
    views, empty = read_views(frames, job.inputs["segment/alpha"], camera, config.height,
                              mixed=config.recipe == "paper",  # as published
                              occluder=params.occluder)
    if len(empty) == count:
        raise StageError("segment/alpha: every mask is empty, there is no person to train on; look at segment")
    usable = np.ones(count, bool)
    usable[empty] = False
    if (unmasked := ~usable & ~params.lost).any():  # of the others smplx has told
        job.warn(Finding.of(Code.MASK_NOT_TRAINED, unmasked))
    if (failed := usable & params.lost & clip.shows_own_moment(count)).any():
        job.warn(Finding.of(Code.POSE_NOT_TRAINED, failed))
    usable &= ~params.lost
    if not usable.any():
        raise StageError("smplx/body.npz: no frame with a mask has a fitted body; look at the warnings of smplx")
    held = (hold_out(params.global_orient, usable, config.holdout) if config.heldout_frames is None
            else hold_out_named(read_numbers(config.heldout_frames), usable))
    if not len(held):
        job.warn(Finding.of(Code.NOT_MEASURED, figure=int(usable.sum()), holdout=config.holdout))
    choosing = held
    if config.searches_size():
        choosing = hold_out_for_choosing(params.global_orient, usable, held, config.holdout)
    trained = np.setdiff1d(np.flatnonzero(usable), np.union1d(held, choosing))
    turn = turn_seen(rotation.exp(params.global_orient[usable].astype(float)))
    if turn < LEAST_TURN:
        job.warn(Finding.of(Code.PART_OF_TURN, figure=turn))

    if config.in_loss() in job.models and (why := without_lpips(config, job.device, views[0].frame)):
        if config.lpips != AUTO:
            raise BadInput(f"train.lpips is {config.lpips}, but {why}; set train.lpips to judge")
        job.warn(Finding.of(Code.NO_LPIPS, why=why))

    run = Run(job, Poses(body, params), camera, views, trained, held, choosing, turn)
    run.fit()
    area = run.write()
    if parts := run.unseen:
        job.warn(Finding.of(Code.PART_UNSEEN, parts=", ".join(parts)))
    if area < LEAST_SEEN:
        job.warn(Finding.of(Code.LITTLE_SEEN, figure=area))


def warm(device: str) -> None:
    """Loads the kernels, or compiles them the very first time, and wakes the GPU; called while the stage before is at work."""
    if device == "cuda":
        Device()
    warm_up()


def without_lpips(config: TrainConfig, device: str, camera: Camera) -> str | None:
    """The reason why LPIPS cannot be in the loss of a configuration that wants it there, or None. camera: of the frames."""
    if min(camera.width, camera.height) < LEAST_SIDE:
        return f"frames of fewer than {LEAST_SIDE} px are too small for it"
    if device == "cuda":
        return perceptual.why_not()
    return None if config.recipe == "paper" else "on the CPU recipe paper alone has it there"


def check_device(device: str) -> None:
    """Raises BadInput where the device of the job cannot be used."""
    if device == "cuda" and (why := why_not()):
        raise BadInput(f"train is to run on cuda, but {why}; or set train.device to cpu")


def read_clocks() -> np.ndarray:
    """(2,) s, wall and CPU time."""
    return np.array([time.perf_counter(), time.process_time()])


def due(step: int, steps: int, times: int) -> bool:
    """Whether this step (from 1) reaches one of `times` evenly spaced marks of a run."""
    return step * times // steps > (step - 1) * times // steps


def at_test(metrics: dict[str, Any]) -> dict[str, Any]:
    """The figures under their names for poses that are aligned at test time."""
    return {f"{name}_ttpo": value for name, value in metrics.items() if name != "lpips_net"}


def pick_small(rows: list[dict]) -> dict[str, float | None]:
    """The figures of `ALSO_SMALL` of scores at that size."""
    found = summary(rows)
    return {name: found[name] for name in ALSO_SMALL}


class Run:
    """One training: the recipe under a clock with its curve and checkpoints, and the files and figures of its result."""

    def __init__(self, job: Job, poses: Poses, camera: Camera, views: list[View], trained: np.ndarray, held: np.ndarray,
                 choosing: np.ndarray, turn: float):
        """camera: of the frames on disk; views: (T,), to train on, emptied after that. Indices of frames: trained (n,); held (m,),
        which are judged; choosing (c,), which the recipe chooses by. turn: degrees of 360 from which these show the person.
        """
        self.job, self.poses, self.camera, self.views, self.trained, self.held = job, poses, camera, views, trained, held
        self.choosing, self.turn, self.trained_camera = choosing, turn, views[0].frame
        self.curve: list[dict] = []
        self.losses: list[float] = []
        self.aside = np.zeros(2)  # wall and CPU seconds spent on judging
        self.checkpoints = Checkpoints(job.scratch, job.warn)
        self.resumed_at: int | None = None
        here = [name for name in job.config.wishes() if name in job.models]
        self.networks = {name: VggHed.read(job.models[name]) if name == VGG_HED else Lpips.read(name, job.models[name])
                         for name in here}
        self.in_loss = job.config.in_loss()
        if self.in_loss not in here or without_lpips(job.config, job.device, views[0].frame):
            self.in_loss = None

    @cached_property
    def filmed(self) -> dict[int, View]:
        """Held-out frame -> its view, whole and as large as it was filmed."""
        return self.read(self.held)

    def read(self, frames: np.ndarray) -> dict[int, View]:
        """`read_whole` of frames, (n,) indices."""
        return read_whole(self.job.inputs["split/frames"], self.job.inputs["segment/alpha"], self.camera, frames,
                          self.poses.params.occluder)

    def fit(self) -> None:
        """Runs the recipe, from a checkpoint where there is one."""
        config, chosen_by = self.job.config, {}
        if config.recipe == "fast":
            chosen_by = self.filmed if self.choosing is self.held else self.read(self.choosing)
        self.began = read_clocks()
        task = Task(self.views, self.trained, self.choosing, self.poses, config, self.job.progress, self.checkpoint,
                    self.marks, self.keep, filmed=chosen_by,
                    network=self.networks[self.in_loss] if self.in_loss else None)
        state = self.checkpoints.read()
        if state is not None:
            self.restore(state)
            task.resumed = state["recipe"]
        self.result = RECIPES[config.recipe, self.job.device](task)
        self.seconds, self.cpu_seconds = self.clock()
        require_finite("after the last step", named_result(self.result.gaussians, self.poses))

    @cached_property
    def unseen(self) -> list[str]:
        """`unseen_parts` of the result."""
        return unseen_parts(self.result.gaussians.face, self.result.seen, self.poses.body)

    def coarser(self) -> Iterator[Gaussians]:
        """The coarser levels, each once it is fitted."""
        for level in self.result.coarser:
            require_finite("after the last step", named_values(level))
            yield level

    def clock(self) -> np.ndarray:
        """(2,) s, wall and CPU time of training, including that before a stop, without judging."""
        return read_clocks() - self.began - self.aside

    def keep(self, step: int, steps: int, state: Callable[[], State]) -> None:
        """Writes a checkpoint if it is time for one."""
        if self.checkpoints.due(ends=step == steps):
            self.checkpoints.write({"step": step, "steps": steps, "recipe": state(), "poses": self.poses.state(),
                                    "curve": self.curve, "losses": self.losses, "spent": self.clock()})

    def restore(self, state: State) -> None:
        """Takes up where a stopped run's checkpoint stands."""
        self.resumed_at = state["step"]
        self.job.resumed(state["step"], state["steps"], "steps")
        self.poses.restore(state["poses"])
        self.curve, self.losses = state["curve"], state["losses"]
        self.began -= state["spent"]

    def marks(self, steps: int) -> list[int]:
        """The steps that get a row of the curve."""
        return [step for step in range(1, steps + 1) if any(due(step, steps, n) for n in (LOSS_ROWS, self.job.config.curve))]

    def checkpoint(self, step: int, steps: int, loss: float, gaussians: Callable[[], Gaussians],
                   gpu_seconds: float | None = None) -> None:
        """Notes a step's loss; adds a row to the curve at its marks. gaussians: a function that returns them as they stand."""
        self.losses.append(loss)
        if not any(due(step, steps, n) for n in (LOSS_ROWS, self.job.config.curve)):
            return
        before = self.clock()
        seconds, cpu_seconds = (round(float(x), 3) for x in before)
        row = {"step": step, "seconds": seconds, "cpu_seconds": cpu_seconds, "loss": float(np.mean(self.losses))}
        if gpu_seconds is not None:
            row["gpu_seconds"] = round(gpu_seconds, 4)
        self.losses.clear()
        if len(self.held) and due(step, steps, self.job.config.curve):
            shown = gaussians()
            row |= {"psnr_fg": self.psnr_fg(shown, self.poses_of_all(), self.filmed), "n_gaussians": len(shown)}
        self.curve.append(row)
        self.aside += self.clock() - before

    def poses_of_all(self) -> Poses:
        """The poses, those of frames that were not trained on interpolated between their neighbours."""
        return carry_to_untrained(self.poses, self.trained)

    def psnr_fg(self, gaussians: Gaussians, poses: Poses, views: dict[int, View]) -> float | None:
        """dB on the person, mean over some frames; None of no frame."""
        return mean_psnr(judge_person([Candidate(gaussians, poses, list(views), views)])[0], "mse_fg")

    def judge_fit_and_trained(self, gaussians: Gaussians, poses: Poses) -> list[float | None]:
        """`psnr_fg` of the held-out frames in the body fit's poses, and of some trained frames."""
        fitted = poses.copy()
        fitted.pose, fitted.transl = poses.fit_pose, poses.fit_transl
        trained = self.read(self.trained[:: -(-len(self.trained) // TRAIN_SAMPLE)])
        judged = judge_person([Candidate(gaussians, fitted, list(self.filmed), self.filmed),
                               Candidate(gaussians, poses, list(trained), trained)])
        return [mean_psnr(rows, "mse_fg") for rows in judged]

    def judge_both(self, gaussians: Gaussians, poses: Poses, small: dict[int, View],
                   folder: Path | None = None) -> tuple[list[dict], list[dict]]:
        """Scores of the held-out frames as filmed and in their small views. folder: for the images as filmed."""
        rows = judge(gaussians, poses, self.held, self.filmed, folder, self.job.config.flip, self.networks)
        return rows, rows if self.camera.height <= SMALL else judge(gaussians, poses, self.held, small)

    def judge_aligned(self, gaussians: Gaussians, poses: Poses, small: dict[int, View]) -> tuple[list[dict], list[dict]]:
        """As `judge_both`, each time after the poses, which stay where they end, were aligned to the frames at that size."""
        BACKENDS[self.job.device].align_poses(gaussians, poses, self.held, small, self.job.config.pose_test_steps)
        if self.camera.height <= SMALL:
            return self.judge_both(gaussians, poses, small)
        small_rows = judge(gaussians, poses, self.held, small)
        converge(gaussians, poses, self.held, self.filmed, LAST_ROUNDS)
        return judge(gaussians, poses, self.held, self.filmed, None, self.job.config.flip, self.networks), small_rows

    def write(self) -> float:
        """Writes the stage's outputs; returns the share of the body's surface in view."""
        job, gaussians = self.job, self.result.gaussians
        folder = job.out / "heldout"
        folder.mkdir()
        job.progress(0, *JUDGING)
        with ThreadPoolExecutor(2) as aside:
            seeing = aside.submit(seen_area, self.poses, self.trained, self.views)
            poses = self.poses_of_all()
            drawing = aside.submit(self.write_poses, poses, folder / "views.png")
            writing = aside.submit(self.write_avatar, seeing)
            figures = json.dumps(self.metrics(gaussians, poses, folder, seeing), indent=1) + "\n"
            drawing.result()
            writing.result()
        write_file(job.out / "metrics.json", figures.encode())
        self.tell_timings()
        return seeing.result()

    def write_poses(self, poses: Poses, picture: Path) -> None:
        """Writes the poses, and a picture of the avatar from all round."""
        poses.to_params().write(self.job.out / "body.npz")
        write_frame(picture, draw_all_round(self.result.gaussians, poses))

    def write_avatar(self, seeing: Future[float]) -> None:
        """Writes the gaussians with their levels, and once these are there, gives back the memory of the views, which nobody needs
        any more: judging takes as much again. seeing: looks at the views, too.
        """

        def levels() -> Iterator[Gaussians]:
            yield from self.coarser()
            seeing.result()
            self.views.clear()
            hand_back()

        self.result.gaussians.write(self.job.out / "avatar.npz", levels())

    def tell_timings(self) -> None:
        """Tells the engine how long training took, and where it went on from, which a run of equal inputs would not repeat."""
        for name, value in (("seconds", round(float(self.seconds), 3)), ("cpu_seconds", round(float(self.cpu_seconds), 3)),
                            ("gpu_seconds", self.curve[-1].get("gpu_seconds")), ("resumed_at_step", self.resumed_at),
                            ("curve", [{key: row[key] for key in TIMES if key in row} for row in self.curve])):
            self.job.timing(name, value)

    def metrics(self, gaussians: Gaussians, poses: Poses, folder: Path, seeing: Future[float]) -> dict:
        """The content of metrics.json. folder: where the images of held-out frames go; seeing: the share of the surface in view."""
        config, held = self.job.config, self.held
        small = {t: view.reduced(SMALL) for t, view in self.filmed.items()}
        trained = self.trained_camera
        aligned, ttpo, small_ttpo = poses.copy(), [], []
        with ThreadPoolExecutor(1 if self.job.device == "cpu" else 2) as aside:  # a GPU is this thread's alone
            judging = aside.submit(self.judge_both, gaussians, poses, small, folder)
            comparing = aside.submit(self.judge_fit_and_trained, gaussians, poses)
            bending = aside.submit(judge_novel, gaussians, poses)
            looking = aside.submit(lambda: judge_levels(gaussians, self.coarser(), poses,
                                                        {t: view.reduced(trained.height) for t, view in self.filmed.items()}))
            if self.job.device == "cpu":
                beside: list[Future[Any]] = [judging, comparing, looking, bending]
                wait(beside)  # twice as many frames at once would take twice the memory
            if config.pose_test_steps:
                ttpo, small_ttpo = self.judge_aligned(gaussians, aligned, small)
            self.job.progress(1, *JUDGING)
            likeness = judge_likeness(gaussians, aligned, held, small, self.camera.height)
            rows, small_rows = judging.result()
            self.job.progress(2, *JUDGING)
            of_fit, of_trained = comparing.result()
            self.job.progress(3, *JUDGING)
        return summary(rows) | at_test(summary(ttpo)) | {
            f"at_{SMALL}": pick_small(small_rows) | at_test(pick_small(small_ttpo)),
            "psnr_fg_fit": of_fit,
            "psnr_fg_train": of_trained,
            "pose_at_test": {
                "psnr_fg": "between the refined poses of the neighbouring trained frames, plus what the body fit has beside its "
                           "own there, as far as that proved right in trained frames; in the first and last frame and between far "
                           "views the fit's pose with the neighbours' correction; the held-out image is not used",
                "*_ttpo": f"that pose, {config.pose_test_steps} steps optimised on the held-out image, and moved once more onto "
                          "it as filmed; avatar frozen",
                "psnr_fg_fit": "the body fit's pose as it came",
            },
            "light": None if gaussians.light is None else gaussians.light.tolist(),
            "n_gaussians": len(gaussians), "steps": self.curve[-1]["step"], "recipe": config.recipe,
            "device": self.job.device, "seed": config.seed,
            "image_size": [self.camera.width, self.camera.height], "trained_size": [trained.width, trained.height],
            "trained_frames": len(self.trained), "heldout_frames": [int(t) for t in held],
            "heldout": [{"frame": t, "face_box": find_boxes(poses, t, self.camera).get("face"), **figures(row),
                         **at_test(figures(other))}
                        for t, row, other in zip(map(int, held), rows, ttpo or [dict.fromkeys(row, np.nan) for row in rows],
                                                 strict=True)],
            "lpips_in_loss": self.in_loss == NETWORKS[0], **({"vgg_hed_in_loss": True} if self.in_loss == VGG_HED else {}),
            "levels": looking.result(),
            "likeness": likeness,
            "seen_area": seeing.result(), "unseen_parts": self.unseen, "turn_degrees": self.turn,
            "unseen_gaussians": int((~self.result.seen).sum()),
            **bending.result(),
            "curve": [{key: value for key, value in row.items() if key not in TIMES} for row in self.curve],
        } | self.result.figures
