"""A frame of one avatar in the package's order of passes: Skin, Bind, the sort, and a draw for each eye of a headset."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsac.avatar.binding import bind, face_frames
from gsac.avatar.camera import Camera
from gsac.avatar.draw_rule import MAX_ALPHA, MIN_ALPHA, LowPass
from gsac.avatar.gsac_file.rigged import RiggedAvatar
from gsac.avatar.joints import INDEX
from gsac.avatar.skinning import joint_transforms, skin
from gsac.benchmarks.unity.gpu import Gpu, Job, Parameters, projection
from gsac.benchmarks.unity.packing import pack_avatar
from gsac.benchmarks.unity.spirv import Program

BLOCK_BITS, HAND, ACROSS_THREADS, THREADS = 12, 16, 64, 64
"""As in Gsac.compute: keys a block (bits), keys a thread, threads a group of SortAcross, threads a group of Skin and Bind."""
SCENE = tuple(f"GsacScene{name}" for name in ("Red", "Green", "Blue", "Red2", "Green2", "Blue2", "Last"))
"""Parameters of the scene's light."""
EVEN = {f"GsacLight{name}": np.float32([0, 0, 0, 1]) for name in ("Red", "Green", "Blue")} | dict.fromkeys(SCENE, np.zeros(4))
"""Light without direction, and none of the scene."""
LENS_DEGREES, EYES_APART = 100.0, 0.064
"""Field of view of a headset's eye; m between the eyes."""


