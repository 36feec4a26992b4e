"""Where a detector's key points lie on the body: measured on truth clips, kept with the fit.

    python -m gsac.benchmarks.detector_offsets RUN TRUTH [RUN TRUTH ...] --out stages/smplx/offsets/mediapipe.npz

RUN is a run's folder (keypoints/keypoints.npz), TRUTH the clip's truth.npz. A detector's hip is not the body's hip: for every point
one constant offset (3,) m in the frame of the joint that carries it most is found by robust least squares over all frames and
clips. Left and right share their offset, mirrored.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from gsac.avatar import rotation
from gsac.avatar.artifacts import read_arrays, write_arrays
from gsac.avatar.body import Body
from gsac.avatar.wholebody import BODY_NAMES, FEET_NAMES, INDEX, LEFT_HAND, RIGHT_HAND

POSE = ("global_orient", "body_pose", "jaw_pose", "leye_pose", "reye_pose", "left_hand_pose", "right_hand_pose")
RIDGE = 2.0
"""Pull of an offset to zero, in sightings of 1 px at 1 m."""


def carrier(body: Body) -> np.ndarray:
    """(133,) joint that carries each key point most; -1 for points that the body does not have."""
    carried = np.abs(body.keypoint_matrix) @ body.weights
    return np.where(body.known_keypoints, np.asarray(carried).argmax(1), -1)


def mirror() -> np.ndarray:
    """(133,) index of each body, foot and hand point's counterpart; face points stay."""
    out = np.arange(133)
    for name in (*BODY_NAMES, *FEET_NAMES):
        side, _, rest = name.partition("_")
        if side in ("left", "right"):
            out[INDEX[name]] = INDEX[("right_" if side == "left" else "left_") + rest]
    out[LEFT_HAND], out[RIGHT_HAND] = np.arange(RIGHT_HAND.start, RIGHT_HAND.stop), np.arange(LEFT_HAND.start, LEFT_HAND.stop)
    return out


def world_rotations(body: Body, pose: np.ndarray) -> np.ndarray:
    """pose: (T, 55, 3). Returns the joints' rotations to the camera frame (T, 55, 3, 3)."""
    world = rotation.exp(np.asarray(pose, np.float64))
    for j, p in enumerate(body.parents[1:], 1):
        world[:, j] = world[:, p] @ world[:, j]
    return world


def measure(body: Body, clips: list[tuple[Path, Path]]) -> tuple[np.ndarray, np.ndarray]:
    """Offsets (133, 3) m in the carrying joint's T-pose axes, and the median px distance before and after (133, 2)."""
    joint, other = carrier(body), mirror()
    rows: list[list] = [[] for _ in range(133)]
    for run, truth in clips:
        seen = read_arrays(run / "keypoints" / "keypoints.npz")
        z = np.load(truth, allow_pickle=False)
        pose = np.concatenate([z[name] for name in POSE], 1).reshape(-1, 55, 3)
        points = body.keypoints(z["vertices"].astype(np.float32))
        turn = world_rotations(body, pose)
        focal, center = float(np.ravel(z["focal"])[0]), z["center"]
        for p in np.nonzero(joint >= 0)[0]:
            for t in np.nonzero(seen["score"][:, p] > 0.5)[0]:
                x = points[t, p]
                slope = np.array([[focal / x[2], 0, -focal * x[0] / x[2] ** 2], [0, focal / x[2], -focal * x[1] / x[2] ** 2]])
                away = seen["xy"][t, p] - (focal * x[:2] / x[2] + center)
                rows[p].append((slope @ turn[t, joint[p]], away))
    flip = np.array([-1.0, 1, 1])
    offsets, quality = np.zeros((133, 3)), np.full((133, 2), np.nan)
    for p in np.nonzero(joint >= 0)[0]:
        both = rows[p] + [(j * flip, a) for j, a in rows[other[p]]] if other[p] != p else rows[p]
        if len(both) < 20:
            continue
        jacobian, away = np.stack([j for j, _ in both]), np.stack([a for _, a in both])
        offset = np.zeros(3)
        for _ in range(8):
            left = np.linalg.norm(away - jacobian @ offset, axis=1)
            w = 1 / (1 + (left / (2 * np.median(left) + 1e-6)) ** 2) ** 2
            normal = np.einsum("r,rab,rac->bc", w, jacobian, jacobian) + RIDGE * np.eye(3) * 1e3
            offset = np.linalg.solve(normal, np.einsum("r,rab,ra->b", w, jacobian, away))
        offsets[p] = offset
        quality[p] = np.median(np.linalg.norm(away, axis=1)), np.median(np.linalg.norm(away - jacobian @ offset, axis=1))
    return offsets, quality


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("paths", nargs="+", type=Path, help="RUN TRUTH pairs")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    body = Body.load()
    offsets, quality = measure(body, list(zip(options.paths[::2], options.paths[1::2], strict=True)))
    write_arrays(options.out, offsets=offsets.astype(np.float32), model=np.array(body.digest))
    for name in (*BODY_NAMES, *FEET_NAMES, "left_hand_wrist", "left_hand_middle1", "left_hand_middle4"):
        i = INDEX[name]
        print(f"{name:18} {quality[i, 0]:6.1f} -> {quality[i, 1]:5.1f} px   {np.round(1e3 * offsets[i])} mm")


if __name__ == "__main__":
    main()
