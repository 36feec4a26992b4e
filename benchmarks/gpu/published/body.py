"""The body of a scene in torch: vertices of learned betas, poses and expressions by linear blend skinning (SMPL-X, eq. 1-7)."""

from __future__ import annotations

import torch

from gsac.benchmarks.gpu.published.scene import Scene

FIGURE, JAW, HANDS = slice(0, 22), slice(22, 23), slice(25, 55)
"""Joints of SMPL-X: those of orientation and body pose, the jaw, and the fingers; eyes between them stay at rest."""
EYES = 2


class Body(torch.nn.Module):
    """Betas, and of each frame a pose, a place and an expression, as parameters of their own: Adam passes over those without a
    gradient."""

    template: torch.Tensor  # (V, 3) m
    shapedirs: torch.Tensor  # (V, 3, B)
    exprdirs: torch.Tensor  # (V, 3, E)
    joints: torch.Tensor  # (J, 3) m
    joint_dirs: torch.Tensor  # (J, 3, B)
    weights: torch.Tensor  # (V, J)
    jaw_actions: torch.Tensor  # (E, 3)

    def __init__(self, scene: Scene):
        super().__init__()
        for name in ("template", "shapedirs", "exprdirs", "joints", "joint_dirs", "weights", "jaw_actions"):
            self.register_buffer(name, torch.tensor(getattr(scene, name)))
        self.parents, self.levels = [int(p) for p in scene.parents], [[0]]
        while below := [j for j, parent in enumerate(self.parents) if parent in self.levels[-1]]:
            self.levels.append(below)
        self.betas = torch.nn.Parameter(torch.tensor(scene.betas))
        self.figure, self.jaw, self.hands, self.transl, self.expression = (
            torch.nn.ParameterList([torch.tensor(row) for row in rows])
            for rows in (scene.pose[:, FIGURE], scene.pose[:, JAW], scene.pose[:, HANDS], scene.transl, scene.expression))

    def groups(self, rate: float, fine: float) -> list[dict]:
        """Groups of Adam: at `rate`, and hands, jaw and expression at `fine`."""
        return [{"params": [*self.figure, *self.transl, self.betas], "lr": rate},
                {"params": [*self.jaw, *self.hands, *self.expression], "lr": fine}]

    def vertices(self, frames: list[int]) -> torch.Tensor:
        """(B, V, 3) m, camera frame."""
        figure, jaw, hands, transl, expression = (torch.stack([part[t] for t in frames]) for part in
                                                  (self.figure, self.jaw, self.hands, self.transl, self.expression))
        pose = torch.cat([figure, jaw, torch.zeros_like(hands[:, :EYES]), hands], 1)
        rest = self.template + self.shapedirs @ self.betas
        rest = rest + torch.einsum("vce,be->bvc", self.exprdirs, expression + jaw[:, 0] @ self.jaw_actions.T)
        world, shift = self.chain(turns(pose), self.joints + self.joint_dirs @ self.betas)
        mixed = torch.einsum("vj,bjrc->bvrc", self.weights, world)
        return (mixed @ rest[..., None])[..., 0] + self.weights @ shift + transl[:, None]

    def chain(self, local: torch.Tensor, joints: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """World rotations (B, J, 3, 3) and shifts (B, J, 3) of the joints. local: (B, J, 3, 3); joints: (J, 3) m, at rest."""
        worlds, places = [local[:, :1]], [joints[None, :1].expand(len(local), 1, 3)]
        for before, level in zip(self.levels, self.levels[1:], strict=False):
            above = [before.index(self.parents[j]) for j in level]
            world = worlds[-1][:, above]
            bone = joints[level] - joints[[self.parents[j] for j in level]]
            places.append(places[-1][:, above] + (world @ bone[..., None])[..., 0])
            worlds.append(world @ local[:, level])
        order = sorted(range(len(joints)), key=[j for level in self.levels for j in level].__getitem__)
        world, place = torch.cat(worlds, 1)[:, order], torch.cat(places, 1)[:, order]
        return world, place - (world @ joints[..., None])[..., 0]


def turns(pose: torch.Tensor) -> torch.Tensor:
    """Rotations (..., 3, 3) of pose (..., 3), axis-angle; as the body's published layer has it, no angle is zero."""
    angle = (pose + 1e-8).norm(dim=-1)[..., None, None]
    x, y, z = (pose / angle[..., 0]).unbind(-1)
    none = torch.zeros_like(x)
    axis = torch.stack([none, -z, y, z, none, -x, -y, x, none], -1).unflatten(-1, (3, 3))
    return torch.eye(3).to(pose) + angle.sin() * axis + (1 - angle.cos()) * axis @ axis
