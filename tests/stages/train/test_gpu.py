"""The GPU's side of a training on a made-up driver, which keeps memory and launches nothing: runs through and leaves nothing."""

import ctypes
import sys
from types import ModuleType
from unittest.mock import MagicMock

import pytest

from gsac.avatar.cuda import device, structs
from gsac.avatar.cuda.kernels import KERNELS
from gsac.avatar.gaussians import Gaussians
from gsac.stages.contract import StageError
from gsac.stages.train import stage
from gsac.stages.train.paper import densify


class FakeDriver:
    """Memory by address and the kernels launched, by name; a wait does all steps that were asked for and launched."""

    def __init__(self):
        self.memory, self.launched, self.scene, self.waiting = {}, [], None, False
        self.graphs = {}
        """Number of a graph -> the scene that its kernels were recorded with."""

    def call(self, name, *arguments):
        if act := getattr(self, name, None):
            return act(*arguments)
        return {"cuDeviceGetAttribute": 132, "cuDeviceGetName": b"fake", "cuEventElapsedTime": 1.0}.get(name, 1)

    def cuMemAlloc(self, size):  # noqa: N802, the driver's names
        buffer = ctypes.create_string_buffer(size)
        self.memory[ctypes.addressof(buffer)] = buffer
        return ctypes.addressof(buffer)

    def cuMemFree(self, pointer):  # noqa: N802
        del self.memory[pointer]

    def cuMemcpyHtoDAsync(self, pointer, source, size, stream):  # noqa: N802
        assert size <= len(self.memory[pointer])
        ctypes.memmove(pointer, source, size)

    def cuMemcpyDtoHAsync(self, target, pointer, size, stream):  # noqa: N802
        assert size <= len(self.memory[pointer])
        ctypes.memmove(target, pointer, size)

    def cuMemsetD8Async(self, pointer, byte, size, stream):  # noqa: N802
        assert size <= len(self.memory[pointer])
        ctypes.memset(pointer, byte, size)

    def cuModuleGetFunction(self, module, name):  # noqa: N802
        return name.decode()

    def cuLaunchKernel(self, kernel, *rest):  # noqa: N802
        struct = ctypes.cast(rest[8], ctypes.POINTER(ctypes.c_void_p))[0]
        self.scene = structs.Scene.from_buffer_copy(ctypes.string_at(struct, ctypes.sizeof(structs.Scene)))
        self.launched.append(kernel)
        self.waiting = True
        assert all(getattr(self.scene, name) in {*self.memory, None, 0} for name in structs.POINTERS), "kernels get live memory"

    def cuGraphInstantiate(self, captured, flags):  # noqa: N802
        self.graphs[len(self.graphs) + 1] = self.scene
        return len(self.graphs)

    def cuGraphLaunch(self, graph, stream):  # noqa: N802
        self.scene, self.waiting = self.graphs[graph], True

    def cuStreamSynchronize(self, stream):  # noqa: N802
        if not self.waiting:
            return
        self.waiting = False
        state = structs.State.from_address(self.scene.state)
        state.step = state.stop


@pytest.fixture
def driver(monkeypatch):
    made, bindings = FakeDriver(), ModuleType("cuda.bindings")
    bindings.driver = MagicMock()
    for name, module in (("cuda", ModuleType("cuda")), ("cuda.bindings", bindings)):
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setattr(device, "_call", made.call)
    monkeypatch.setattr(device, "cubin", lambda architecture: b"")
    for module in (device, stage):
        monkeypatch.setattr(module, "why_not", lambda: None)
    return made


@pytest.mark.parametrize("values", [
    {"exposure": True, "joint_rate": 1e-4, "pose_test_steps": 2}, {"gaussians": "auto", "holdout": 3},
    {"recipe": "paper", "steps": 4}], ids=["fast, all that it can learn", "fast, size searched", "paper"])
def test_a_training_on_the_gpu_drives_its_kernels_to_the_end_and_frees_its_memory(job, driver, monkeypatch, values):
    for name, value in (("FIRST", 0), ("EVERY", 2), ("PHASE", 1), ("THRESHOLD", 0.0)):
        monkeypatch.setattr(densify, name, value)
    made = job(device="cuda", frames=6, **({"steps": 12, "pose_rounds": 1, "pose_test_steps": 0} | values))
    stage.run(made)
    assert len(Gaussians.read(made.out / "avatar.npz")) > 500
    assert not driver.memory
    assert {"skin", "project", "blend", "blend_backward", "gather", "joint_step"} <= set(driver.launched) <= set(KERNELS)
    learned = {"place_joints"} if "joint_rate" in values else {"expression_step"} if "recipe" in values else set()
    assert learned <= set(driver.launched) and ("paper_step" in driver.launched) == ("recipe" in values)


def test_a_driver_that_fails_stops_the_stage_with_its_word_and_frees_the_memory(job, driver, monkeypatch):
    def refuse(*arguments):
        raise device.DeviceError("cuLaunchKernel: CUDA_ERROR_LAUNCH_FAILED")

    driver.cuLaunchKernel = refuse
    with pytest.raises(StageError, match="train on the GPU: .*LAUNCH_FAILED; or set train.device to cpu"):
        stage.run(job(device="cuda", frames=3, steps=4))
    assert not driver.memory
