"""The published formulas of the paper's training, in plain torch: HAHA's first stage as GSAC changed it, and the paper's text.

Written from the formulas; gradients are autograd's. B frames, side S px, N gaussians, F faces, float64 as given.
"""

import torch
from torch.nn import functional

GREY = torch.tensor([65.738, 129.057, 25.064], dtype=torch.float64) / 256
SSIM, SOBEL, DICE, KNN = 0.1, 1.0, 0.1, 0.01
NEAREST = 3


def on_background(rgb, alpha, background):
    """(B, S, S, 3) of premultiplied rgb (B, S, S, 3), alpha (B, S, S) and background (B, 3)."""
    return rgb + (1 - alpha[..., None]) * background[:, None, None]


def convolve(images, kernel):
    """(B, C, S, S): every channel of (B, C, S, S) under kernel (k, k), zeros around."""
    channels, pad = images.shape[1], kernel.shape[0] // 2
    weight = kernel.to(images)[None, None].expand(channels, 1, -1, -1)
    return functional.conv2d(images, weight, padding=pad, groups=channels)


def ssim(one, other):
    """Mean structural similarity of (B, S, S, 3) and (B, S, S, 3): 11x11 window, sigma 1.5."""
    places = torch.arange(11, dtype=torch.float64) - 5
    window = torch.exp(-places**2 / (2 * 1.5**2))
    window = torch.outer(window, window) / window.sum() ** 2
    x, y = one.permute(0, 3, 1, 2), other.permute(0, 3, 1, 2)
    mean_x, mean_y = convolve(x, window), convolve(y, window)
    var_x, var_y = convolve(x * x, window) - mean_x**2, convolve(y * y, window) - mean_y**2
    both = convolve(x * y, window) - mean_x * mean_y
    c1, c2 = 0.01**2, 0.03**2
    return ((2 * mean_x * mean_y + c1) * (2 * both + c2) / ((mean_x**2 + mean_y**2 + c1) * (var_x + var_y + c2))).mean()


def strength(images):
    """(B, 1, S, S) of (B, S, S, 3): root of the squared central differences of the grey image."""
    grey = (images * GREY.to(images)).sum(-1)[:, None]
    across = convolve(grey, torch.tensor([[0.0, 0, 0], [-1, 0, 1], [0, 0, 0]]))
    down = convolve(grey, torch.tensor([[0.0, -1, 0], [0, 0, 0], [0, 1, 0]]))
    return torch.sqrt(across**2 + down**2 + 1e-6)


def sobel(images):
    """(2, B, 3, S, S) of (B, S, S, 3): Sobel's operator across and down."""
    across = torch.tensor([[-1.0, 0, 1], [-2, 0, 2], [-1, 0, 1]])
    return torch.stack([convolve(images.permute(0, 3, 1, 2), kernel) for kernel in (across, across.T)])


def dice(alpha, mask):
    """Of the background over the batch. alpha, mask: (B, S, S)."""
    p, t = 1 - alpha, 1 - mask
    return 1 - (2 * (p * t).sum() + 1) / ((p * t).sum() + (t * t).sum() + 1)


def image_losses(rgb, alpha, true_rgb, mask, background, text=False):
    """Of a batch, without LPIPS. rgb, true_rgb: (B, S, S, 3) premultiplied; alpha, mask: (B, S, S); background: (B, 3)."""
    image, target = on_background(rgb, alpha, background), on_background(true_rgb, mask, background)
    if text:
        return (functional.mse_loss(image, target) + SSIM * (1 - ssim(image, target))
                + SOBEL * ((sobel(image) - sobel(target)) ** 2).sum(0).mean())
    seen = (alpha.detach() * mask)[..., None]
    return (functional.mse_loss(image * seen, target * seen) + SSIM * (1 - ssim(image * seen, target * seen))
            + SOBEL * functional.l1_loss(strength(image), strength(target)) + DICE * dice(alpha, mask))


def face_frames(vertices, faces):
    """T (F, 3), R (F, 3, 3) and k (F, 1) of vertices (V, 3) and faces (F, 3)."""
    v0, v1, v2 = (vertices[faces[:, c]] for c in range(3))
    cross = torch.linalg.cross(v2 - v1, v0 - v1)
    across, normal = functional.normalize(v2 - v1, dim=-1), functional.normalize(cross, dim=-1)
    side = (v0 - v2).norm(dim=-1, keepdim=True)
    k = (cross.norm(dim=-1, keepdim=True) / side + side) / 2 / 0.05
    return (v0 + v1 + v2) / 3, torch.stack([across, normal, torch.linalg.cross(across, normal)], -1), k


def quaternion(matrix):
    """(N, 4) wxyz of rotations (N, 3, 3), by the largest of its four numbers."""
    m = matrix
    trace = m[:, 0, 0] + m[:, 1, 1] + m[:, 2, 2]
    squares = torch.stack([1 + trace, *(1 - trace + 2 * m[:, c, c] for c in range(3))], -1)  # 4 w^2, 4 x^2, ...
    w, x, y, z = squares.unbind(-1)
    a, b, c = m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]
    d, e, f = m[:, 1, 0] + m[:, 0, 1], m[:, 0, 2] + m[:, 2, 0], m[:, 2, 1] + m[:, 1, 2]
    rows = torch.stack([torch.stack(row, -1) for row in ((w, a, b, c), (a, x, d, e), (b, d, y, f), (c, e, f, z))], 1)
    largest = squares.argmax(-1)
    chosen = rows[torch.arange(len(m)), largest]
    return chosen / (2 * torch.sqrt(squares[torch.arange(len(m)), largest]))[:, None]


