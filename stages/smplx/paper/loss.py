"""The loss of the published co-registration: L_kpt + 0.1 L_init + L_face + L_reg, all of them means (GSAC eq. 5-8).

T frames, n of them in a batch, J joints, K key points that the body carries, B betas.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import torch

from gsac.avatar.body import Body
from gsac.avatar.wholebody import FACE, HANDS, INDEX
from gsac.stages.smplx.detector_errors import Detector
from gsac.stages.smplx.paper.head import EYES, Head, HeadTerms, faces_camera, select_head
from gsac.stages.smplx.paper.torch_body import Kinematics, Mesh, Points, to_matrices, to_six, to_vectors
from gsac.stages.smplx.prior import BODY_JOINTS
from gsac.stages.smplx.sightings import Sightings
from gsac.stages.smplx.state import State

SPACE = 8.0
"""Side of the square to which the person's box is scaled, so that the loss does not depend on the resolution."""
INIT, SHAPE, JOINT_OFFSET, SYMMETRY, UPRIGHT = 0.1, 0.01, 100.0, 1.0, 1.0
"""Weights of the start, of betas, of joint offsets, of both sides' symmetry, and of the spine's bend to front or back."""
PUBLISHED_BETAS = 100
"""Over which the published mean of the squared betas goes; a body with fewer keeps the pull on each."""
OVERLAP, MARGIN = 0.5, 1.2
"""IoU of the hands' boxes above which the farther hand gets no weight, and the factor on the boxes."""
BODY = len(BODY_JOINTS)
HANDS_FROM = BODY + 3
"""First joint of the hands, after jaw and eyes, which no term sees: they stay."""
FIXED_OFFSETS = [0, 1, 2]
"""Pelvis and hips stay where the betas put them."""
SPINE = [3, 6, 9, 12, 15]


class Unknowns:
    """The unknowns of Adam: 6-D rotations and transl of each frame, betas, joint offsets and face offsets of the clip."""

    def __init__(self, local: torch.Tensor, transl: torch.Tensor, betas: int, head: int = 0):
        """The start: local (T, J, 3, 3), transl (T, 3) m; betas, head: number of betas, B, and of the head's vertices, N."""
        six = to_six(local)
        self.root, self.transl = six[:, :1].clone(), transl.clone()
        self.body, self.hands = six[:, 1:BODY].clone(), six[:, HANDS_FROM:].clone()
        self.face = local[:, BODY:HANDS_FROM]
        self.betas, self.joint_offset = torch.zeros(betas), torch.zeros(local.shape[1], 3)
        self.face_offset = torch.zeros(head, 3)
        self.movable = torch.ones(local.shape[1], 1)
        self.movable[FIXED_OFFSETS] = 0

    def open_batch(self, frames: slice, root_only: bool, shared: bool) -> Iterator[torch.Tensor]:
        """Makes leaves of the batch's tensors, (B,), (J, 3), (N, 3) and (n, ...), and of no others.

        Those of the frames are views, through which Adam writes.
        """
        for tensor in (self.betas, self.joint_offset, self.face_offset):
            tensor.requires_grad_(shared and not root_only)
            if tensor.requires_grad:
                yield tensor
        self.batch = [t[frames].detach() for t in (self.root, self.body, self.hands, self.transl)]
        for i, tensor in enumerate(self.batch):
            tensor.requires_grad_(not root_only or i in (0, 3))
            if tensor.requires_grad:
                yield tensor

    def local(self, frames: slice) -> torch.Tensor:
        """Rotations (n, J, 3, 3) of the open batch."""
        root, body, hands, _ = self.batch
        return torch.cat([to_matrices(root), to_matrices(body), self.face[frames], to_matrices(hands)], 1)

    def offsets(self) -> torch.Tensor:
        """Joint offsets (J, 3) m."""
        return self.joint_offset * self.movable

    def read(self) -> tuple[np.ndarray, ...]:
        """Rotations (T, J, 3, 3), transl (T, 3) m, betas (B,), joint offsets (J, 3) m."""
        parts = (to_matrices(self.root), to_matrices(self.body), self.face, to_matrices(self.hands))
        return tuple(t.detach().numpy().astype(np.float64) for t in (torch.cat(parts, 1), self.transl, self.betas, self.offsets()))


