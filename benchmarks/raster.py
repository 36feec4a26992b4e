"""CPU time of the rasteriser against a vectorised torch implementation of the same tiles, in one run.

`python -m gsac.benchmarks.raster [--scene figure|body] [--sizes 270 540 1080] [--repeats 20] [--threads 1] [--json FILE]`
Times are CPU times of the process, the best of many repeats, which the machine's other load disturbs least.
"""

from __future__ import annotations

import argparse
import functools
import json
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gsac.avatar import losses, raster
from gsac.avatar.camera import Camera
from gsac.avatar.gaussians import Gaussians

COUNT = 25_000
"""Gaussians."""
ELLIPSOIDS = (
    ((0, 1.62, 0), (0.09, 0.13, 0.10)), ((0, 1.25, 0), (0.17, 0.26, 0.11)), ((0, 0.95, 0), (0.16, 0.14, 0.11)),
    ((0.33, 1.38, 0), (0.22, 0.05, 0.05)), ((-0.33, 1.38, 0), (0.22, 0.05, 0.05)),
    ((0.60, 1.38, 0), (0.09, 0.03, 0.04)), ((-0.60, 1.38, 0), (0.09, 0.03, 0.04)),
    ((0.09, 0.65, 0), (0.08, 0.28, 0.08)), ((-0.09, 0.65, 0), (0.08, 0.28, 0.08)),
    ((0.09, 0.22, 0), (0.06, 0.26, 0.06)), ((-0.09, 0.22, 0), (0.06, 0.26, 0.06)),
)
"""Centre and half axes (m), y up: head, trunk, hips, arms, hands, legs."""
BROAD = 1.6
"""Factor on the figure's width, with which it covers a quarter of the frame."""


def make_figure() -> tuple[np.ndarray, np.ndarray]:
    """A person of ellipsoids: vertices (V, 3) m, camera frame, and faces (F, 3)."""
    import trimesh

    parts = []
    for centre, axes in ELLIPSOIDS:
        ball = trimesh.creation.icosphere(subdivisions=4)
        ball.vertices = ball.vertices * (np.array(axes) * (BROAD, 1, BROAD)) + np.array(centre) * (BROAD, 1, 1)
        parts.append(ball)
    mesh = trimesh.util.concatenate(parts)
    return place_in_front(np.asarray(mesh.vertices)), np.asarray(mesh.faces, np.int32)


def place_in_front(vertices: np.ndarray) -> np.ndarray:
    """Places a canonical body upright in front of the camera, its middle on the optical axis at 3 m.

    vertices: (V, 3) m, y up, facing +z. Returns (V, 3) m, camera frame.
    """
    middle = (vertices.max(0) + vertices.min(0)) / 2
    return ((vertices - middle) * (1, -1, -1) + (0, 0, 3)).astype(np.float32)


def fit_camera(vertices: np.ndarray, size: int) -> Camera:
    """A camera whose square image of `size` px the body fills in height, but for 4 %. vertices: (V, 3) m, camera frame."""
    high = np.abs(vertices[:, 1] / vertices[:, 2]).max()
    focal = 0.5 * size * 0.96 / high
    return Camera((focal, focal), (size / 2, size / 2), size, size)


def make_scene(name: str) -> tuple[np.ndarray, np.ndarray, Gaussians]:
    """Vertices (V, 3) m, faces (F, 3) and `COUNT` gaussians of random colour; name: `figure` (ellipsoids) or `body` (T-pose)."""
    if name == "body":
        from gsac.avatar.body import Body

        body = Body.load()
        vertices, faces = place_in_front(body.v_template), body.faces
    else:
        vertices, faces = make_figure()
    gaussians = Gaussians.area(vertices, faces, COUNT, seed=0)
    gaussians.rgb[:] = np.random.default_rng(0).random(gaussians.rgb.shape)
    return vertices, faces, gaussians


def time_best(repeats: int, work: Callable[[], object]) -> float:
    """Least CPU time of `work()`, ms."""
    least = np.inf
    for _ in range(repeats):
        start = time.process_time()
        work()
        least = min(least, time.process_time() - start)
    return 1e3 * least


def list_composited(state: raster.State) -> tuple[np.ndarray, np.ndarray]:
    """Gaussian (n,) and pixel (n,) of every pair that the tiles composite, pixel by pixel, front to back."""
    size, column = raster.project.TILE, raster.project
    height, width = state.alpha.shape
    y, x = (g.reshape(-1) for g in np.mgrid[:size, :size])
    gaussians, pixels = [], []
    for tile in range(len(state.tile_start) - 1):
        top, left = tile // state.columns * size, tile % state.columns * size
        own = state.pair_gaussian[state.tile_start[tile]:state.tile_start[tile + 1]]
        splats = state.splats[own][:, :, None]
        dx, dy = x + np.float32(left + 0.5) - splats[:, column.X], y + np.float32(top + 0.5) - splats[:, column.Y]
        s = (splats[:, column.HA] * dx + splats[:, column.B] * dy) * dx + splats[:, column.HC] * dy * dy
        seen = (s <= splats[:, column.S_MAX]) & (x + left < width) & (y + top < height)
        alpha = np.where(seen, np.minimum(splats[:, column.OPACITY] * np.exp(-s), 0.999), 0)
        seen &= np.cumprod(1 - alpha, axis=0) > 1e-4
        pixel, turn = np.nonzero(seen.T)
        gaussians.append(own[turn])
        pixels.append((y[pixel] + top) * width + x[pixel] + left)
    return np.concatenate(gaussians).astype(np.int64), np.concatenate(pixels).astype(np.int64)


