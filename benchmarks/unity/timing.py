"""Times on the GPU's own clock, by timestamp queries."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from gsac.benchmarks.unity.frame import Crowd, Frame
from gsac.benchmarks.unity.gpu import Gpu, Job, Painting, Parameters

if TYPE_CHECKING:
    from wgpu import GPUCommandEncoder

IN_A_ROW = 16
"""Repeats of a dispatch between two timestamps, which makes their own cost small."""


class Clock:
    """Timestamps of a device."""

    def __init__(self, gpu: Gpu) -> None:
        from wgpu.backends.wgpu_native import lib

        usage = gpu.wgpu.BufferUsage
        self.gpu = gpu
        self.nanoseconds = lib.wgpuQueueGetTimestampPeriod(gpu.device.queue._internal)  # wgpu has no public way
        self.queries = gpu.device.create_query_set(type="timestamp", count=4)
        self.resolved = gpu.device.create_buffer(size=32, usage=usage.QUERY_RESOLVE | usage.COPY_SRC)

    def between(self, first: int) -> dict:
        """The `timestamps` of a pass: query `first` at its start, the next at its end."""
        return {"query_set": self.queries, "beginning_of_pass_write_index": first, "end_of_pass_write_index": first + 1}

    def microseconds(self, repeats: int, encode: Callable[[GPUCommandEncoder], int]) -> np.ndarray:
        """Time (repeats,) us from the first timestamp to the last. encode: writes them and returns the last one's number."""
        took = []
        for _ in range(repeats + repeats // 4 + 1):
            encoder = self.gpu.device.create_command_encoder()
            last = encode(encoder)
            encoder.resolve_query_set(self.queries, 0, last + 1, self.resolved, 0)
            self.gpu.device.queue.submit([encoder.finish()])
            ticks = np.frombuffer(self.gpu.device.queue.read_buffer(self.resolved), np.uint64)
            took.append(int(ticks[last]) - int(ticks[0]))
        return np.array(took[-repeats:]) * self.nanoseconds / 1e3


def pass_times(clock: Clock, frame: Frame | Crowd, repeats: int) -> dict[str, np.ndarray]:
    """Pass -> time (repeats,) us of all its dispatches in a frame; `frame`: of the whole frame, once, as Unity runs it."""

    def encoder_of(jobs: list[Job]) -> Callable[[GPUCommandEncoder], int]:
        def encode(encoder: GPUCommandEncoder) -> int:
            clock.gpu.dispatch(encoder, jobs, clock.between(0))
            return 1
        return encode

    times = {p.name: clock.microseconds(repeats, encoder_of(p.jobs * IN_A_ROW)) / IN_A_ROW for p in frame.passes}
    return times | {"frame": clock.microseconds(repeats, encoder_of(frame.order))}


def draw_times(clock: Clock, paintings: tuple[Painting, Painting], parameters: Parameters, repeats: int) -> np.ndarray:
    """Time (repeats,) us of drawing both eyes, with clearing of their targets."""
    groups = [painting.group(parameters) for painting in paintings]

    def encode(encoder: GPUCommandEncoder) -> int:
        for eye, (painting, group) in enumerate(zip(paintings, groups, strict=True)):
            painting.encode(encoder, group, clock.between(2 * eye), eye)
        return 3
    return clock.microseconds(repeats, encode)
