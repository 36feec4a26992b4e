"""Random plausible bodies, from which the shape basis is computed."""

from __future__ import annotations

import numpy as np
from source import Source

ODD = ("nipple", "pregnant", "bulge", "age", "trans-out", "breast-point")
"""Parts of the names of sliders that stay at zero."""


def sample_coefficients(source: Source, count: int, rng: np.random.Generator) -> np.ndarray:
    """Draws blend-shape coefficients (count, K) of plausible teenage and adult bodies with symmetric local shape."""
    man = rng.random(count) < 0.5
    phenotypes = np.stack([
        np.where(man, rng.uniform(0.75, 1, count), rng.uniform(0, 0.25, count)),
        rng.uniform(0.55, 0.9, count), rng.normal(0.5, 0.18, count), rng.normal(0.5, 0.2, count),
        rng.normal(0.5, 0.15, count) + np.where(man, 0.03, -0.03), rng.normal(0.5, 0.25, count),
    ], 1).clip(0, 1)
    labels = source.model.local_change_labels
    local = np.zeros((count, len(labels)))
    for i, label in enumerate(labels):
        if label.startswith("r-"):
            local[:, i] = local[:, labels.index("l-" + label[2:])]
        elif not any(word in label for word in ODD):
            local[:, i] = rng.normal(0, 0.2, count)
    for side_pair in ("foot-trans-out", "hand-trans-out", "eye-trans-out"):
        local[:, labels.index(f"r-{side_pair}")] = local[:, labels.index(f"l-{side_pair}")]
    return source.coefficients(phenotypes, local.clip(-1, 1))
