"""What every layout is read as."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsac.avatar.artifacts import ArtifactError
from gsac.avatar.joints import POSE_PARTS, J


@dataclass
class Poses:
    """The poses of n frames as a file has them; NaN where it says nothing."""

    vectors: np.ndarray  # (n, 55, 3) rad; fingers against the mean hand of SMPL-X
    transl: np.ndarray  # (n, 3) m
    betas: np.ndarray | None  # (B,) SMPL-X's
    """None where the file has no shape of SMPL-X."""


def assemble(parts: dict[str, np.ndarray], count: int, transl: np.ndarray | None, betas: np.ndarray | None) -> Poses:
    """Poses from SMPL-X's parts. Raises ArtifactError.

    parts: a name of POSE_PARTS -> (n, k * 3) rad; count: n; transl: (n, 3) m; betas: (n, B) or (B,), of which the mean is taken.
    Each may have dimensions of length 1 between.
    """
    vectors = np.full((count, J, 3), np.nan)
    for name, values in parts.items():
        joints = POSE_PARTS[name]
        size = joints.stop - joints.start
        if values.size != count * size * 3:
            raise ArtifactError(f"{name} has {values.size // count} numbers a frame; expected {size * 3}, rotation vectors")
        vectors[:, joints] = values.reshape(count, size, 3)
    if transl is not None and (len(transl) != count or transl.size != 3 * count):
        raise ArtifactError(f"the translation has shape {transl.shape}; expected {(count, 3)}")
    if betas is not None and not np.isfinite(betas).all():
        raise ArtifactError("the shape has a number that is not finite")
    return Poses(vectors, np.full((count, 3), np.nan) if transl is None else transl.reshape(count, 3).astype(float),
                 None if betas is None else betas.reshape(-1, betas.shape[-1]).mean(0))