def multiply(p, q):
    """Product (N, 4) of quaternions p (N, 4) and q (N, 4), wxyz, of which the one with w >= 0."""
    a, u, b, v = p[:, :1], p[:, 1:], q[:, :1], q[:, 1:]
    product = torch.cat([a * b - (u * v).sum(-1, keepdim=True), a * v + b * u + torch.linalg.cross(u, v)], -1)
    return torch.where(product[:, :1] < 0, -product, product)


def posed(vertices, faces, face, mu, quat, scale_logit):
    """Places (N, 3), quaternions (N, 4) and scales (N, 3) of gaussians in space."""
    T, R, k = (part[face] for part in face_frames(vertices, faces))
    turned = multiply(quaternion(R), functional.normalize(quat, dim=-1))
    return T + (R @ mu[..., None])[..., 0] * k, turned, 0.1 * torch.sigmoid(scale_logit) * k


def knn(places, quats, scales, rgb):
    """The neighbour term of one frame."""
    index = torch.cdist(places.detach(), places.detach()).topk(NEAREST, largest=False).indices
    squares = ((places[index] - places[:, None]) ** 2).sum(-1)
    return KNN * (sum(values[index].std(dim=1).mean() for values in (quats, scales, rgb)) + squares.mean())


def selected(gradients, radii, steps):
    """(N,) bool, which gaussians an event takes.

    gradients: (steps, B, N, 2) of the batch's loss by the place in -1..1; radii: (steps, B, N), 0 where not seen; steps: (steps,)
    numbers of the steps, the last of which is the event.
    """
    total, times = torch.zeros(gradients.shape[2]), torch.zeros(gradients.shape[2])
    for step, gradient, radius in zip(steps, gradients, radii, strict=True):
        if 100 < step < 2500:
            for b in range(len(gradient)):
                total += torch.where(radius[b] > 0, gradient[b].norm(dim=-1), 0)
                times += radius[b] > 0
    return torch.nan_to_num(total / times) >= 5e-5


def grown(mu, scale_logit, chosen, samples):
    """Places and logits (N + n, 3) after an event. chosen: (N,) bool; samples: (2, n of splits, 3) of unit deviation."""
    act = 0.1 * torch.sigmoid(scale_logit)
    large = act.max(-1).values > 0.005
    clone, split = chosen & ~large, chosen & large
    mu, scale_logit = torch.cat([mu, mu[clone]]), torch.cat([scale_logit, scale_logit[clone]])
    split = torch.cat([split, torch.zeros(int(clone.sum()), dtype=torch.bool)])
    act = 0.1 * torch.sigmoid(scale_logit[split])
    away = samples * act / 5
    away = torch.stack([away[..., 0], away[..., 1].abs(), away[..., 2]], -1)
    mu[split] += away[0]
    scale_logit[split] = torch.logit(act / 1.6 / 0.1 + 1e-5)
    return torch.cat([mu, mu[split] + away[1]]), torch.cat([scale_logit, scale_logit[split]])


def xyz_rate(step, steps=3000):
    """Adam rate of the places at a step from 0: the scheduler counts from 1."""
    t = (step + 1) / steps
    return float(torch.exp(torch.log(torch.tensor(1.6e-4, dtype=torch.float64)) * (1 - t)
                           + torch.log(torch.tensor(1.6e-6, dtype=torch.float64)) * t))


def window(centre, side):
    """Where the window of LPIPS begins, px, along an axis of a square of at least 257 px."""
    return min(max(int(centre), 128), side - 129) - 128


def draw(places, quats, scales, rgb, opacity, focal, centre, size, shift=0.0, most=0.99):
    """Premultiplied rgb (h, w, 3) and alpha (h, w) of posed gaussians, as 3DGS splats them: 0.3 px^2 added to both variances.

    quats: (N, 4) of length one; focal, centre: (2,) px; size: width and height, px; shift: (N, 2) px, added to the splats' places;
    most: alpha at most.
    """
    order = places[:, 2].detach().argsort(stable=True)
    w, x, y, z = quats.unbind(-1)
    turn = torch.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
                        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1).reshape(-1, 3, 3)
    depth, none = places[:, 2], torch.zeros_like(places[:, 2])
    slopes = torch.stack([torch.stack([focal[0] / depth, none, -focal[0] * places[:, 0] / depth**2], -1),
                          torch.stack([none, focal[1] / depth, -focal[1] * places[:, 1] / depth**2], -1)], 1)
    half = slopes @ turn * scales[:, None]
    inverse = torch.linalg.inv(half @ half.transpose(1, 2) + 0.3 * torch.eye(2, dtype=places.dtype))
    middle = places[:, :2] / depth[:, None] * focal + centre + shift
    at = torch.stack(torch.meshgrid(torch.arange(size[0]) + 0.5, torch.arange(size[1]) + 0.5, indexing="xy"), -1)
    away = at[None] - middle[:, None, None]
    alpha = (opacity * torch.exp(-0.5 * torch.einsum("nhwi,nij,nhwj->nhw", away, inverse, away))).clamp(max=most)[order]
    alpha = torch.where(alpha >= 1 / 255, alpha, 0)
    left = torch.cumprod(1 - alpha, 0)
    weight = torch.where(left > 1e-4, torch.cat([torch.ones_like(left[:1]), left[:-1]]) * alpha, 0)
    return torch.einsum("nhw,nc->hwc", weight, rgb[order]), weight.sum(0)