def torch_step(state: raster.State, grad_rgb: np.ndarray, grad_alpha: np.ndarray, repeats: int) -> tuple[float, int]:
    """CPU ms of compositing forward and backward in torch on one thread, best of a few, and the number of (gaussian, pixel) pairs.

    grad_rgb: (H, W, 3); grad_alpha: (H, W). Vectorised over the pairs that the same tiles composite, which are listed before the
    clock starts: exponent, alpha, transmittance by a segmented sum of logarithms, weighted sums by index. Raises RuntimeError if
    the image differs from the kernels'.
    """
    import torch

    torch.set_num_threads(1)
    column = raster.project
    height, width = state.alpha.shape
    gaussian, pixel = (torch.from_numpy(a) for a in list_composited(state))
    first = torch.cat([torch.ones(1, dtype=torch.bool), pixel[1:] != pixel[:-1]])
    begin = torch.cummax(torch.where(first, torch.arange(len(pixel)), 0), 0).values
    wanted = torch.from_numpy(np.concatenate([grad_rgb, grad_alpha[..., None]], 2).reshape(-1, 4))
    least = np.inf
    for _ in range(repeats):
        splats = torch.tensor(state.splats, requires_grad=True)
        start = time.process_time()
        part = splats[gaussian]
        dx, dy = pixel % width + 0.5 - part[:, column.X], pixel // width + 0.5 - part[:, column.Y]
        s = (part[:, column.HA] * dx + part[:, column.B] * dy) * dx + part[:, column.HC] * dy * dy
        alpha = (part[:, column.OPACITY] * torch.exp(-s)).clamp(max=0.999)
        logarithm = torch.log1p(-alpha).double()
        before = torch.cumsum(logarithm, 0) - logarithm
        weight = alpha * torch.exp(before - before[begin]).float()
        colour = torch.cat([part[:, column.RED:column.BLUE + 1], torch.ones(len(part), 1)], 1)
        image = torch.zeros(height * width, 4).index_add(0, pixel, weight[:, None] * colour)
        image.backward(wanted)
        least = min(least, time.process_time() - start)
    worst = np.abs(image.detach()[:, 3].numpy().reshape(height, width) - state.alpha).max()
    if worst > 0.01:
        raise RuntimeError(f"the torch implementation disagrees with the kernels by {worst:.3g}")
    return 1e3 * least, len(pixel)


def measure(name: str, size: int, repeats: int, workers: int, torch_repeats: int) -> dict:
    """CPU ms at one image size. `raster_ms`: projection, depth sort, tiles, forward, backward to means, rotations and scales."""
    vertices, faces, gaussians = make_scene(name)
    camera = fit_camera(vertices, size)
    workspace = raster.Workspace(workers)
    random = np.random.default_rng(1)
    grad_rgb = random.normal(size=(size, size, 3)).astype(np.float32)
    grad_alpha = random.normal(size=(size, size)).astype(np.float32)

    def bound_step() -> object:
        return raster.render_bound_backward(raster.render_bound(vertices, faces, gaussians, camera, workspace).state, grad_rgb,
                                            grad_alpha)

    bound_step()
    state = raster.render_bound(vertices, faces, gaussians, camera, workspace).state
    result = {"scene": name, "size": size, "gaussians": len(gaussians), "threads": workers,
              "covered": float((state.alpha > 0.5).mean()), "tile_pairs": len(state.pair_slot),
              "step_ms": time_best(repeats, bound_step)}
    forward = time_best(repeats, lambda: raster.render(state.means, state.rotations, state.scales, gaussians.rgb, gaussians.opacity,
                                                  camera, workspace))
    backward = time_best(repeats, lambda: raster.render_backward(state, grad_rgb, grad_alpha))
    result |= {"forward_ms": forward, "backward_ms": backward, "raster_ms": forward + backward}
    target = random.random((size, size, 3), np.float32)
    image, gradient = state.rgb.copy(), np.zeros_like(target)
    for loss in (losses.l2, losses.ssim, losses.sobel):
        loss(image, target, gradient=gradient, workspace=workspace)
        result[f"{loss.__name__}_ms"] = time_best(repeats, functools.partial(loss, image, target, gradient=gradient,
                                                                        workspace=workspace))
    if torch_repeats:
        slow, pixels = torch_step(state, grad_rgb, grad_alpha, torch_repeats)
        result |= {"composited": pixels, "torch_ms": slow, "times_faster": slow / (forward + backward)}
    return result


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m gsac.benchmarks.raster", description=__doc__.splitlines()[0])
    parser.add_argument("--scene", choices=("figure", "body"), default="figure")
    parser.add_argument("--sizes", type=int, nargs="+", default=[270, 540, 1080])
    parser.add_argument("--repeats", type=int, default=20)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--torch-sizes", type=int, nargs="*", default=[270, 540],
                        help="sizes that torch runs too (1080 takes several GB)")
    parser.add_argument("--torch-repeats", type=int, default=3)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    results = [measure(options.scene, size, options.repeats, options.threads, options.torch_repeats * (size in options.torch_sizes))
               for size in options.sizes]
    for result in results:
        print("  ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in result.items()))
    if options.json:
        options.json.write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
