"""How far a fitted body's surface lands from the truth's in poses that the clip does not show: a fit judged without a training.

    python -m gsac.benchmarks.unseen_surface CLIP UNSEEN BODY.npz [BODY.npz ...]

CLIP is a turntable's folder, UNSEEN one of the same person in `--poses novel` or `strong`, BODY a body.npz of `smplx` or `train`.
A training binds to the body what the frames show where the body lies. So each point of its surface stands for the point of the true
one that the same pixel shows, and is asked where it comes to lie when the truth's joint angles pose the body. The truth's surface
is bare: of the truth's own body in clothes 1.9 px in the mean remain at 1280 px.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from gsac.avatar.artifacts import read_arrays
from gsac.avatar.body import Body, BodyParams
from gsac.avatar.camera import Camera
from gsac.avatar.joints import INDEX
from gsac.avatar.rotation import exp
from gsac.avatar.yaw import yaw
from gsac.avatar.zbuffer import rasterise, visible_points
from gsac.benchmarks.speed_accuracy.novel_poses import read_true_params, transfer_poses

PARTS = {
    "trunk": ("pelvis", "spine1", "spine2", "spine3", "left_collar", "right_collar"), "head": ("neck", "head", "jaw"),
    "upper arms": ("left_shoulder", "right_shoulder"), "forearms": ("left_elbow", "right_elbow"),
    "thighs": ("left_hip", "right_hip"), "shanks": ("left_knee", "right_knee"),
    "feet": ("left_ankle", "right_ankle", "left_foot", "right_foot"),
}
"""Part -> the joints that carry it; all others carry the hands."""
FACING, FRAMES = np.radians(50), 6
"""Largest yaw of the clip's frames that are looked at, as novel poses turn no farther, and their number, at most."""


class Scene(NamedTuple):
    """A person as they truly are in T frames."""

    params: BodyParams
    """Pose, joints and camera."""
    vertices: np.ndarray
    """(T, N, 3) m, camera frame."""
    faces: np.ndarray
    """(F, 3) into N."""
    part: np.ndarray
    """(N,) of `parts_of_vertices`."""

    @classmethod
    def read(cls, folder: Path, body: Body) -> Scene:
        """Of a turntable's folder: the surface as drawn where its truth holds it, else the bare body."""
        truth = folder / "truth.npz"
        params, arrays, part = read_true_params(truth, body.digest), read_arrays(truth), parts_of_vertices(body)
        if "drawn" not in arrays:
            return cls(params, arrays["vertices"], body.faces, part)
        _, below = KDTree(arrays["vertices"][0]).query(arrays["drawn"][0])
        return cls(params, arrays["drawn"], arrays["drawn_faces"], part[below])

    @property
    def camera(self) -> Camera:
        """Of images as large as the principal point in their middle tells."""
        width, height = (round(2 * float(c)) for c in self.params.center)
        return self.params.camera(width, height)


def measure(body: Body, fit: BodyParams, clip: Scene, unseen: Scene) -> dict[str, np.ndarray]:
    """Part -> (n,) px by which the fit's surface misses the truth's in `unseen`, over points that both show there.

    fit: of the clip's frames. Raises ValueError where only one of the scenes has the surface as drawn.
    """
    if clip.vertices.shape[1] != unseen.vertices.shape[1]:
        raise ValueError("the clip's surface has other vertices than that of the unseen poses; make both of one seed, both with or "
                         "both without --drawn")
    posed = transfer_poses(fit, unseen.params, body)
    own, true = posed.camera(unseen.camera.width, unseen.camera.height), unseen.camera
    places = body.posed(posed)[0]
    depths = [(rasterise(mine, body.faces, own)[2], rasterise(theirs, unseen.faces, true)[2])
              for mine, theirs in zip(places, unseen.vertices, strict=True)]
    part, misses = parts_of_vertices(body), {name: [np.zeros(0)] for name in (*PARTS, "hands")}
    for t in facing_frames(clip.params):
        which, face, bary = correspond(body, fit, clip, t, part)
        for mine, theirs, (my_depth, true_depth) in zip(places, unseen.vertices, depths, strict=True):
            goal = np.einsum("nk,nkc->nc", bary, theirs[unseen.faces[face]])
            both = visible_points(goal, true_depth, true) & visible_points(mine[which], my_depth, own)
            miss = np.linalg.norm(own.project(mine[which[both]]) - true.project(goal[both]), axis=1)
            for number, name in enumerate(misses):
                misses[name].append(miss[part[which[both]] == number])
    return {name: np.concatenate(found) for name, found in misses.items()}


def correspond(body: Body, fit: BodyParams, clip: Scene, t: int, part: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (n,) of the fit that frame t shows, and the true surface in the same pixels, of the same part: faces (n,), weights
    (n, 3) of their corners. part: (V,) of `parts_of_vertices`.
    """
    camera, mine = fit.camera(clip.camera.width, clip.camera.height), body.posed(fit, [t])[0][0]
    face, bary, _ = rasterise(clip.vertices[t], clip.faces, clip.camera)
    which = np.flatnonzero(visible_points(mine, rasterise(mine, body.faces, camera)[2], camera))
    x, y = camera.project(mine[which]).astype(np.int64).T
    same = (face[y, x] >= 0) & (clip.part[clip.faces[face[y, x], 0]] == part[which])
    return which[same], face[y, x][same], bary[y, x][same]


def facing_frames(params: BodyParams) -> np.ndarray:
    """Frames (n,) in which the person faces the camera about as in poses that are not seen."""
    facing = np.flatnonzero(np.abs(yaw(exp(params.pose[:, 0].astype(np.float64)))) <= FACING)
    return facing[::-(-len(facing) // FRAMES)] if len(facing) else facing


def parts_of_vertices(body: Body) -> np.ndarray:
    """(V,) number of each vertex's part, `PARTS` and then the hands."""
    joint = np.full(len(body.parents), len(PARTS))
    for number, names in enumerate(PARTS.values()):
        joint[[INDEX[name] for name in names]] = number
    return joint[np.asarray(body.weights).argmax(1)]


def main() -> None:
    """Prints a row a fit: median and mean over all points, then each part's median."""
    parser = argparse.ArgumentParser(prog="python -m gsac.benchmarks.unseen_surface",
                                     description="How far a fit's surface lands from the truth's in poses never seen, px.")
    parser.add_argument("clip", type=Path, help="a turntable's folder")
    parser.add_argument("unseen", type=Path, help="the same person's, with --poses novel or strong")
    parser.add_argument("bodies", type=Path, nargs="+", metavar="BODY.npz", help="fits of the clip")
    options, body = parser.parse_args(), Body.load()
    clip, unseen = (Scene.read(folder, body) for folder in (options.clip, options.unseen))
    print("body", "median", "mean", *PARTS, "hands", sep=",")
    for path in options.bodies:
        misses = measure(body, BodyParams.read(path), clip, unseen)
        every = np.concatenate(list(misses.values()))
        figures = (np.median(every), every.mean(), *(np.median(miss) if len(miss) else np.nan for miss in misses.values()))
        print(path, *(f"{figure:.2f}" for figure in figures), sep=",", flush=True)


if __name__ == "__main__":
    main()
