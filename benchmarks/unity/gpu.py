"""Runs the Unity package's compiled shaders by `wgpu` on Vulkan: on Mesa's software GPU (lavapipe) or a graphics card."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gsac.avatar.camera import Camera
from gsac.benchmarks.unity.spirv import Program

if TYPE_CHECKING:
    from wgpu import GPUBindGroup, GPUBindGroupLayout, GPUCommandEncoder

Parameters = dict[str, Any]
"""Shader parameter -> int (a uint there), floats, or a matrix by columns."""
Job = tuple[Any, Any, int]
"""A dispatch: pipeline, bind group, workgroups."""
LAVAPIPE = Path("/usr/share/vulkan/icd.d")


def missing_packages() -> list[str]:
    """Debian packages that the software GPU needs and this machine lacks."""
    return [] if any(LAVAPIPE.glob("lvp_icd*")) else ["mesa-vulkan-drivers"]


class Gpu:
    """A device with named storage buffers. software: lavapipe, otherwise the first graphics card."""

    def __init__(self, software: bool = True) -> None:
        import wgpu

        self.wgpu = wgpu
        kinds = ["CPU"] if software else ["DiscreteGPU", "IntegratedGPU", "VirtualGPU"]
        adapters = wgpu.gpu.enumerate_adapters_sync()
        fitting = [a for a in adapters if a.info["backend_type"] == "Vulkan" and a.info["adapter_type"] in kinds]
        if not fitting:
            raise SystemExit(f"no Vulkan device of type {' or '.join(kinds)}; there are: {', '.join(a.summary for a in adapters)}")
        self.timed = "timestamp-query" in fitting[0].features
        self.device = fitting[0].request_device_sync(required_features=["timestamp-query"] if self.timed else [])
        self.summary, self.buffers, self.pipelines = fitting[0].summary, {}, {}

    def put(self, name: str, array: np.ndarray) -> None:
        """Uploads array (...,) as the buffer of that name."""
        usage = self.wgpu.BufferUsage
        raw = np.ascontiguousarray(array)
        raw = raw if raw.nbytes else np.zeros(4, np.uint32)
        self.buffers[name] = self.device.create_buffer_with_data(data=raw, usage=usage.STORAGE | usage.COPY_SRC | usage.COPY_DST)

    def get(self, name: str, dtype: type = np.float32) -> np.ndarray:
        """The buffer's content, flat (n,)."""
        return np.frombuffer(self.device.queue.read_buffer(self.buffers[name]), dtype)

    def layout(self, programs: dict[int, Program]) -> GPUBindGroupLayout:
        """Bind group layout of shader stages. programs: stage -> Program; their bindings must agree."""
        entries = {}
        for visibility, program in programs.items():
            for number, (kind, _) in program.bindings.items():
                entry = entries.setdefault(number, {"binding": number, "visibility": 0, "buffer": {"type": kind}})
                entry["visibility"] |= visibility
        return self.device.create_bind_group_layout(entries=list(entries.values()))

    def group(self, layout: GPUBindGroupLayout, program: Program, uniform: bytes) -> GPUBindGroup:
        """Binds the program's buffers by name, and a new parameter block `uniform`."""
        usage = self.wgpu.BufferUsage
        entries = []
        for number, (kind, name) in program.bindings.items():
            buffer = self.buffers[name] if kind != "uniform" else self.device.create_buffer_with_data(
                data=uniform, usage=usage.UNIFORM)
            entries.append({"binding": number, "resource": {"buffer": buffer, "offset": 0, "size": buffer.size}})
        return self.device.create_bind_group(layout=layout, entries=entries)

    def job(self, program: Program, parameters: Parameters, groups: int) -> Job:
        """A dispatch of `groups` workgroups over the current buffers, for `dispatch`."""
        if program.code not in self.pipelines:
            layout = self.layout({self.wgpu.ShaderStage.COMPUTE: program})
            self.pipelines[program.code] = layout, self.device.create_compute_pipeline(
                layout=self.device.create_pipeline_layout(bind_group_layouts=[layout]),
                compute={"module": self.device.create_shader_module(code=program.code), "entry_point": program.entry})
        layout, pipeline = self.pipelines[program.code]
        return pipeline, self.group(layout, program, program.uniform(parameters)), groups

    def dispatch(self, encoder: GPUCommandEncoder, jobs: Iterable[Job], timestamps: dict | None = None) -> None:
        """Encodes the jobs as one pass, in order; each sees what the one before wrote."""
        work = encoder.begin_compute_pass(timestamp_writes=timestamps)
        for pipeline, group, groups in jobs:
            work.set_pipeline(pipeline)
            work.set_bind_group(0, group)
            work.dispatch_workgroups(groups)
        work.end()

    def run(self, jobs: Iterable[tuple[Program, Parameters, int]]) -> None:
        """Runs (program, parameters, workgroups) in order."""
        encoder = self.device.create_command_encoder()
        self.dispatch(encoder, [self.job(*job) for job in jobs])
        self.device.queue.submit([encoder.finish()])


