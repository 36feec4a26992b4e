"""Time of the CPU rasteriser against a vectorised torch implementation of the same tiles, in the same run.

`python -m gsac.benchmarks.raster [--sizes 270 540 1080] [--repeats 20] [--threads 1] [--json FILE]`
Figures are process CPU time, the best of many: a busy host disturbs them least.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np
from gsac.avatar import binding, raster
from gsac.avatar.camera import Camera
from gsac.avatar.gaussians import Gaussians

COUNT = 25_000
ELLIPSOIDS = (
    # centre, half axes (m), y up: head, trunk, hips, arms, hands, legs
    ((0, 1.62, 0), (0.09, 0.13, 0.10)), ((0, 1.25, 0), (0.17, 0.26, 0.11)), ((0, 0.95, 0), (0.16, 0.14, 0.11)),
    ((0.33, 1.38, 0), (0.22, 0.05, 0.05)), ((-0.33, 1.38, 0), (0.22, 0.05, 0.05)),
    ((0.60, 1.38, 0), (0.09, 0.03, 0.04)), ((-0.60, 1.38, 0), (0.09, 0.03, 0.04)),
    ((0.09, 0.65, 0), (0.08, 0.28, 0.08)), ((-0.09, 0.65, 0), (0.08, 0.28, 0.08)),
    ((0.09, 0.22, 0), (0.06, 0.26, 0.06)), ((-0.09, 0.22, 0), (0.06, 0.26, 0.06)),
)

BROAD = 1.6
"""Widens the figure until it covers a quarter of the frame."""


def figure() -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) m, camera frame, and faces (F, 3) of a person made of ellipsoids."""
    import trimesh

    parts = []
    for centre, axes in ELLIPSOIDS:
        ball = trimesh.creation.icosphere(subdivisions=4)
        ball.vertices = ball.vertices * (np.array(axes) * (BROAD, 1, BROAD)) + np.array(centre) * (BROAD, 1, 1)
        parts.append(ball)
    mesh = trimesh.util.concatenate(parts)
    return in_front(np.asarray(mesh.vertices)), np.asarray(mesh.faces, np.int32)


def in_front(vertices: np.ndarray) -> np.ndarray:
    """A canonical body (y up, facing +z) put upright before the camera, its middle on the optical axis at 3 m."""
    middle = (vertices.max(0) + vertices.min(0)) / 2
    return ((vertices - middle) * (1, -1, -1) + (0, 0, 3)).astype(np.float32)


def camera_for(vertices: np.ndarray, size: int) -> Camera:
    """The body fills the height of a square frame up to a margin of 4 %."""
    high = np.abs(vertices[:, 1] / vertices[:, 2]).max()
    focal = 0.5 * size * 0.96 / high
    return Camera((focal, focal), (size / 2, size / 2), size, size)


def scene() -> tuple[np.ndarray, np.ndarray, Gaussians, str]:
    """The open body with lowered arms where the package has it, else the ellipsoid figure; 25,000 gaussians on it."""
    vertices, faces = figure()
    gaussians = Gaussians.area(vertices, faces, COUNT, seed=0)
    random = np.random.default_rng(0)
    gaussians.rgb[:] = random.random(gaussians.rgb.shape)
    return vertices, faces, gaussians, "ellipsoids"


def best(repeats: int, work) -> float:
    """Least process CPU time of `work()`, ms."""
    least = np.inf
    for _ in range(repeats):
        start = time.process_time()
        work()
        least = min(least, time.process_time() - start)
    return 1e3 * least


