"""Runs the Unity package's compiled shaders by `wgpu` on Vulkan: on Mesa's software GPU (lavapipe) or a graphics card."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gsac.avatar.camera import Camera
from gsac.benchmarks.unity.spirv import Program

if TYPE_CHECKING:
    from wgpu import GPUBindGroup, GPUBindGroupLayout, GPUCommandEncoder, GPUTexture

Parameters = dict[str, Any]
"""Shader parameter -> int (a uint there), floats, or a matrix by columns."""
OPAQUE: dict[str, dict[str, Any]] = {
    "texture": {"texture": {}}, "texture-array": {"texture": {"view_dimension": "2d-array"}}, "sampler": {"sampler": {}},
}
"""Kind of a binding that is no buffer -> its entry of a layout."""
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
        self.textures: dict[str, GPUTexture] = {}
        """Textures that shaders sample, by name."""
        self.sampler = self.device.create_sampler(mag_filter="linear", min_filter="linear")

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
                what = OPAQUE.get(kind, {"buffer": {"type": kind}})
                entry = entries.setdefault(number, {"binding": number, "visibility": 0, **what})
                entry["visibility"] |= visibility
        return self.device.create_bind_group_layout(entries=list(entries.values()))

    def texture(self, width: int, height: int, form: str, slices: int = 1) -> GPUTexture:
        """A texture to draw into, to sample and to read. form: as WebGPU names it."""
        usage = self.wgpu.TextureUsage
        return self.device.create_texture(size=(width, height, slices), format=form, usage=usage.RENDER_ATTACHMENT | usage.COPY_SRC
                                          | usage.COPY_DST | usage.TEXTURE_BINDING)

    def group(self, layout: GPUBindGroupLayout, programs: Sequence[Program], uniform: bytes) -> GPUBindGroup:
        """Binds the buffers and textures of a layout's programs by name, and a new parameter block `uniform`."""
        usage = self.wgpu.BufferUsage
        entries = []
        for number, (kind, name) in {n: b for program in programs for n, b in program.bindings.items()}.items():
            if kind in OPAQUE:
                entries.append({"binding": number, "resource": self._opaque(kind, str(name))})
                continue
            buffer = self.buffers[name] if kind != "uniform" else self.device.create_buffer_with_data(
                data=uniform, usage=usage.UNIFORM)
            entries.append({"binding": number, "resource": {"buffer": buffer, "offset": 0, "size": buffer.size}})
        return self.device.create_bind_group(layout=layout, entries=entries)

    def _opaque(self, kind: str, name: str) -> Any:
        if kind == "sampler":
            return self.sampler
        return self.textures[name].create_view(dimension="2d-array" if kind == "texture-array" else "2d")

    def job(self, program: Program, parameters: Parameters, groups: int) -> Job:
        """A dispatch of `groups` workgroups over the current buffers, for `dispatch`."""
        if program.code not in self.pipelines:
            layout = self.layout({self.wgpu.ShaderStage.COMPUTE: program})
            self.pipelines[program.code] = layout, self.device.create_compute_pipeline(
                layout=self.device.create_pipeline_layout(bind_group_layouts=[layout]),
                compute={"module": self.device.create_shader_module(code=program.code), "entry_point": program.entry})
        layout, pipeline = self.pipelines[program.code]
        return pipeline, self.group(layout, [program], program.uniform(parameters)), groups

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
    """Render targets and the pipeline that draws `count` splats into them; form: of each of the targets."""

    def __init__(self, gpu: Gpu, vertex: Program, fragment: Program, width: int, height: int, count: int,
                 forms: Sequence[str] = ("rgba16float",), depth: bool = False) -> None:
        """depth: with a depth buffer, which the draw is tested against and which is cleared to `far` of `encode`."""
        wgpu = gpu.wgpu
        self.gpu, self.vertex, self.fragment, self.width, self.height, self.count = gpu, vertex, fragment, width, height, count
        stages = wgpu.ShaderStage
        self.layout = gpu.layout({stages.VERTEX: vertex, stages.FRAGMENT: fragment})
        blend = {"src_factor": "one", "dst_factor": "one-minus-src-alpha", "operation": "add"}
        test = {"format": "depth32float", "depth_write_enabled": False, "depth_compare": "less-equal"}
        self.pipeline = gpu.device.create_render_pipeline(
            layout=gpu.device.create_pipeline_layout(bind_group_layouts=[self.layout]),
            vertex={"module": gpu.device.create_shader_module(code=vertex.code), "entry_point": vertex.entry, "buffers": []},
            fragment={"module": gpu.device.create_shader_module(code=fragment.code), "entry_point": fragment.entry,
                      "targets": [{"format": form, "blend": {"color": blend, "alpha": blend}} for form in forms]},
            primitive={"topology": "triangle-list"}, depth_stencil=test if depth else None)
        self.targets = [gpu.texture(width, height, form) for form in forms]
        self.depth = gpu.texture(width, height, "depth32float") if depth else None
        self.kept = None
        corners = np.array([0, 1, 2, 2, 1, 3], np.uint32) + 4 * np.arange(count, dtype=np.uint32)[:, None]
        self.index = gpu.device.create_buffer_with_data(data=np.ascontiguousarray(corners), usage=wgpu.BufferUsage.INDEX)

    def group(self, parameters: Parameters) -> GPUBindGroup:
        """The bind group of a draw."""
        return self.gpu.group(self.layout, [self.vertex, self.fragment], self.vertex.uniform(parameters))

    def encode(self, encoder: GPUCommandEncoder, group: GPUBindGroup, timestamps: dict | None = None, instance: int = 0,
               behind: tuple[float, float, float, float] = (0, 0, 0, 0), far: float = 1, parts: int = 1, part: int = 0) -> None:
        """Encodes a draw on cleared targets. instance: 0 for the left eye, 1 for the right; behind, far: colour and depth there.

        parts, part: into one of so many parts of the targets, side by side, beside what the parts before it hold.
        """
        load = "load" if part else "clear"
        attachments = [{"view": target.create_view(), "clear_value": behind, "load_op": load, "store_op": "store"}
                       for target in self.targets]
        depth = self.depth and {"view": (self.kept or self.depth).create_view(), "depth_clear_value": far,
                                "depth_load_op": "load" if self.kept else "clear", "depth_store_op": "store"}
        work = encoder.begin_render_pass(color_attachments=attachments, depth_stencil_attachment=depth, timestamp_writes=timestamps)
        work.set_pipeline(self.pipeline)
        work.set_bind_group(0, group)
        work.set_viewport(part * self.width // parts, 0, self.width // parts, self.height, 0, 1)
        work.set_index_buffer(self.index, "uint32")
        work.draw_indexed(self.count * 6, 1, 0, 0, instance)
        work.end()

    def keep_depth(self, depth: GPUTexture | None) -> None:
        """From here on draws against a depth that lies there; None: against the same far one everywhere."""
        self.kept = depth

    def read(self) -> np.ndarray:
        """The first target's picture (H, W, 4) float32, premultiplied RGBA."""
        raw = self.gpu.device.queue.read_texture(
            {"texture": self.targets[0]}, {"bytes_per_row": self.width * 8, "rows_per_image": self.height},
            (self.width, self.height, 1))
        return np.frombuffer(raw, np.float16).reshape(self.height, self.width, 4).astype(np.float32)

    def draw(self, parameters: Parameters, instance: int = 0, behind: tuple[float, float, float, float] = (0, 0, 0, 0),
             far: float = 1, parts: int = 1, part: int = 0) -> np.ndarray:
        """Draws and returns the picture (H, W, 4) float32, premultiplied RGBA. Arguments as `encode`'s."""
        encoder = self.gpu.device.create_command_encoder()
        self.encode(encoder, self.group(parameters), instance=instance, behind=behind, far=far, parts=parts, part=part)
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
