"""Accuracy of the stages `keypoints` and `face` against independent detections and rendered truth.

`python -m gsac.benchmarks.perception FOOTAGE STORE [--draw DIR]`: FOOTAGE holds `squats`, `truth-a` and `turn-photos`,
STORE is the cache folder that `gsac models pull` filled. Prints one JSON object a clip.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from gsac.avatar.artifacts import Clip, frame_paths, read_arrays
from gsac.avatar.frame_files import read_frame, write_frame
from gsac.avatar.network_files import model_path
from gsac.avatar.wholebody import FACE, HANDS
from gsac.stages.contract import Job, Stage

VISIBLE = 0.25
"""Least share of its vertices that the camera sees of a visible hand; the largest possible is 0.65."""
BONES = [0] + [4 * finger + joint for finger in range(5) for joint in (1, 2, 3)]
"""Hand points that are a bone's head in the rendered truth: the wrist and three joints a finger."""
ACTIONS = {"jaw": ("jawOpen",), "blink": ("eyeBlinkLeft", "eyeBlinkRight"),
           "smile": ("mouthSmileLeft", "mouthSmileRight"), "brow": ("browInnerUp",)}
"""Facial actions that the rendered clip moves, by group."""


def video_frames(path: Path) -> Iterator[np.ndarray]:
    """Decodes the frames of a video, (H, W, 3) uint8 RGB each."""
    import imageio_ffmpeg

    reader = imageio_ffmpeg.read_frames(str(path))
    width, height = next(reader)["size"]
    for data in reader:
        yield np.frombuffer(data, np.uint8).reshape(height, width, 3)


def write_split(frames: Iterator[np.ndarray], folder: Path) -> dict[str, Path]:
    """Writes frames and clip.json as `split` does. frames: (H, W, 3) uint8 RGB each. Returns port -> path."""
    (folder / "frames").mkdir(parents=True)
    n = 0
    for n, image in enumerate(frames, 1):
        write_frame(folder / "frames" / f"{n - 1:06d}.png", image)
    clip = Clip(fps=5.0, timestamps_s=[t / 5 for t in range(n)], width=image.shape[1], height=image.shape[0],
                focal_px=None, source_sha256="")
    clip.write(folder / "clip.json")
    return {"split/frames": folder / "frames", "split/clip.json": folder / "clip.json"}


def run_stage(stage: Stage, run: Callable[[Job], None], inputs: dict[str, Path], out: Path, store: Path,
              **parameters: Any) -> dict:
    """Runs one stage and checks its outputs. Returns its warnings, and CPU and wall milliseconds a frame."""
    config = stage.config(**parameters)
    warnings: list[str] = []
    out.mkdir()
    job = Job(inputs=inputs, out=out, config=config, warn=lambda finding: warnings.append(finding.message),
              models={name: model_path(name, store) for name in stage.models(config)})
    cpu, wall = time.process_time(), time.perf_counter()
    run(job)
    n = len(frame_paths(inputs["split/frames"]))
    cpu, wall = (time.process_time() - cpu) / n, (time.perf_counter() - wall) / n
    for output in stage.outputs:
        output.check(out / output.path)
    return {"warnings": warnings, "cpu_ms_a_frame": round(cpu * 1e3, 1), "wall_ms_a_frame": round(wall * 1e3, 1)}


def run_keypoints(frames: Iterator[np.ndarray], folder: Path, store: Path) -> tuple[dict, dict, dict]:
    """Runs `keypoints` on frames (H, W, 3) uint8 RGB. Returns arrays of keypoints.npz, what `run_stage` gives, and all ports."""
    from gsac.stages.keypoints import STAGE
    from gsac.stages.keypoints.stage import run

    ports = write_split(frames, folder / "split")
    notes = run_stage(STAGE, run, ports, folder / "keypoints", store)
    ports["keypoints/keypoints.npz"] = folder / "keypoints" / "keypoints.npz"
    return read_arrays(ports["keypoints/keypoints.npz"]), notes, ports


def run_face(ports: dict[str, Path], folder: Path, store: Path, **parameters: Any) -> tuple[dict, dict]:
    """Runs `face` on the ports of `run_keypoints`. Returns the arrays of face.npz and the dict of `run_stage`."""
    from gsac.stages.face import STAGE
    from gsac.stages.face.stage import run

    notes = run_stage(STAGE, run, ports, folder / "face", store, **parameters)
    return read_arrays(folder / "face" / "face.npz"), notes


def score_squats(arrays: dict, reference: np.ndarray) -> dict:
    """Share of frames with a person, and median distance from the reference in percent of the person's height.

    reference: (T, 33, 3) px, by an independent implementation of the same body network.
    """
    apart = np.linalg.norm(arrays["pose33"][..., :2] - reference[..., :2], axis=-1)
    height = np.ptp(reference[..., 1], axis=1)[:, None]
    return {"person": float(arrays["score"].any(axis=1).mean()),
            "points_median_percent_of_height": round(float(np.median(apart / height) * 100), 2)}


