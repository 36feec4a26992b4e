"""The published formulas of the paper's training, in plain torch: HAHA's first stage as GSAC trains by it, and the paper's text.

Written from the formulas; gradients are autograd's. The tests of recipe `paper` hold it against them, and the benchmark beside this
file trains by them. B frames, side S px, N gaussians, F faces; "..." are leading dimensions; any float type.
"""

from __future__ import annotations

import math

import torch
from torch.nn import functional

GREY = torch.tensor([65.738, 129.057, 25.064], dtype=torch.float64) / 256
SSIM, SOBEL, DICE, KNN = 0.1, 1.0, 0.1, 0.01
NEAREST = 3
SPAN = 11
"""px, side of SSIM's window."""
FIRST, LAST, EVERY = 100, 2500, 201
THRESHOLD, SMALL, LARGEST = 5e-5, 0.005, 0.1


def on_background(rgb: torch.Tensor, alpha: torch.Tensor, background: torch.Tensor) -> torch.Tensor:
    """(B, S, S, 3) of premultiplied rgb (B, S, S, 3), alpha (B, S, S) and background (B, 3)."""
    return rgb + (1 - alpha[..., None]) * background[:, None, None]


def convolve(images: torch.Tensor, kernel: torch.Tensor) -> torch.Tensor:
    """(B, C, S, S): every channel of images (B, C, S, S) under kernel (h, w), zeros around."""
    flat = images.flatten(0, 1)[:, None]
    padding = kernel.shape[0] // 2, kernel.shape[1] // 2
    return functional.conv2d(flat, kernel.to(images)[None, None], padding=padding).reshape(images.shape)


def blur(images: torch.Tensor) -> torch.Tensor:
    """images (B, C, S, S) under SSIM's window of sigma 1.5, which is a product of one across and one down."""
    places = torch.arange(SPAN, dtype=torch.float64) - SPAN // 2
    window = torch.exp(-places**2 / (2 * 1.5**2))
    window = window / window.sum()
    return convolve(convolve(images, window[None]), window[:, None])


def ssim(one: torch.Tensor, other: torch.Tensor) -> torch.Tensor:
    """Mean structural similarity. one, other: (B, S, S, 3)."""
    x, y = one.permute(0, 3, 1, 2), other.permute(0, 3, 1, 2)
    mean_x, mean_y = blur(x), blur(y)
    var_x, var_y = blur(x * x) - mean_x**2, blur(y * y) - mean_y**2
    both = blur(x * y) - mean_x * mean_y
    c1, c2 = 0.01**2, 0.03**2
    return ((2 * mean_x * mean_y + c1) * (2 * both + c2) / ((mean_x**2 + mean_y**2 + c1) * (var_x + var_y + c2))).mean()


def strength(images: torch.Tensor) -> torch.Tensor:
    """(B, 1, S, S) of images (B, S, S, 3): root of the squared central differences of the grey image."""
    grey = (images * GREY.to(images)).sum(-1)[:, None]
    across = convolve(grey, torch.tensor([[-1.0, 0, 1]]))
    down = convolve(grey, torch.tensor([[-1.0], [0], [1]]))
    return torch.sqrt(across**2 + down**2 + 1e-6)


def sobel(images: torch.Tensor) -> torch.Tensor:
    """(2, B, 3, S, S) of images (B, S, S, 3): Sobel's operator across and down."""
    across = torch.tensor([[-1.0, 0, 1], [-2, 0, 2], [-1, 0, 1]])
    return torch.stack([convolve(images.permute(0, 3, 1, 2), kernel) for kernel in (across, across.T)])


def dice(alpha: torch.Tensor, mask: torch.Tensor, outside: int = 0) -> torch.Tensor:
    """Of the background over the batch. alpha, mask: (B, S, S); outside: pixels beside them where both are zero."""
    p, t = 1 - alpha, 1 - mask
    both, squares = (p * t).sum() + outside, (t * t).sum() + outside
    return 1 - (2 * both + 1) / (both + squares + 1)


