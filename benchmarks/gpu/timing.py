"""Times by device events, of steps, kernels and whole trainings; ceilings of the card, and lower bounds of the kernels."""

from __future__ import annotations

import ctypes

import numpy as np

from gsac.avatar.cuda.device import Buffer, Device, _call
from gsac.avatar.cuda.kernels import compile_source
from gsac.avatar.cuda.paper import PaperTrainer
from gsac.avatar.cuda.trainer import REPLAY, CudaTrainer
from gsac.avatar.gaussians import Gaussians
from gsac.avatar.raster import render_bound
from gsac.benchmarks.gpu.synthetic_clip import Figure


def step_milliseconds(trainer: CudaTrainer, replays: int = 30, warm: int = 3) -> list[float]:
    """Milliseconds of a step, one value for each graph replay of `REPLAY` steps."""
    device = trainer.device
    trainer.train(warm * REPLAY)
    out = []
    begin, end = device.event(), device.event()
    for _ in range(replays):
        device.wait()
        device.mark(begin)
        trainer.train(REPLAY)
        device.mark(end)
        out.append(device.milliseconds(begin, end) / REPLAY)
    return out


def run_milliseconds(trainer: CudaTrainer, steps: int) -> float:
    """Device time of a training from its first kernel to its last; the graph is recorded before."""
    device = trainer.device
    begin, end = device.event(), device.event()
    device.wait()
    device.mark(begin)
    trainer.train(steps)
    device.mark(end)
    return device.milliseconds(begin, end)


def kernel_microseconds(trainer: CudaTrainer, repeats: int = 40) -> dict[str, float]:
    """Kernel -> its median time in a step, us, by events recorded between the kernels in a graph."""
    device, driver = trainer.device, trainer.device._driver
    marks = [device.event() for _ in range(len(trainer.grids) + 1)]

    def record() -> None:
        flag = driver.CUevent_record_flags.CU_EVENT_RECORD_EXTERNAL
        _call("cuEventRecordWithFlags", marks[0], device.stream, flag)
        for name, mark in zip(trainer.grids, marks[1:], strict=True):
            trainer.launch(name)
            _call("cuEventRecordWithFlags", mark, device.stream, flag)

    graph = device.graph(record)
    trainer._set_state(stop=min(trainer.state().step + repeats, trainer.recipe.steps))
    rows = []
    for _ in range(repeats):
        device.replay(graph)
        device.wait()
        rows.append([device.milliseconds(a, b) * 1e3 for a, b in zip(marks[:-1], marks[1:], strict=True)])
    device.drop(graph)
    return dict(zip(trainer.grids, np.median(rows, 0).tolist(), strict=True))


def nearest_milliseconds(trainer: PaperTrainer) -> float:
    """Median time of the nearest-neighbour search, of a batch."""
    device, begin, end, times = trainer.device, trainer.device.event(), trainer.device.event(), []
    for _ in range(5):
        device.mark(begin)
        device.launch("nearest", *trainer.grids["nearest"], trainer.scene)
        device.mark(end)
        times.append(device.milliseconds(begin, end))
    return float(np.median(times))


def copy_bandwidth(device: Device, size: int = 1 << 30) -> float:
    """Bytes a second, read and written, of a large copy on the device."""
    a, b = Buffer(size, np.uint8, device.stream).fill(1), Buffer(size, np.uint8, device.stream)
    begin, end, times = device.event(), device.event(), []
    for _ in range(12):
        device.mark(begin)
        _call("cuMemcpyDtoDAsync", b.pointer, a.pointer, size, device.stream)
        device.mark(end)
        times.append(device.milliseconds(begin, end))
    a.free()
    b.free()
    return 2 * size / np.median(times[2:]) * 1e3


class _Spin(ctypes.Structure):
    _fields_ = [("out", ctypes.c_void_p), ("turns", ctypes.c_int)]