def score_truth(arrays: dict, truth: dict) -> dict:
    """Errors of body and hand points and detection rates. truth: arrays of the 104-bone rig's truth.npz."""
    apart = np.linalg.norm(arrays["xy"][:, :17] - truth["coco2d"][:, :17], axis=-1)
    joints = [str(name) for name in truth["joint_names"]]
    found, seen, px, false = [], [], [], 0
    for column, (side, points) in enumerate(HANDS.items()):
        tag = side[0].upper()
        bones = [joints.index(f"wrist.{tag}")] + [joints.index(f"finger{f}-{j}.{tag}") for f in range(1, 6)
                                                  for j in (1, 2, 3)]
        error = np.linalg.norm(arrays["xy"][:, points][:, BONES] - truth["joints2d"][:, bones], axis=-1)
        got = arrays["score"][:, points].any(axis=1)
        visible = truth["vis_hand"][:, column] > VISIBLE
        found.append(got), seen.append(visible)
        px.append(error[got & visible])
        size = np.ptp(truth["joints2d"][:, bones], axis=1).max(axis=1)
        false += int((got & (np.median(error, axis=1) > size / 2)).sum())
    found, seen = np.array(found), np.array(seen)
    yaw = (np.degrees(truth["yaw"]) + 180) % 360 - 180
    face = arrays["score"][:, FACE].any(axis=1)
    return {"person": int(arrays["score"].any(axis=1).sum()), "body_median_px": round(float(np.median(apart)), 2),
            "body_p90_px": round(float(np.percentile(apart, 90)), 2),
            "visible_hands_found": round(float(found[seen].mean()), 3),
            "hand_median_px": round(float(np.median(np.concatenate(px))), 2),
            "hand_p90_px": round(float(np.percentile(np.concatenate(px), 90)), 2),
            "hands_in_the_wrong_place": false, "face_found": round(float(face.mean()), 3),
            "face_found_within_75_deg": round(float(face[np.abs(yaw) < 75].mean()), 3),
            "face_found_beyond_110_deg": round(float(face[np.abs(yaw) > 110].mean()), 3)}


def score_expression(face: dict, truth: dict) -> dict:
    """Correlation and slope of the estimated against the true actions, by group, over frames with a valid face.

    None where nothing moves.
    """
    names = [str(name) for name in truth["expr_names"]]
    out = {"face_valid": int(face["valid"].sum())}
    for what, members in ACTIONS.items():
        columns = [names.index(name) for name in members]
        said = face["expression"][face["valid"]][:, columns].mean(axis=1)
        true = truth["exprs"][face["valid"]][:, columns].mean(axis=1)
        still = true.std() == 0 or said.std() == 0
        out[what] = None if still else round(float(np.corrcoef(said, true)[0, 1]), 3)
        out[f"{what}_slope"] = None if still else round(float(np.polyfit(true, said, 1)[0]), 2)
    moved = [names.index(name) for members in ACTIONS.values() for name in members]
    out["actions_at_rest_mean"] = round(float(np.delete(face["expression"][face["valid"]], moved, axis=1).mean()), 4)
    return out


def draw(arrays: dict, frames: list[Path], path: Path, columns: int = 6, rows: int = 3, height: int = 640) -> None:
    """Writes a contact sheet of frames and points: body green, feet yellow, face blue, left hand red, right hand violet."""
    import cv2

    colours = [(slice(0, 17), (0, 255, 0)), (slice(17, 23), (255, 255, 0)), (FACE, (80, 160, 255)),
               (HANDS["left"], (255, 60, 60)), (HANDS["right"], (230, 60, 255))]
    tiles = []
    for t in np.linspace(0, len(frames) - 1, min(len(frames), columns * rows)).round().astype(int):
        image = read_frame(frames[t])
        scale = height / image.shape[0]
        image = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        for points, colour in colours:
            for xy, score in zip(arrays["xy"][t, points], arrays["score"][t, points], strict=True):
                if score > 0:
                    dimmed = [int(c * (0.3 + 0.7 * score)) for c in colour]
                    cv2.circle(image, tuple(int(v) for v in xy * scale), 2, dimmed, -1)
        cv2.putText(image, str(t), (4, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (255, 255, 255), 2)
        tiles.append(image)
    tiles += [np.zeros_like(tiles[0])] * (-len(tiles) % columns)
    write_frame(path, np.vstack([np.hstack(tiles[i:i + columns]) for i in range(0, len(tiles), columns)]))


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m gsac.benchmarks.perception", description=__doc__.splitlines()[0])
    parser.add_argument("footage", type=Path, metavar="FOOTAGE", help="folder with squats, truth-a and turn-photos")
    parser.add_argument("store", type=Path, metavar="STORE", help="cache folder that `gsac models pull` filled")
    parser.add_argument("--draw", type=Path, metavar="DIR", help="folder for contact sheets")
    arguments = parser.parse_args()
    truth = read_arrays(arguments.footage / "truth-a" / "truth.npz")
    reference = np.array(json.loads((arguments.footage / "squats" / "pose_squats.full.json").read_text()))
    photos = sorted((arguments.footage / "turn-photos").glob("[0-9]*.jpg"))
    clips = {
        "squats": (video_frames(arguments.footage / "squats" / "pose_squats.mp4"),
                   lambda arrays: score_squats(arrays, reference)),
        "truth-a": (video_frames(arguments.footage / "truth-a" / "clip.mp4"),
                    lambda arrays: score_truth(arrays, truth)),
        "turn-photos": (map(read_frame, photos), lambda arrays: {
            "person": int(arrays["score"].any(axis=1).sum()), "of": len(photos),
            "hands": [int(arrays["score"][:, points].any(axis=1).sum()) for points in HANDS.values()],
            "face": int(arrays["score"][:, FACE].any(axis=1).sum())}),
    }
    for name, (frames, score) in clips.items():
        with tempfile.TemporaryDirectory() as folder:
            arrays, notes, ports = run_keypoints(frames, Path(folder), arguments.store)
            print(json.dumps({"clip": name, **score(arrays), **notes}))
            face, notes = run_face(ports, Path(folder), arguments.store)
            fit = score_expression(face, truth) if name == "truth-a" else {"face_valid": int(face["valid"].sum())}
            print(json.dumps({"clip": name, **fit, **notes}))
            if arguments.draw:
                draw(arrays, frame_paths(ports["split/frames"]), arguments.draw / f"{name}.png")


if __name__ == "__main__":
    main()
