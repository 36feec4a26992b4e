"""Compiles the package's HLSL with glslang and runs it through `wgpu`, in the tests on Mesa's software Vulkan (lavapipe)."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np

PROGRAMS = {"glslangValidator": "glslang-tools", "spirv-val": "spirv-tools", "spirv-dis": "spirv-tools"}
LAVAPIPE = Path("/usr/share/vulkan/icd.d")
SHIMS = Path(__file__).parent / "shims"


def missing_packages():
    """Debian packages that compiling and running needs and that are not there."""
    missing = {package for program, package in PROGRAMS.items() if not shutil.which(program)}
    return sorted(missing | (set() if any(LAVAPIPE.glob("lvp_icd*")) else {"mesa-vulkan-drivers"}))


def compile_hlsl(source, entry, stage, folder, include=()):
    """source: path. Returns the SPIR-V bytes, validated for Vulkan 1.0; AssertionError with the compiler's words."""
    out = Path(folder) / f"{Path(source).stem}.{entry}.spv"
    command = ["glslangValidator", "-D", "-V", "-S", stage, "-e", entry, "--source-entrypoint", entry, "--auto-map-bindings",
               "--auto-map-locations", *(f"-I{i}" for i in (Path(source).parent, *include)), str(source), "-o", str(out)]
    for step in (command, ["spirv-val", "--target-env", "vulkan1.0", str(out)]):
        done = subprocess.run(step, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    return out.read_bytes()


class Program:
    """One compiled entry point: which buffer it binds where, and its parameters' places."""

    def __init__(self, code, entry):
        self.code, self.entry = code, entry
        text = subprocess.run(["spirv-dis", "--no-color", "-"], input=code, capture_output=True, check=True).stdout.decode()
        binding = dict(re.findall(r"OpDecorate %(\w+) Binding (\d+)", text))
        pointer = dict(re.findall(r"%(\w+) = OpVariable %_ptr_Uniform_(\w+) Uniform", text))
        constant = set(re.findall(r"OpDecorate %(\w+) Block", text))
        readonly = set(re.findall(r"OpMemberDecorate %(\w+) 0 NonWritable", text))
        self.bindings, self.parameters = {}, {}
        for variable, number in binding.items():
            kind = pointer[variable]
            if kind in constant:
                kind_name = kind
                names = re.findall(rf"OpMemberName %{kind_name} (\d+) \"(\w+)\"", text)
                offsets = dict(re.findall(rf"OpMemberDecorate %{kind_name} (\d+) Offset (\d+)", text))
                self.parameters |= {name: int(offsets[i]) for i, name in names}
                self.bindings[int(number)] = ("uniform", None)
            else:
                name = re.sub(r"_0$", "", variable)
                self.bindings[int(number)] = ("read-only-storage" if kind in readonly else "storage", name)

    def uniform(self, values):
        """values: parameter -> int (a uint there) or floats, a matrix by columns. Returns the parameter block."""
        block = bytearray(512)
        for name, offset in self.parameters.items():
            raw = np.asarray(values[name], np.uint32 if isinstance(values[name], int) else np.float32).tobytes()
            block[offset:offset + len(raw)] = raw
        return bytes(block)


class Gpu:
    """Named storage buffers on a device, and what runs over them. `software`: lavapipe, else the first hardware GPU."""

    def __init__(self, software=True):
        import wgpu

        self.wgpu = wgpu
        kinds = ["CPU"] if software else ["DiscreteGPU", "IntegratedGPU"]
        adapter = next(a for a in wgpu.gpu.enumerate_adapters_sync()
                       if a.info["backend_type"] == "Vulkan" and a.info["adapter_type"] in kinds)
        self.timed = "timestamp-query" in adapter.features
        self.device = adapter.request_device_sync(required_features=["timestamp-query"] if self.timed else [])
        self.summary, self.buffers, self.pipelines = adapter.summary, {}, {}

    def put(self, name, array):
        usage = self.wgpu.BufferUsage
        raw = np.ascontiguousarray(array)
        raw = raw if raw.nbytes else np.zeros(4, np.uint32)
        self.buffers[name] = self.device.create_buffer_with_data(data=raw, usage=usage.STORAGE | usage.COPY_SRC | usage.COPY_DST)

    def get(self, name, dtype=np.float32):
        return np.frombuffer(self.device.queue.read_buffer(self.buffers[name]), dtype)

    def layout(self, programs):
        """Bind group layout of some stages; `programs`: shader stage -> Program with agreeing bindings."""
        entries = {}
        for visibility, program in programs.items():
            for number, (kind, _) in program.bindings.items():
                entry = entries.setdefault(number, {"binding": number, "visibility": 0, "buffer": {"type": kind}})
                entry["visibility"] |= visibility
        return self.device.create_bind_group_layout(entries=list(entries.values()))

    def group(self, layout, program, uniform):
        usage = self.wgpu.BufferUsage
        entries = []
        for number, (kind, name) in program.bindings.items():
            buffer = self.buffers[name] if kind != "uniform" else self.device.create_buffer_with_data(
                data=uniform, usage=usage.UNIFORM)
            entries.append({"binding": number, "resource": {"buffer": buffer, "offset": 0, "size": buffer.size}})
        return self.device.create_bind_group(layout=layout, entries=entries)

    def kernel(self, program):
        if program.code not in self.pipelines:
            layout = self.layout({self.wgpu.ShaderStage.COMPUTE: program})
            self.pipelines[program.code] = layout, self.device.create_compute_pipeline(
                layout=self.device.create_pipeline_layout(bind_group_layouts=[layout]),
                compute={"module": self.device.create_shader_module(code=program.code), "entry_point": program.entry})
        return self.pipelines[program.code]

    def run(self, jobs):
        """jobs: list of (Program, parameters, workgroups), in order."""
        encoder = self.device.create_command_encoder()
        for program, parameters, groups in jobs:
            layout, pipeline = self.kernel(program)
            work = encoder.begin_compute_pass()
            work.set_pipeline(pipeline)
            work.set_bind_group(0, self.group(layout, program, program.uniform(parameters)))
            work.dispatch_workgroups(groups)
            work.end()
        self.device.queue.submit([encoder.finish()])


def sort_steps(count, block=4096):
    """(key count, [(kernel, stage, stride)]): the bitonic network as the package's C# runs it."""
    total = block
    while total < count:
        total *= 2
    steps, k = [("SortBlocks", block, 0)], 2 * block
    while k <= total:
        j = k // 2
        while j >= block:
            steps.append(("SortAcross", k, j))
            j //= 2
        steps.append(("SortMerge", k, 0))
        k *= 2
    return total, steps


def shader_passes(path):
    """Render pipeline ("" for the built-in one) -> HLSL of its pass, from a ShaderLab file."""
    passes = {}
    for part in Path(path).read_text().split("SubShader\n")[1:]:
        pipeline = re.search(r'"RenderPipeline" = "(\w+)"', part)
        passes[pipeline[1] if pipeline else ""] = part.split("HLSLPROGRAM")[1].split("ENDHLSL")[0]
    return passes


class Painting:
    """Draws `count` splats with a vertex and a fragment program; the picture is premultiplied rgba, (H, W, 4)."""

    def __init__(self, gpu, vertex, fragment, width, height, count):
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

    def encode(self, encoder, parameters, timestamps=None, instance=0):
        attachment = {"view": self.target.create_view(), "clear_value": (0, 0, 0, 0), "load_op": "clear", "store_op": "store"}
        work = encoder.begin_render_pass(color_attachments=[attachment], timestamp_writes=timestamps)
        work.set_pipeline(self.pipeline)
        work.set_bind_group(0, self.gpu.group(self.layout, self.vertex, self.vertex.uniform(parameters)))
        work.set_index_buffer(self.index, "uint32")
        work.draw_indexed(self.count * 6, 1, 0, 0, instance)
        work.end()

    def draw(self, parameters, instance=0):
        encoder = self.gpu.device.create_command_encoder()
        self.encode(encoder, parameters, instance=instance)
        self.gpu.device.queue.submit([encoder.finish()])
        raw = self.gpu.device.queue.read_texture(
            {"texture": self.target}, {"bytes_per_row": self.width * 8, "rows_per_image": self.height},
            (self.width, self.height, 1))
        return np.frombuffer(raw, np.float16).reshape(self.height, self.width, 4).astype(np.float32)


def projection(camera, flipped=False):
    """4x4 for an eye with y up and -z ahead; flipped: y down in clip space, as Unity has it when it draws to a texture."""
    fx, fy = (2 * f / s for f, s in zip(camera.focal, (camera.width, camera.height), strict=True))
    shift_x, shift_y = 1 - 2 * camera.center[0] / camera.width, 2 * camera.center[1] / camera.height - 1
    p = np.array([[fx, 0, shift_x, 0], [0, fy, shift_y, 0], [0, 0, -1.0, -.02], [0, 0, -1, 0]])
    if flipped:
        p[1] *= -1
    return p