def seen_losses(image: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
    """L2 and SSIM. image, target: (B, S, S, 3)."""
    return functional.mse_loss(image, target) + SSIM * (1 - ssim(image, target))


def code_losses(image: torch.Tensor, target: torch.Tensor, alpha: torch.Tensor, mask: torch.Tensor, masked: bool = True,
                side: int | None = None) -> torch.Tensor:
    """Of a batch over its backgrounds, without LPIPS, as in the code. image, target: (B, h, w, 3); alpha, mask: (B, h, w).

    masked: L2 and SSIM see both images times alpha and mask, as in GSAC's code and not in HAHA's; side: of the square frames, px,
    that images show a box of, with nothing but background beside it.
    """
    seen = (alpha.detach() * mask)[..., None] if masked else torch.ones_like(alpha[..., None])
    h, w = mask.shape[1:]
    whole = side * side if side else h * w
    means = seen_losses(image * seen, target * seen) + SOBEL * functional.l1_loss(strength(image), strength(target))
    return means * (h * w / whole) + DICE * dice(alpha, mask, len(mask) * (whole - h * w))


def text_losses(image: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
    """A scalar as `code_losses`, by the paper's text. image, target: (B, S, S, 3)."""
    return seen_losses(image, target) + SOBEL * ((sobel(image) - sobel(target)) ** 2).sum(0).mean()


def image_losses(rgb: torch.Tensor, alpha: torch.Tensor, true_rgb: torch.Tensor, mask: torch.Tensor, background: torch.Tensor,
                 text: bool = False) -> torch.Tensor:
    """Of a batch, without LPIPS. rgb, true_rgb: (B, S, S, 3) premultiplied; alpha, mask: (B, S, S); background: (B, 3)."""
    image, target = on_background(rgb, alpha, background), on_background(true_rgb, mask, background)
    return text_losses(image, target) if text else code_losses(image, target, alpha, mask)


def face_frames(vertices: torch.Tensor, faces: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """T (..., F, 3), R (..., F, 3, 3) and k (..., F, 1) of vertices (..., V, 3) and faces (F, 3)."""
    v0, v1, v2 = (vertices[..., faces[:, c], :] for c in range(3))
    cross = torch.linalg.cross(v2 - v1, v0 - v1)
    across, normal = functional.normalize(v2 - v1, dim=-1), functional.normalize(cross, dim=-1)
    side = (v0 - v2).norm(dim=-1, keepdim=True)
    k = (cross.norm(dim=-1, keepdim=True) / side + side) / 2 / 0.05
    return (v0 + v1 + v2) / 3, torch.stack([across, normal, torch.linalg.cross(across, normal)], -1), k


def quaternion(matrix: torch.Tensor) -> torch.Tensor:
    """(..., 4) wxyz of a rotation's matrix (..., 3, 3), by the largest of its four numbers."""
    m = matrix
    trace = m[..., 0, 0] + m[..., 1, 1] + m[..., 2, 2]
    squares = torch.stack([1 + trace, *(1 - trace + 2 * m[..., c, c] for c in range(3))], -1)  # 4 w^2, 4 x^2, ...
    w, x, y, z = squares.unbind(-1)
    a, b, c = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    d, e, f = m[..., 1, 0] + m[..., 0, 1], m[..., 0, 2] + m[..., 2, 0], m[..., 2, 1] + m[..., 1, 2]
    rows = torch.stack([torch.stack(row, -1) for row in ((w, a, b, c), (a, x, d, e), (b, d, y, f), (c, e, f, z))], -2)
    largest = squares.argmax(-1, keepdim=True)
    chosen = torch.take_along_dim(rows, largest[..., None], -2)[..., 0, :]
    return chosen / (2 * torch.sqrt(torch.take_along_dim(squares, largest, -1)))


def multiply(p: torch.Tensor, q: torch.Tensor) -> torch.Tensor:
    """Product (..., 4) of quaternions p (..., 4) and q (..., 4), wxyz, of which the one with w >= 0."""
    p, q = torch.broadcast_tensors(p, q)
    a, u, b, v = p[..., :1], p[..., 1:], q[..., :1], q[..., 1:]
    product = torch.cat([a * b - (u * v).sum(-1, keepdim=True), a * v + b * u + torch.linalg.cross(u, v)], -1)
    return torch.where(product[..., :1] < 0, -product, product)


def turn_of(quats: torch.Tensor) -> torch.Tensor:
    """Rotations (..., 3, 3) of quats (..., 4) wxyz of length one."""
    w, x, y, z = quats.unbind(-1)
    return torch.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
                        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1).unflatten(-1, (3, 3))


def posed(vertices: torch.Tensor, faces: torch.Tensor, face: torch.Tensor, mu: torch.Tensor, quat: torch.Tensor,
          scale_logit: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Places (..., N, 3), quaternions (..., N, 4) and scales (..., N, 3) of gaussians in space.

    vertices: (..., V, 3); faces: (F, 3); face: (N,); mu: (N, 3); quat: (N, 4); scale_logit: (N, 3).
    """
    T, R, k = face_frames(vertices, faces)
    T, turned, k = T[..., face, :], multiply(quaternion(R)[..., face, :], functional.normalize(quat, dim=-1)), k[..., face, :]
    return T + (R[..., face, :, :] @ mu[..., None])[..., 0] * k, turned, LARGEST * torch.sigmoid(scale_logit) * k


def nearest(places: torch.Tensor) -> torch.Tensor:
    """(N, 3) indices of the nearest of places (N, 3), themselves among them."""
    rows = [torch.cdist(part, places, compute_mode="donot_use_mm_for_euclid_dist").topk(NEAREST, largest=False).indices
            for part in places.split(2048)]
    return torch.cat(rows)


def knn(places: torch.Tensor, quats: torch.Tensor, scales: torch.Tensor, rgb: torch.Tensor,
        index: torch.Tensor | None = None) -> torch.Tensor:
    """The neighbour term of one frame. places: (N, 3); quats: (N, 4); scales, rgb: (N, 3); index: of `nearest`."""
    index = nearest(places.detach()) if index is None else index
    squares = ((places[index] - places[:, None]) ** 2).sum(-1)
    return KNN * (sum(values[index].std(dim=1).mean() for values in (quats, scales, rgb)) + squares.mean())


def counts(step: int) -> bool:
    """Whether the gradients of a step, from 0, are summed."""
    return FIRST < step < LAST


def due(step: int) -> bool:
    """Whether gaussians are added after a step, from 0."""
    return counts(step) and (step - FIRST + 1) % EVERY == 0


def note(total: torch.Tensor, times: torch.Tensor, gradient: torch.Tensor, radius: torch.Tensor) -> None:
    """Adds a step to the sums. total, times: (N,); gradient: (B, N, 2) by the place in -1..1; radius: (B, N), 0 where not seen."""
    for of_frame, seen in zip(gradient, radius > 0, strict=True):
        total += torch.where(seen, of_frame.norm(dim=-1), 0)
        times += seen


def selected(total: torch.Tensor, times: torch.Tensor) -> torch.Tensor:
    """(N,) bool, which gaussians an event takes. total, times: (N,), the sums of `note`."""
    return torch.nan_to_num(total / times) >= THRESHOLD


def grow(values: dict[str, torch.Tensor], chosen: torch.Tensor,
         normal: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, dict[str, torch.Tensor]]:
    """An event: clones (c,) and splits (s,), indices of the parents, and the rows (c + s, C) to append; parents that split change.

    values: mu (N, 3), scale_logit (N, 3) and others (N, C); chosen: (N,) bool; normal: (2, N, 3) of unit deviation, of which the
    first s are used.
    """
    large = LARGEST * torch.sigmoid(values["scale_logit"]).amax(-1) > SMALL
    clone, split = (chosen & ~large).nonzero()[:, 0], (chosen & large).nonzero()[:, 0]
    act = LARGEST * torch.sigmoid(values["scale_logit"][split])
    away = normal[:, :len(split)] * act / 5
    away[..., 1] = away[..., 1].abs()
    values["mu"][split] += away[0]
    values["scale_logit"][split] = torch.logit(act / 1.6 / LARGEST + 1e-5)
    rows = {name: value[torch.cat([clone, split])] for name, value in values.items()}
    rows["mu"][len(clone):] += away[1]
    return clone, split, rows


def xyz_rate(step: int, steps: int = 3000) -> float:
    """Adam rate of the places at a step from 0: the scheduler counts from 1."""
    t = (step + 1) / steps
    return math.exp(math.log(1.6e-4) * (1 - t) + math.log(1.6e-6) * t)


def window(centre: float, side: int) -> int:
    """Where the window of LPIPS begins, px, along an axis of a square of at least 257 px."""
    return min(max(int(centre), 128), side - 129) - 128


def splats(places: torch.Tensor, quats: torch.Tensor, scales: torch.Tensor, focal: torch.Tensor,
           centre: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Middles (..., N, 2) px and covariances (..., N, 2, 2) px^2, 0.3 px^2 added to both variances, of posed gaussians.

    places: (..., N, 3) m, camera frame; quats: (..., N, 4) of length one; scales: (..., N, 3) m; focal, centre: (..., 2) px.
    """
    x, y, depth = places.unbind(-1)
    fx, fy = (f[..., None] / depth for f in focal.unbind(-1))
    none = torch.zeros_like(depth)
    slopes = torch.stack([torch.stack([fx, none, -fx * x / depth], -1), torch.stack([none, fy, -fy * y / depth], -1)], -2)
    half = slopes @ turn_of(quats) * scales[..., None, :]
    middle = places[..., :2] / depth[..., None] * focal[..., None, :] + centre[..., None, :]
    return middle, half @ half.transpose(-1, -2) + 0.3 * torch.eye(2).to(places)


def draw(places: torch.Tensor, quats: torch.Tensor, scales: torch.Tensor, rgb: torch.Tensor, opacity: float | torch.Tensor,
         focal: torch.Tensor, centre: torch.Tensor, size: tuple[int, int], shift: float | torch.Tensor = 0.0,
         most: float = 0.99) -> tuple[torch.Tensor, torch.Tensor]:
    """Premultiplied rgb (h, w, 3) and alpha (h, w) of posed gaussians, as 3DGS splats them; gradients are exact.

    places, scales: (N, 3) m, quats: (N, 4) and focal, centre: (2,) px, as of `splats`, of one frame; rgb: (N, 3); opacity: scalar;
    size: width and height, px; shift: (N, 2) px, added to the splats' places; most: alpha at most.
    """
    order = places[:, 2].detach().argsort(stable=True)
    middle, covariance = splats(places, quats, scales, focal, centre)
    inverse, middle = torch.linalg.inv(covariance), middle + shift
    at = torch.stack(torch.meshgrid(torch.arange(size[0]) + 0.5, torch.arange(size[1]) + 0.5, indexing="xy"), -1)
    away = at[None] - middle[:, None, None]
    alpha = (opacity * torch.exp(-0.5 * torch.einsum("nhwi,nij,nhwj->nhw", away, inverse, away))).clamp(max=most)[order]
    alpha = torch.where(alpha >= 1 / 255, alpha, 0)
    left = torch.cumprod(1 - alpha, 0)
    weight = torch.where(left > 1e-4, torch.cat([torch.ones_like(left[:1]), left[:-1]]) * alpha, 0)
    return torch.einsum("nhw,nc->hwc", weight, rgb[order]), weight.sum(0)
