"""Whether another body network gives a better body: `python -m gsac.benchmarks.eyes NETWORK OFFSETS --out DIR --seeds 101 102`.

NETWORK has the interface of `pose_landmark_full`, and OFFSETS are its errors as `tools/detector_offsets.py` measures them. Every
clip is fitted with the points of the own network, of the other, and with the true ones: what the last leaves, no network mends.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from gsac.avatar.artifacts import Clip, read_arrays, write_arrays
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.network_files import model_path
from gsac.benchmarks.fit.clips import FitCase, prepare_case, render_seed
from gsac.benchmarks.fit.score import joint_distances, score
from gsac.cache.store import Store
from gsac.pipeline.journal import plain_journal
from gsac.stages.contract import Job
from gsac.stages.smplx.detector_errors import FILES

OWN, OTHER, TRUE = "own", "other", "true"
"""Whose points are fitted."""
OFFSETS = "offsets"
"""Name under which `smplx.detector_offsets` finds the errors of what is fitted."""
SCORES = ("joints_mean_mm", "worst_tenth_mm", "vertices_mean_mm")
BODY = slice(0, 23)


def main() -> None:
    """Prints a row for each clip and each of the three fits."""
    parser = argparse.ArgumentParser(prog="python -m gsac.benchmarks.eyes",
                                     description="Whether another body network gives a better body.")
    parser.add_argument("network", type=Path, help="a .tflite with the interface of pose_landmark_full")
    parser.add_argument("offsets", type=Path, help="its errors, by tools/detector_offsets.py")
    parser.add_argument("--seeds", type=int, nargs="*", default=[101, 102, 103], help="turntable clips (default: 101 102 103)")
    parser.add_argument("--clips", type=Path, nargs="*", default=[], metavar="DIR", help="truth clips at hand")
    parser.add_argument("--out", type=Path, required=True)
    options, say, store = parser.parse_args(), plain_journal(), Store.open()
    folders = [render_seed(options.out / "clips" / f"seed{seed}", seed, say) for seed in options.seeds] + options.clips
    print("clip", "points", *SCORES, sep=",")
    for folder in folders:
        case = prepare_case(folder, store, options.out / "runs" / folder.name, say)
        own = case.inputs["handgap/keypoints.npz"]
        seen = options.out / folder.name
        points = {OWN: (own, FILES["mediapipe"]),
                  OTHER: (look_with(options.network, case, seen, store.root), options.offsets)}
        if case.truth.vertices is not None:  # another rig's points are other points
            points[TRUE] = put_in_place(own, case.truth.keypoints, seen / "true.npz"), forget_errors(seen / "errors.npz")
        for whose, (path, offsets) in points.items():
            figures = judge(case, path, offsets, seen / whose)
            print(folder.name, whose, *(f"{figures.get(name, np.nan):.2f}" for name in SCORES), sep=",", flush=True)


def look_with(network: Path, case: FitCase, out: Path, store: Path) -> Path:
    """keypoints.npz of `handgap` as the case's frames show it to another body network."""
    from gsac.stages import handgap, keypoints
    from gsac.stages.handgap.stage import run as fill
    from gsac.stages.keypoints.stage import run as look

    config = keypoints.STAGE.config()
    models = {name: model_path(name, store) for name in keypoints.STAGE.models(config)} | {"pose_landmark_full": network}
    ports = {"split/clip.json": case.inputs["split/clip.json"], "split/frames": case.inputs["split/clip.json"].parent / "frames"}
    (out / "keypoints").mkdir(parents=True, exist_ok=True)
    (out / "handgap").mkdir(exist_ok=True)
    look(Job(ports, out / "keypoints", config, models))
    ports["keypoints/keypoints.npz"] = out / "keypoints" / "keypoints.npz"
    fill(Job(ports, out / "handgap", handgap.STAGE.config()))
    return out / "handgap" / "keypoints.npz"


def put_in_place(path: Path, true: np.ndarray, out: Path) -> Path:
    """The file with its seen points of body and feet at their true places (T, 23, 2) px; scores and depths stay the network's."""
    arrays = read_arrays(path)
    known = np.isfinite(true).all(-1) & (arrays["score"][:, BODY] > 0)
    arrays["xy"][:, BODY][known] = true[known]
    write_arrays(out, **arrays)
    return out


def forget_errors(out: Path) -> Path:
    """The errors of the embedded network less those of body and feet; spreads stay, so that points weigh what they weigh today."""
    arrays = read_arrays(FILES["mediapipe"])
    for name in ("offsets", "by_betas", "own", "habit"):
        arrays[name][BODY] = 0
    write_arrays(out, **arrays)
    return out


def judge(case: FitCase, points: Path, offsets: Path, out: Path) -> dict[str, float]:
    """Scores of the fit of these points, the focal length given, and the mean joint error of the worst tenth of the frames."""
    from gsac.stages.smplx import STAGE
    from gsac.stages.smplx.stage import run

    out.mkdir(parents=True, exist_ok=True)
    replace(Clip.read(case.inputs["split/clip.json"]), focal_px=case.truth.focal).write(out / "clip.json")
    ports = case.inputs | {"split/clip.json": out / "clip.json", "handgap/keypoints.npz": points}
    run(Job(ports, out, STAGE.config(detector_offsets=OFFSETS), {OFFSETS: offsets}))
    body, params = Body.load(), BodyParams.read(out / "body.npz")
    by_frame = np.sort(joint_distances(body, params, case.truth)[:, 1:].mean(1))
    return score(body, params, case.truth) | {"worst_tenth_mm": float(by_frame[-max(1, len(by_frame) // 10):].mean())}


if __name__ == "__main__":
    main()