def torch_tiles(state: raster.State, grad_rgb: np.ndarray, grad_alpha: np.ndarray) -> float:
    """CPU ms of one forward and backward pass of the same tiles by torch autograd, one thread; checks the image too.

    Vectorised over (gaussian, pixel) of a tile: exponent, alpha, transmittance by cumulative product, weights.
    """
    import torch

    torch.set_num_threads(1)
    size = raster.project.TILE
    projection = raster.project
    splats = torch.tensor(state.splats, requires_grad=True)
    height, width = state.alpha.shape
    padded = [-(-side // size) * size for side in (height, width)]
    wanted = torch.zeros(*padded, 4)
    wanted[:height, :width, :3], wanted[:height, :width, 3] = torch.tensor(grad_rgb), torch.tensor(grad_alpha)
    y, x = torch.meshgrid(torch.arange(size) + 0.5, torch.arange(size) + 0.5, indexing="ij")
    start = time.process_time()
    worst = 0.0
    for tile in range(len(state.tile_start) - 1):
        first, end = state.tile_start[tile], state.tile_start[tile + 1]
        if first == end:
            continue
        row, column = divmod(tile, state.columns)
        top, left = row * size, column * size
        part = splats[torch.from_numpy(state.pair_gaussian[first:end].astype(np.int64))]
        dx = (x + left).reshape(1, -1) - part[:, projection.X, None]
        dy = (y + top).reshape(1, -1) - part[:, projection.Y, None]
        s = (part[:, projection.HA, None] * dx + part[:, projection.B, None] * dy) * dx + part[:, projection.HC, None] * dy * dy
        alpha = (part[:, projection.OPACITY, None] * torch.exp(-s)).clamp(max=0.999)
        alpha = torch.where(alpha >= 1 / 255, alpha, 0.0)
        after = torch.cumprod(1 - alpha, 0)
        before = torch.cat([torch.ones_like(after[:1]), after[:-1]])
        weight = torch.where(after > 1e-4, before * alpha, 0.0)
        colour = torch.cat([part[:, projection.RED:projection.BLUE + 1], torch.ones(len(part), 1)], 1)
        image = (weight.T @ colour).reshape(size, size, 4)
        image.backward(wanted[top:top + size, left:left + size])
        got = image.detach()[:height - top, :width - left].numpy()
        worst = max(worst, np.abs(got[..., 3] - state.alpha[top:top + size, left:left + size]).max())
    seconds = time.process_time() - start
    if worst > 0.01:
        raise RuntimeError(f"the torch tiles disagree with the kernels by {worst:.3g}")
    return 1e3 * seconds


def measure(size: int, repeats: int, workers: int, against_torch: int) -> dict:
    """Times (CPU ms) of one image size, with binding and projection apart."""
    vertices, faces, gaussians, name = scene()
    camera = camera_for(vertices, size)
    workspace = raster.Workspace(workers)
    random = np.random.default_rng(1)
    grad_rgb = random.normal(size=(size, size, 3)).astype(np.float32)
    grad_alpha = random.normal(size=(size, size)).astype(np.float32)
    rendering = raster.render_bound(vertices, faces, gaussians, camera, workspace)
    state = rendering.state
    raster.render_bound_backward(state, grad_rgb, grad_alpha)
    covered = float((rendering.alpha > 0.5).mean())

    step = best(repeats, lambda: raster.render_bound_backward(
        raster.render_bound(vertices, faces, gaussians, camera, workspace).state, grad_rgb, grad_alpha))
    forward = best(repeats, lambda: raster.render(state.means, state.rotations, state.scales, gaussians.rgb,
                                                  gaussians.opacity, camera, workspace))
    backward = best(repeats, lambda: raster.render_backward(state, grad_rgb, grad_alpha))
    bind = best(repeats, lambda: binding.bind(binding.face_frames(vertices, faces), gaussians.face, gaussians.mu,
                                              gaussians.quat, gaussians.log_scale))
    result = {"scene": name, "size": size, "gaussians": len(gaussians), "threads": workers, "covered": covered,
              "pairs": len(state.pair_slot), "bind_ms": bind, "forward_ms": forward, "backward_ms": backward,
              "bound_step_ms": step}
    if against_torch:
        slow = min(torch_tiles(state, grad_rgb, grad_alpha) for _ in range(against_torch))
        result |= {"torch_ms": slow, "times_faster": slow / (forward + backward)}
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", type=int, nargs="+", default=[270, 540, 1080])
    parser.add_argument("--repeats", type=int, default=20)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--torch", type=int, default=1, metavar="RUNS", help="runs of the torch implementation; 0 for none")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    results = [measure(size, options.repeats, options.threads, options.torch) for size in options.sizes]
    for result in results:
        print("  ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in result.items()))
    if options.json:
        options.json.write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