class Objective:
    """The loss of a batch of frames."""

    def __init__(self, body: Body, sightings: Sightings, start: State, center: np.ndarray):
        """center: (2,) px."""
        self.kinematics = Kinematics(body)
        offsets = Detector.load(sightings.detector, body).offsets
        self.known = np.flatnonzero(body.known_keypoints)
        self.mesh = Mesh(body)
        self.focal, self.center = float(np.exp(start.log_focal)), torch.tensor(center, dtype=torch.float32)
        corner, side = box_person(sightings)
        seen = sightings.seen[:, self.known]
        xy = np.where(seen[..., None], sightings.xy[:, self.known], 0)
        self.corner, self.side = torch.tensor(corner)[:, None], torch.tensor(side)[:, None, None]
        self.target = (torch.tensor(xy, dtype=torch.float32) - self.corner) / self.side * SPACE
        self.weight = torch.tensor(seen, dtype=torch.float32)
        column = {int(k): i for i, k in enumerate(self.known)}
        self.hands = [[column[k] for k in range(s.start, s.stop) if k in column] for s in HANDS.values()]
        self.wrists = [column[INDEX[f"{side}_wrist"]] for side in HANDS]
        self.inner_face = [column[k] for k in range(FACE.start, FACE.stop) if k in column]
        arrays = sightings.face
        found = None if arrays is None else Head.from_arrays(arrays, body)
        self.head = None if found is None else HeadTerms(body, found)
        self.points = Points(body, body.keypoint_matrix[self.known], offsets[self.known], None if found is None else found.index)
        self.face_valid = np.ones(len(xy), bool) if arrays is None else np.asarray(arrays["valid"], bool)
        left = [i for i, n in enumerate(body.joint_names) if n.startswith("left_")]
        self.left = left
        self.right = [body.joint_names.index("right_" + body.joint_names[i][5:]) for i in left]
        self.start = torch.tensor(start.local, dtype=torch.float32)
        self.face_vertices = torch.tensor(np.flatnonzero(select_head(body)))
        self.eyes = [column[k] for k in EYES]

    def unknowns(self, transl: np.ndarray) -> Unknowns:
        """The start's rotations at transl (T, 3) m; betas and offsets zero, as published, whatever shape the start has."""
        betas = self.kinematics.rest_dirs.shape[2]
        return Unknowns(self.start, torch.tensor(transl, dtype=torch.float32), betas, 0 if self.head is None else self.head.count)

    def loss(self, unknowns: Unknowns, frames: slice, hand_hold: float, warm_up: bool = False) -> torch.Tensor:
        """The loss of a batch, a scalar. hand_hold: factor on the weight of the hands' joint offsets; warm_up: by the key points
        alone, of a face that is turned away too."""
        local, betas, offset = unknowns.local(frames), unknowns.betas, unknowns.offsets()
        rest = self.kinematics.joints(betas, offset)
        world, place = self.kinematics.pose(local, rest)
        transl = unknowns.batch[3]
        start_mesh, faces = self._look_at_start(betas.detach(), offset.detach(), transl.detach(), frames)
        seen = self.weight[frames].clone()
        if not warm_up:
            seen[:, self.inner_face] *= torch.tensor(faces, dtype=torch.float32)[:, None]
        total = torch.zeros(())
        for face_offset in (None, unknowns.face_offset) if len(unknowns.face_offset) else (None, None):
            x = self.points.at(world, place, rest, betas, face_offset) + transl[:, None]
            uv = self.project(x, frames)
            total = total + ((uv - self.target[frames]).abs() * (seen * self.uncover(x, uv, frames))[..., None]).mean()
        if warm_up:
            return total
        mesh = self._relative(self.mesh.at(world, place, rest, betas), place)
        total = total + INIT * (mesh - start_mesh).abs().mean() + INIT * (local - self.start[frames]).abs().mean()
        total = total + SHAPE * (betas**2).sum() / PUBLISHED_BETAS + UPRIGHT * (to_vectors(local[:, SPINE])[..., 0] ** 2).mean()
        hold = torch.ones(len(offset), 1)
        hold[HANDS_FROM:] = hand_hold
        total = total + JOINT_OFFSET * (hold * offset**2).mean()
        mirrored = offset[self.right] * torch.tensor([-1.0, 1, 1])
        total = total + SYMMETRY * (offset[self.left] - mirrored).abs().sum(1).mean()
        if self.head is not None:
            total = total + float(faces.mean()) * self.head.loss(betas, unknowns.face_offset)
            total = total + SYMMETRY * self.head.asymmetry(unknowns.face_offset)
        return total

    def project(self, x: torch.Tensor, frames: slice) -> torch.Tensor:
        """Points (n, K, 2) in the person's square. x: (n, K, 3) m, camera frame."""
        px = self.focal * x[..., :2] / x[..., 2:].clamp(min=0.05) + self.center
        return (px - self.corner[frames]) / self.side[frames] * SPACE

    def pixels(self, local: np.ndarray, transl: np.ndarray, betas: np.ndarray, joint_offset: np.ndarray) -> np.ndarray:
        """Key points (T, K, 2) px. local: (T, J, 3, 3); transl: (T, 3) m; betas: (B,); joint_offset: (J, 3) m."""
        as_float = [torch.tensor(a, dtype=torch.float32) for a in (local, transl, betas, joint_offset)]
        rest = self.kinematics.joints(as_float[2], as_float[3])
        x = self.points.at(*self.kinematics.pose(as_float[0], rest), rest, as_float[2]) + as_float[1][:, None]
        return (self.focal * x[..., :2] / x[..., 2:] + self.center).numpy()

    def _look_at_start(self, betas: torch.Tensor, offset: torch.Tensor, transl: torch.Tensor,
                       frames: slice) -> tuple[torch.Tensor, np.ndarray]:
        """The start's mesh (n, 3, V) m about its pelvis at the present betas (B,) and joint offsets (J, 3), so that it holds the
        pose alone; and (n,) bool: its face looks at the camera at transl (n, 3) m, and `face` found it."""
        rest = self.kinematics.joints(betas, offset)
        world, place = self.kinematics.pose(self.start[frames], rest)
        mesh = self.mesh.at(world, place, rest, betas)
        eyes = self.points.at(world, place, rest, betas)[:, self.eyes].mean(1) + transl
        centre = mesh[:, :, self.face_vertices].mean(2) + transl
        return self._relative(mesh, place), faces_camera(centre.numpy(), eyes.numpy()) & self.face_valid[frames]

    @staticmethod
    def _relative(mesh: torch.Tensor, place: torch.Tensor) -> torch.Tensor:
        return mesh - place[:, 0, :, None]

    def uncover(self, x: torch.Tensor, uv: torch.Tensor, frames: slice) -> torch.Tensor:
        """Weights (n, K): 0 for the farther of two overlapping hands, with its wrist. x: (n, K, 3) m; uv: (n, K, 2)."""
        out = torch.ones(uv.shape[:2])
        if not all(self.hands):
            return out
        with torch.no_grad():
            boxes = [box_points(uv[:, hand], self.weight[frames][:, hand] > 0) for hand in self.hands]
            low, high = zip(*boxes, strict=True)
            both = (torch.minimum(*high) - torch.maximum(*low)).clamp(min=0).prod(1)
            union = sum((b - a).prod(1) for a, b in boxes) - both
            covered = both > OVERLAP * union  # never by the NaN of an unseen hand
            depth = [x[:, hand, 2].mean(1) for hand in self.hands]
            for mine, other, hand, wrist in ((0, 1, self.hands[0], self.wrists[0]), (1, 0, self.hands[1], self.wrists[1])):
                far = covered & (depth[mine] > depth[other])
                out[:, [*hand, wrist]] *= (~far).float()[:, None]
        return out


def box_points(uv: torch.Tensor, seen: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Corners (n, 2) and (n, 2) of the box about the seen points x MARGIN; NaN without one. uv: (n, K, 2); seen: (n, K) bool."""
    low = uv.masked_fill(~seen[..., None], np.inf).amin(1)
    high = uv.masked_fill(~seen[..., None], -np.inf).amax(1)
    middle, half = (low + high) / 2, (high - low) / 2 * MARGIN
    return middle - half, middle + half


def box_person(sightings: Sightings) -> tuple[np.ndarray, np.ndarray]:
    """Corner (T, 2) and side (T,), px, of the square about the person: the box of its points x 1.2, squared, x 1.25."""
    corner = np.zeros((len(sightings.xy), 2), np.float32)
    side = np.full(len(corner), max(sightings.width, sightings.height), np.float32)
    for t, seen in enumerate(sightings.seen):
        if seen.sum() > 1:
            low, high = sightings.xy[t, seen].min(0), sightings.xy[t, seen].max(0)
            side[t] = max(float((high - low).max()) * 1.2 * 1.25, 1.0)
            corner[t] = (low + high) / 2 - side[t] / 2
    return corner, side
