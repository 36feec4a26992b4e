"""What a SMPL-X file loses on its way into an avatar: `python -m gsac.benchmarks.brought_body [SMPLX_NEUTRAL.npz]`.

In strong poses, against all weights and correctives of the file: a body of the four or eight heaviest weights a vertex (four are
drawn); the correctives as the avatar's file carries them; and none, as glTF and FBX have it. Without a file the weights are made
up, the open body's smoothed over its mesh, for its own are four at most.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.sparse import csr_matrix, diags

from gsac.avatar.body import Body
from gsac.avatar.body_file import keep_heaviest
from gsac.avatar.correctives import move_rest
from gsac.avatar.joints import FINGERS, J, turn_joints
from gsac.avatar.npz import read_npz
from gsac.avatar.skinning import joint_transforms
from gsac.avatar.sparse_correctives import thin_out
from gsac.stages.train.judge.novel_poses import POSES

SMOOTHED = (1, 4, 16, 64)
"""Rounds of smoothing of made-up weights; each halves the way to the mean of a vertex's neighbours."""
FISTS = 0.5
"""rad, spread of the fingers' turns in every pose."""


def main() -> None:
    """Prints a row for each loss."""
    parser = argparse.ArgumentParser(prog="python -m gsac.benchmarks.brought_body", description="What a SMPL-X file loses.")
    parser.add_argument("file", nargs="?", type=Path, help="an official .npz (default: made-up weights)")
    file = parser.parse_args().file
    body = Body.load(file)
    print("what,mean mm,95 % mm,99.9 % mm,worst mm")
    if file is None:
        for rounds in SMOOTHED:
            describe_weights(body, smooth(body, rounds), f"weights smoothed {rounds} times")
        return
    describe_weights(body, np.asarray(read_npz(file, {"weights"})["weights"], np.float64), "weights")
    if body.posedirs is not None:
        describe_correctives(body.posedirs)


def describe_weights(body: Body, weights: np.ndarray, name: str) -> None:
    """Prints what four and eight weights a vertex lose of all, weights (V, 55)."""
    whole = [skin_densely(body, weights, pose) for pose in strong_poses()]
    for most in (4, 8):
        few = keep_heaviest(weights, most)
        report(f"{name}: the {most} heaviest", [skin_densely(body, few, pose) - at
                                               for pose, at in zip(strong_poses(), whole, strict=True)])


def describe_correctives(posedirs: np.ndarray) -> None:
    """Prints what the sparse correctives of an avatar's file lose, and what none do. posedirs: (V, 3, 486) m."""
    thin = thin_out(posedirs)
    moves = [move_rest(posedirs, pose) for pose in strong_poses()]
    share, size = len(thin.joint) / (J - 1) / len(posedirs), len(thin.joint) * 55 / 1e6
    report(f"correctives of {share:.0%} of the pairs ({size:.1f} MB)",
           [thin.move_rest(pose) - move for pose, move in zip(strong_poses(), moves, strict=True)])
    report("no correctives (glTF and FBX)", moves)


def report(name: str, off: list[np.ndarray]) -> None:
    """Prints a row. off: of each pose (V, 3) m."""
    mm = 1e3 * np.linalg.norm(np.concatenate(off), axis=1)
    print(f'"{name}"', *(f"{value:.3f}" for value in (mm.mean(), *np.percentile(mm, (95, 99.9)), mm.max())), sep=",", flush=True)


def strong_poses() -> list[np.ndarray]:
    """Of (55, 3) axis-angle each: those that judge an avatar, with fingers turned at random."""
    rng = np.random.default_rng(0)
    poses = [turn_joints(np.zeros((J, 3)), turns) for turns in POSES.values()]
    for pose in poses:
        pose[FINGERS] = rng.normal(0, FISTS, (FINGERS.stop - FINGERS.start, 3))
    return poses


def skin_densely(body: Body, weights: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """(V, 3) m, the mean person in a pose (55, 3), axis-angle, by as many weights a vertex as weights (V, 55) has."""
    transforms = joint_transforms(pose[None], (body.J_regressor @ body.v_template).astype(np.float64), body.parents)[0]
    blended = np.tensordot(weights, transforms, 1)
    return np.einsum("vab,vb->va", blended[:, :, :3], body.v_template) + blended[:, :, 3]


def smooth(body: Body, rounds: int) -> np.ndarray:
    """(V, 55) the body's weights, smoothed over its mesh."""
    corners = np.concatenate([body.faces[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0), (1, 0), (2, 1), (0, 2))])
    near = csr_matrix((np.ones(len(corners)), tuple(corners.T)), shape=2 * (len(body.v_template),))
    near.data[:] = 1
    near = diags(1 / np.maximum(np.asarray(near.sum(1)).ravel(), 1)) @ near
    weights = body.weights.astype(np.float64)
    for _ in range(rounds):
        weights = 0.5 * weights + 0.5 * (near @ weights)
    return weights / weights.sum(1, keepdims=True)


if __name__ == "__main__":
    main()
