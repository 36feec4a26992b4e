"""Systematic errors of a detector, measured: offsets of its points from the body's, and their change with the body's yaw.

A network trained on few backs and sides pulls its points there towards the views it knows: an ear slides, a hidden wrist comes
nearer. The error repeats for each view, so that it can be measured and subtracted.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from gsac.avatar.artifacts import check_arrays, read_arrays
from gsac.avatar.body import Body
from gsac.avatar.wholebody import INDEX
from gsac.stages.brought_file import NONE, read_brought
from gsac.stages.contract import BadInput, Job
from gsac.stages.smplx.symmetry import mirror_directions

FILES = {"mediapipe": Path(__file__).parent / "offsets" / "mediapipe.npz"}
"""Detector -> its errors, measured on truth clips by `tools/detector_offsets.py`."""
HARMONICS = 3
"""H, of the yaw."""
SHAPES = {"offsets": (133, 3), "by_betas": (133, 3, "F"), "own": (133, 3, "K"), "habit": (133, 2 * HARMONICS + 1, 2),
          "spread": (133,), "model": ()}
"""Of a file of errors; `model` is the digest of the body on which they were measured."""
UNKNOWN, UNKNOWN_FACE = 0.006, 0.009
"""Spreads of an unmeasured detector, as a share of the person's height; wider for eyes, ears and nose, whose definitions differ."""
PERSONAL = {"shoulder": (6, 4, 3), "elbow": (8, 3, 3), "wrist": (7, 2, 2), "hip": (4, 17, 3), "knee": (4, 12, 4),
            "ankle": (2, 7, 3), "big_toe": (3, 5, 5), "heel": (3, 6, 5)}
"""Points that a detector places differently on different people, and the standard deviation, mm along x, y, z, if unmeasured."""


def read_errors(path: Path) -> dict[str, np.ndarray]:
    """The arrays (...) of a file of errors, by name. Raises ArtifactError."""
    return check_arrays(path, SHAPES)


def find_errors(job: Job, body: Body, detector: str) -> str | Path:
    """What `Detector.load` takes: the file that `smplx.detector_offsets` names, else the detector's name. Raises BadInput."""
    name = job.config.detector_offsets
    if name == NONE:
        return detector
    measured_on = str(read_brought(job, "smplx", "detector_offsets", read_errors)["model"])
    if measured_on != body.digest:
        raise BadInput(f"smplx.detector_offsets is {name}: it was measured on the body {measured_on[:12]}, smplx.body_model is "
                       f"{body.digest[:12]}; measure anew with that body, or leave it out")
    return job.models[name]


@dataclass
class Detector:
    """Errors at the 133 points of COCO-WholeBody, over 2 H + 1 harmonics of the yaw: 1, cos 1..H, sin 1..H."""

    offsets: np.ndarray  # (133, 3) m, in the T-pose axes of the joint that carries the point
    by_betas: np.ndarray  # (133, 3, F) m a unit: slopes of the offsets by the figure's betas
    own: np.ndarray
    """(133, 3, K) m, in the same axes: K directions in which people differ beyond their betas, one standard deviation long."""
    habit: np.ndarray  # (133, 2 H + 1, 2) error by the yaw, as a share of the person's height in px
    spread: np.ndarray  # (133,) standard deviation of the rest, the same shares

    @classmethod
    def load(cls, source: str | Path, body: Body) -> Detector:
        """The measured errors of a detector of that name, or in that file; zero with wide spreads where the detector or this body
        was not measured."""
        path = source if isinstance(source, Path) else FILES.get(source)
        arrays = None if path is None else read_arrays(path)
        if arrays is None or str(arrays["model"]) != body.digest:
            spread = np.full(133, UNKNOWN)
            spread[:5] = UNKNOWN_FACE
            own, metres = mirror_directions(PERSONAL, INDEX, 133)
            return cls(np.zeros((133, 3)), np.zeros((133, 3, 0)), own * metres, np.zeros((133, 2 * HARMONICS + 1, 2)), spread)
        return cls(*(arrays[f.name].astype(np.float64) for f in fields(cls)))

    def slopes(self, body: Body) -> np.ndarray:
        """(133, 3, B) m a unit: slopes of the offsets by all betas of the body."""
        return np.pad(self.by_betas, ((0, 0), (0, 0), (0, body.num_betas - self.by_betas.shape[2])))

    def error(self, yaw: np.ndarray) -> np.ndarray:
        """Error (T, 133, 2) that the detector adds to the true place, as a share of the person's height in px. yaw: (T,) rad."""
        return np.einsum("th,phc->tpc", harmonics(yaw), self.habit)


def harmonics(yaw: np.ndarray) -> np.ndarray:
    """The basis (T, 2 H + 1) at yaw (T,) rad."""
    angle = np.multiply.outer(yaw, np.arange(1, HARMONICS + 1))
    return np.concatenate([np.ones((len(yaw), 1)), np.cos(angle), np.sin(angle)], 1)