SPIN = """
struct Spin { float *out; int turns; };
extern "C" __global__ void spin(Spin s) {
    float x[8], a = 1.0f + threadIdx.x * 1e-9f, b = blockIdx.x * 1e-9f;
    for (int k = 0; k < 8; ++k) x[k] = k + b;
    for (int i = 0; i < s.turns; ++i)
#pragma unroll
        for (int k = 0; k < 8; ++k) x[k] = x[k] * a + b;
    float sum = 0;
    for (int k = 0; k < 8; ++k) sum += x[k];
    s.out[blockIdx.x * blockDim.x + threadIdx.x] = sum;
}
"""


def float_rate(device: Device, turns: int = 4096) -> float:
    """float32 operations a second of independent multiply-adds, two operations each."""
    device.load(compile_source(SPIN, device.architecture), ["spin"])
    blocks = device.processors * 16
    out = Buffer(blocks * 256, np.float32, device.stream)
    begin, end, times = device.event(), device.event(), []
    for _ in range(12):
        device.mark(begin)
        device.launch("spin", (blocks, 1), 256, _Spin(out.pointer, turns))
        device.mark(end)
        times.append(device.milliseconds(begin, end))
    out.free()
    return blocks * 256 * 16 * turns / np.median(times[2:]) * 1e3


def useful_operations(trainer: CudaTrainer, evaluations: float) -> dict[str, float]:
    """Lower bound of the float32 operations of the four large kernels. evaluations: composited (gaussian, pixel) pairs."""
    state, ssim = trainer.state(), trainer.scene.ssim > 0
    active, near = (state.heavy + state.light) * 256, state.near * 256
    return {"blend": 32 * evaluations, "blend_backward": 62 * evaluations,
            "compare": near * 3 * (20 + ssim * (4 * 44 + 40)), "image_gradient": active * 3 * (20 + ssim * (3 * 44 + 6))}


def evaluations(figure: Figure, gaussians: Gaussians, t: int = 0) -> float:
    """(Gaussian, pixel) pairs of frame t, in the 4x4 blocks that the CPU path composites."""
    vertices = figure.vertices(figure.pose[t], figure.transl[t])
    rendering = render_bound(vertices, figure.body.faces, gaussians, figure.shots[t].camera)
    return 16.0 * sum(int(mask).bit_count() for mask in rendering.state.pair_mask)


def least_bytes(trainer: CudaTrainer) -> dict[str, float]:
    """Lower bound of each kernel's bytes, by the last step's counters: inputs read once, outputs written once."""
    state, s = trainer.state(), trainer.scene
    batch, n, v, pairs = trainer.batch, s.count, s.vertex_count, state.pairs
    active, near = (state.heavy + state.light) * 256, state.near * 256
    posed = v * 12 + n * (12 + 12 + 16 + 12 + 4)
    slopes = pairs * 36 + batch * (posed + n * (12 + 36))
    return {
        "skin": batch * v * (12 + 12) + v * 32 + batch * s.max_tiles * 4,
        "project": batch * (posed + n * (48 + 8 + 8) + pairs / batch * 8),
        "allocate": batch * s.max_tiles * 14, "fill": batch * n * 16 + pairs * 12, "blend": pairs * (16 + 48) + active * 16,
        "compare": near * (16 + 4 + 36 * (s.ssim > 0)), "image_gradient": active * (16 + 4 + 16 + 36 * (s.ssim > 0)),
        "blend_backward": pairs * (8 + 48 + 12 + 36) + active * 32,
        "gaussian_step": slopes + n * 4 * 14 * 6,
        "gather": batch * (n * 36 + v * 12) + n * 12,
        "joint_step": batch * v * 24 + v * 32,
        "dice": batch * s.max_tiles + state.near * 16, "pose_gaussians": batch * (posed + n * (40 + 104)),
        "nearest": batch * n * (40 + 24),
        "neighbourhood": batch * n * (12 + 40 + 12 + 2 * 104),
        "paper_step": slopes + batch * n * 104 + n * 4 * 13 * 6,
        "shape_gradient": batch * v * 12 + s.beta_count * v * 12, "shape_step": s.beta_count * v * 12 + v * 24,
        "expression_step": s.expression_count * v * 12 + batch * v * 12, "place_joints": batch * 660}