class Painting:
    """A render target and the pipeline that draws `count` splats into it."""

    def __init__(self, gpu: Gpu, vertex: Program, fragment: Program, width: int, height: int, count: int) -> None:
        wgpu = gpu.wgpu
        self.gpu, self.vertex, self.width, self.height, self.count = gpu, vertex, width, height, count
        stages = wgpu.ShaderStage
        self.layout = gpu.layout({stages.VERTEX: vertex, stages.FRAGMENT: fragment})
        blend = {"src_factor": "one", "dst_factor": "one-minus-src-alpha", "operation": "add"}
        self.pipeline = gpu.device.create_render_pipeline(
            layout=gpu.device.create_pipeline_layout(bind_group_layouts=[self.layout]),
            vertex={"module": gpu.device.create_shader_module(code=vertex.code), "entry_point": vertex.entry, "buffers": []},
            fragment={"module": gpu.device.create_shader_module(code=fragment.code), "entry_point": fragment.entry,
                      "targets": [{"format": "rgba16float", "blend": {"color": blend, "alpha": blend}}]},
            primitive={"topology": "triangle-list"})
        self.target = gpu.device.create_texture(
            size=(width, height, 1), format="rgba16float",
            usage=wgpu.TextureUsage.RENDER_ATTACHMENT | wgpu.TextureUsage.COPY_SRC)
        corners = np.array([0, 1, 2, 2, 1, 3], np.uint32) + 4 * np.arange(count, dtype=np.uint32)[:, None]
        self.index = gpu.device.create_buffer_with_data(data=np.ascontiguousarray(corners), usage=wgpu.BufferUsage.INDEX)

    def group(self, parameters: Parameters) -> GPUBindGroup:
        """The bind group of a draw."""
        return self.gpu.group(self.layout, self.vertex, self.vertex.uniform(parameters))

    def encode(self, encoder: GPUCommandEncoder, group: GPUBindGroup, timestamps: dict | None = None, instance: int = 0) -> None:
        """Encodes a draw on a cleared target. instance: 0 for the left eye, 1 for the right."""
        attachment = {"view": self.target.create_view(), "clear_value": (0, 0, 0, 0), "load_op": "clear", "store_op": "store"}
        work = encoder.begin_render_pass(color_attachments=[attachment], timestamp_writes=timestamps)
        work.set_pipeline(self.pipeline)
        work.set_bind_group(0, group)
        work.set_index_buffer(self.index, "uint32")
        work.draw_indexed(self.count * 6, 1, 0, 0, instance)
        work.end()

    def read(self) -> np.ndarray:
        """The picture (H, W, 4) float32, premultiplied RGBA."""
        raw = self.gpu.device.queue.read_texture(
            {"texture": self.target}, {"bytes_per_row": self.width * 8, "rows_per_image": self.height},
            (self.width, self.height, 1))
        return np.frombuffer(raw, np.float16).reshape(self.height, self.width, 4).astype(np.float32)

    def draw(self, parameters: Parameters, instance: int = 0) -> np.ndarray:
        """Draws and returns the picture (H, W, 4) float32, premultiplied RGBA."""
        encoder = self.gpu.device.create_command_encoder()
        self.encode(encoder, self.group(parameters), instance=instance)
        self.gpu.device.queue.submit([encoder.finish()])
        return self.read()


def projection(camera: Camera, flipped: bool = False) -> np.ndarray:
    """Projection matrix (4, 4) of an eye with y up and -z ahead. flipped: y down in clip space, as Unity draws to a texture."""
    fx, fy = (2 * f / s for f, s in zip(camera.focal, (camera.width, camera.height), strict=True))
    shift_x, shift_y = 1 - 2 * camera.center[0] / camera.width, 2 * camera.center[1] / camera.height - 1
    p = np.array([[fx, 0, shift_x, 0], [0, fy, shift_y, 0], [0, 0, -1.0, -.02], [0, 0, -1, 0]])
    if flipped:
        p[1] *= -1
    return p
