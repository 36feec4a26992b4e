"""The loop of HAHA's first stage in plain torch, with torch's Adam and autograd; only the splats are drawn by passes of our own."""

from __future__ import annotations

from typing import NamedTuple

import torch

from gsac.benchmarks.gpu.published import formulas, splats
from gsac.benchmarks.gpu.published.body import Body
from gsac.benchmarks.gpu.published.scene import Scene
from gsac.benchmarks.gpu.published.tiles import Sheet

STEPS = 3000
RATES = {"mu": 1.6e-4, "quat": 5e-3, "scale_logit": 5e-3, "rgb": 5e-3}
POSE_RATE, FINE_RATE = 2e-4, 2e-5
OPACITY_LOGIT = 6.0


class Event(NamedTuple):
    """What an event of growth found and did."""

    step: int
    before: int
    above: int
    """Gaussians whose mean gradient is at the threshold or above."""
    cloned: int
    split: int
    shares: list[float]
    """Of the mean gradients that are not zero, as multiples of the threshold: median, 90 %, 99 % and 99.9 %."""


def gradient_of(leaf: torch.Tensor) -> torch.Tensor:
    """(...) the gradient of a leaf that took part in a loss."""
    assert leaf.grad is not None
    return leaf.grad


class Trainer:
    """Gaussians, body and Adam, and a step of B frames."""

    def __init__(self, scene: Scene, device: str, masked: bool, exact: bool, seed: int = 0):
        """masked: L2 and SSIM see alpha times mask; exact: gradients of drawing in the place of the published backward pass."""
        self.scene, self.masked, self.exact = scene, masked, exact
        self.body = Body(scene).to(device)
        self.side = int(scene.side)
        self.pixels, self.background, self.faces, self.focal, self.centre = (
            torch.tensor(array, device=device) for array in
            (scene.pixels, scene.background, scene.faces, scene.focal, scene.centre))
        count = len(scene.faces)
        self.face = torch.arange(count, device=device)
        start = {"mu": torch.zeros(count, 3), "quat": torch.tensor([1.0, 0, 0, 0]).repeat(count, 1),
                 "scale_logit": torch.tensor([-1.0, -2, -1]).repeat(count, 1), "rgb": torch.tensor(scene.rgb)}
        self.values = {name: torch.nn.Parameter(value.to(device)) for name, value in start.items()}
        self.adam = torch.optim.Adam([{"params": [self.values[name]], "lr": rate, "name": name} for name, rate in RATES.items()]
                                     + self.body.groups(POSE_RATE, FINE_RATE))
        self.generator = torch.Generator().manual_seed(seed)
        self.nearest = formulas.nearest
        if self.face.is_cuda:
            from gsac.benchmarks.gpu.published import kernels

            self.nearest = kernels.nearest
        self.forget()

    def forget(self) -> None:
        """Empties the sums of gradients."""
        self.total, self.times = torch.zeros(2, len(self.face), device=self.face.device)

    def loss(self, step: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """The loss of a step from 0, the leaf (B, N, 2) that shifts the places in -1..1, and the radii (B, N) px."""
        frames = self.scene.order[step].tolist()
        background, pixels = self.background[step], self.pixels[frames].float() / 255
        target, mask = formulas.on_background(pixels[..., :3], pixels[..., 3], background), pixels[..., 3]
        mu, quat, scale_logit, rgb = self.values.values()
        places, quats, scales = formulas.posed(self.body.vertices(frames), self.faces, self.face, mu, quat, scale_logit)
        shift = places.new_zeros(*places.shape[:2], 2).requires_grad_()
        opacity = float(torch.sigmoid(torch.tensor(OPACITY_LOGIT)))
        sheet = Sheet(mask.shape[2], mask.shape[1], background, opacity, self.exact)
        drawn = splats.draw(places, quats, scales, rgb, shift * self.side / 2, self.focal.expand(len(frames), 2),
                            self.centre[frames], sheet)
        loss = formulas.code_losses(drawn.image, target, drawn.alpha, mask, self.masked, self.side)
        for of_frame in zip(places, quats, scales, strict=True):
            loss = loss + formulas.knn(*of_frame, rgb, self.nearest(of_frame[0].detach())) / len(frames)
        return loss, shift, drawn.radius

    def step(self, step: int) -> torch.Tensor:
        """Takes a step, from 0. Returns its loss, a scalar."""
        self.adam.param_groups[0]["lr"] = formulas.xyz_rate(step, STEPS)
        self.adam.zero_grad()
        loss, shift, radius = self.loss(step)
        loss.backward()
        self.adam.step()
        if formulas.counts(step):
            formulas.note(self.total, self.times, gradient_of(shift), radius)
        return loss.detach()

    @torch.no_grad()
    def grow(self, step: int) -> Event | None:
        """The event after a step, from 0, where there is one."""
        if not formulas.due(step):
            return None
        before, chosen = len(self.face), formulas.selected(self.total, self.times)
        means = torch.nan_to_num(self.total / self.times)
        shares = torch.quantile(means[means > 0], means.new_tensor([0.5, 0.9, 0.99, 0.999])) / formulas.THRESHOLD
        normal = torch.randn(2, before, 3, generator=self.generator).to(self.face.device)
        clone, split, rows = formulas.grow({name: value.data for name, value in self.values.items()}, chosen, normal)
        parents = torch.cat([clone, split])
        if len(parents):
            self.face = torch.cat([self.face, self.face[parents]])
            for group in self.adam.param_groups[:len(rows)]:
                self._append(group, rows[group["name"]])
            self.forget()
        return Event(step, before, int(chosen.sum()), len(clone), len(split), shares.tolist())

    def _append(self, group: dict, rows: torch.Tensor) -> None:
        """Adds rows (n, C) to a group's one parameter; their moments are zero, and the count of steps goes on."""
        old = group["params"][0]
        new = torch.nn.Parameter(torch.cat([old.data, rows]))
        state = self.adam.state.pop(old)
        for name in ("exp_avg", "exp_avg_sq"):
            state[name] = torch.cat([state[name], torch.zeros_like(rows)])
        self.adam.state[new] = state
        group["params"] = [new]
        self.values[group["name"]] = new