def sort_steps(count: int) -> tuple[int, list[tuple[str, dict[str, int], int]]]:
    """Number of keys, and (kernel, parameters, workgroups) of each dispatch of the bitonic sort, as in GsacSort.cs."""
    merges = max(0, (max(count, 1) - 1).bit_length() - BLOCK_BITS)
    keys = 1 << BLOCK_BITS + merges
    steps = [("SortBlocks", {"GsacSortStage": 0, "GsacSortShift": 0, "GsacSortStrides": 0}, keys >> BLOCK_BITS)]
    for m in range(1, merges + 1):
        stage = {"GsacSortStage": 1 << BLOCK_BITS + m}
        for left in range(m, 0, -4):
            strides = HAND - 1 ^ (HAND - 1 >> min(left, 4))
            steps.append(("SortAcross", stage | {"GsacSortShift": BLOCK_BITS + left - 4, "GsacSortStrides": strides},
                          keys // HAND // ACROSS_THREADS))
        steps.append(("SortMerge", stage | {"GsacSortShift": 0, "GsacSortStrides": 0}, keys >> BLOCK_BITS))
    return keys, steps


def draw_rule(low_pass: LowPass, linear: int = 0) -> Parameters:
    """The draw rule as the splats' shader takes it. linear: 1 where the project blends linear colours."""
    return {"GsacBlend": [low_pass.px2, MAX_ALPHA, MIN_ALPHA, linear], "GsacKeepsEnergy": int(low_pass.keeps_energy),
            "GsacTint": [1, 1, 1, 1], "GsacFog": 0, "GsacNumber": 0}


def index_bits(count: int) -> int:
    """Bits of a gaussian's index in a sort key."""
    return max((count - 1).bit_length(), 1)


@dataclass
class Pass:
    """A kernel's dispatches in a frame."""

    name: str
    jobs: list[Job]
    moved: int
    """Least bytes to move: inputs read once, outputs written once."""


def sort_passes(gpu: Gpu, programs: dict[str, Program], base: Parameters, count: int) -> tuple[list[Pass], list[Job]]:
    """The sort of `count` splats as passes by kernel, and its dispatches in order. base: parameters of every kernel."""
    keys, steps = sort_steps(count)
    base = base | {"GsacSplatCount": count, "GsacIndexBits": index_bits(count)}
    order = [gpu.job(programs[name], base | parameters, groups) for name, parameters, groups in steps]
    moved = {"SortBlocks": 16 * count + 4 * keys, "SortAcross": 8 * keys, "SortMerge": 8 * keys}
    jobs = {name: [job for job, step in zip(order, steps, strict=True) if step[0] == name] for name in moved}
    return [Pass(name, jobs[name], moved[name] * len(jobs[name])) for name in moved if jobs[name]], order


class Frame:
    """An avatar in its A-pose, each fourth expression at a half, in the avatar's own (unmirrored) axes."""

    def __init__(self, gpu: Gpu, programs: dict[str, Program], avatar: RiggedAvatar) -> None:
        self.gpu, self.avatar = gpu, avatar
        V, N, E, J = len(avatar.vertices), len(avatar.gaussians), len(avatar.expression_names), len(avatar.joints)
        self.count, self.weights = N, np.where(np.arange(E) % 4 == 0, np.float32(.5), np.float32(0))
        self.bones = joint_transforms(avatar.pose("A")[None], avatar.joints, avatar.parents)[0].astype(np.float32)
        keys, _ = sort_steps(N)
        for name, array in pack_avatar(avatar).items():
            gpu.put(name, array)
        gpu.put("GsacWeights", self.weights)
        gpu.put("GsacBones", self.bones)
        gpu.put("GsacPosed", np.full((V, 4), np.nan, np.float32))
        gpu.put("GsacSplats", np.full((N, 12), np.nan, np.float32))
        gpu.put("GsacKeys", np.zeros(keys, np.uint32))
        gpu.put("GsacLatest", np.zeros(1, np.uint32))
        low, high = -1.5, 1.5
        base = self.base = EVEN | {"GsacVertexCount": V, "GsacSplatCount": N, "GsacIndexBits": index_bits(N), "GsacSortStage": 0,
                       "GsacSortShift": 0, "GsacSortStrides": 0, "GsacDepthRange": np.array([low, 1 / (high - low)]),
                       "GsacDepthRow": np.array([0, 0, -1.0, 0])}
        M = len(avatar.expression_vertex)
        self.passes = [
            Pass("Skin", [gpu.job(programs["Skin"], base, -(-V // THREADS))], 48 * V + 16 + 16 * M + 4 * E + 48 * J),
            Pass("Bind", [gpu.job(programs["Bind"], base, -(-N // THREADS))], 16 * V + (16 + 48 + 48) * N)]
        self.order = [job for p in self.passes for job in p.jobs]
        """Every dispatch of the frame, in order."""
        sort, order = sort_passes(gpu, programs, base, N)
        self.passes += sort
        self.order += order

    def errors(self) -> dict[str, float]:
        """Largest differences of the last frame from the trainer's skinning and binding, m; order: 0 if sorted from far to near."""
        a, g = self.avatar, self.avatar.gaussians
        rest = a.vertices.copy()
        for e, w in enumerate(self.weights):
            span = slice(a.expression_start[e], a.expression_start[e + 1])
            rest[a.expression_vertex[span]] += w * a.expression_delta[span]
        vertices = skin(rest, self.bones, a.skin_index, a.skin_weight)
        posed = self.gpu.get("GsacPosed").reshape(-1, 4)[:, :3]
        means = bind(face_frames(posed.astype(np.float64), a.faces), g.face, g.mu, g.quat, g.log_scale).means
        got = self.gpu.get("GsacSplats").reshape(-1, 12)[:, :3]
        keys = self.gpu.get("GsacKeys", np.uint32)
        order = keys[:self.count] & ((1 << index_bits(self.count)) - 1)
        sorted_once = (np.diff(keys.astype(np.int64)) >= 0).all() and (np.sort(order) == np.arange(self.count)).all()
        return {"vertices": float(abs(posed - vertices).max()), "means": float(abs(got - means).max()),
                "order": 0.0 if sorted_once and np.diff(-got[order, 2]).max() < 2e-4 else 1.0}

    def eyes(self, size: int, distance: float) -> Parameters:
        """Parameters of a draw for both eyes of a headset, `distance` m in front of the person's chest. size: px an eye."""
        focal = size / 2 / np.tan(np.radians(LENS_DEGREES / 2))
        camera = Camera((focal, focal), (size / 2, size / 2), size, size)
        views = []
        for side in (-.5, .5):
            view = np.eye(4)
            view[:3, 3] = side * -EYES_APART, -self.avatar.joints[INDEX["spine3"], 1], -distance
            views.append(view.T)
        return {"unity_StereoMatrixV": views, "unity_StereoMatrixP": [projection(camera).T] * 2,
                "_ScreenParams": [size, size, 0, 0], "GsacIndexBits": index_bits(self.count),
                **draw_rule(self.avatar.gaussians.low_pass), **{f"GsacModel{r}": np.eye(4)[r] for r in range(3)}}


class Crowd:
    """Copies of a frame's person, half an arm apart, joined and sorted together as the package does with people who touch."""

    def __init__(self, frame: Frame, programs: dict[str, Program], people: int) -> None:
        gpu, N = frame.gpu, frame.count
        self.gpu, self.count = gpu, N * people
        gpu.put("GsacJoined", np.zeros((self.count, 12), np.float32))
        gpu.put("GsacJoinedColours", np.zeros((self.count, 4), np.float32))
        joins = []
        for i in range(people):
            rows = np.eye(4)[:3]
            rows[0, 3] = .3 * i
            parameters = {"GsacSplatCount": N, "GsacJoinFirst": i * N} | {f"GsacJoinModel{r}": rows[r] for r in range(3)}
            joins.append(gpu.job(programs["Join"], parameters, -(-N // THREADS)))
        alone = dict(gpu.buffers)
        gpu.buffers["GsacSplats"] = gpu.buffers["GsacJoined"]
        gpu.put("GsacKeys", np.zeros(sort_steps(self.count)[0], np.uint32))
        sort, order = sort_passes(gpu, programs, frame.base, self.count)
        gpu.buffers |= {"CrowdKeys": gpu.buffers["GsacKeys"]} | {name: alone[name] for name in ("GsacSplats", "GsacKeys")}
        self.passes = [Pass("Join", joins, 2 * (48 + 16) * self.count), *sort]
        self.order = joins + order

    def is_sorted(self) -> bool:
        """Whether the last joined frame has each gaussian once, from far to near."""
        keys = self.gpu.get("CrowdKeys", np.uint32)
        order = keys[:self.count] & ((1 << index_bits(self.count)) - 1)
        depth = -self.gpu.get("GsacJoined").reshape(-1, 12)[order, 2]
        return bool((np.sort(order) == np.arange(self.count)).all() and np.diff(depth).max() < 2e-4)
