"""The few driver calls that the trainer needs: memory, launches, graphs, events. One context, and a stream for each trainer."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from gsac.avatar.cuda import why_not
from gsac.avatar.cuda.kernels import KERNELS, cubin

Shape = int | tuple[int, ...]


class NoDeviceError(Exception):
    """No GPU can be used; the message gives the reason."""


class DeviceError(Exception):
    """A driver call failed; the message has the call's name and the driver's error."""


def _call(name: str, *arguments: Any) -> Any:
    from cuda.bindings import driver

    error, *out = getattr(driver, name)(*arguments)
    if error != driver.CUresult.CUDA_SUCCESS:
        hint = "; use fewer gaussians, smaller images or a smaller batch" if "OUT_OF_MEMORY" in error.name else ""
        raise DeviceError(f"{name}: {error.name}{hint}")
    return out[0] if len(out) == 1 else out


class Buffer:
    """An array on the device. Copies to and from it take their turn in a stream: they wait for no other one's work."""

    def __init__(self, shape: Shape, dtype: DTypeLike, stream: Any):
        """stream: `Device.stream` of whoever works with it."""
        self.shape, self.dtype, self.stream = tuple(np.atleast_1d(shape)), np.dtype(dtype), stream
        self.bytes = int(np.prod(self.shape, dtype=np.int64)) * self.dtype.itemsize
        self.pointer = int(_call("cuMemAlloc", max(self.bytes, 16)))

    def write(self, array: np.ndarray) -> Buffer:
        """Copies array (...) of the buffer's size to the device."""
        array = np.ascontiguousarray(array, self.dtype)
        if array.nbytes != self.bytes:
            raise ValueError(f"the buffer is {self.shape}, the array {array.shape}")
        _call("cuMemcpyHtoDAsync", self.pointer, array.ctypes.data, self.bytes, self.stream)
        _call("cuStreamSynchronize", self.stream)
        return self

    def read(self) -> np.ndarray:
        """A copy (...) in the buffer's shape."""
        array = np.empty(self.shape, self.dtype)
        _call("cuMemcpyDtoHAsync", array.ctypes.data, self.pointer, self.bytes, self.stream)
        _call("cuStreamSynchronize", self.stream)
        return array

    def fill(self, byte: int) -> Buffer:
        """Sets every byte."""
        _call("cuMemsetD8Async", self.pointer, byte, self.bytes, self.stream)
        return self

    def free(self) -> None:
        """Gives the memory back; more than once does no harm."""
        if self.pointer:
            _call("cuMemFree", self.pointer)
            self.pointer = 0


@lru_cache(maxsize=4)  # a fit opens eight devices
def _functions(code: bytes, names: tuple[str, ...]) -> dict[str, Any]:
    """Handles of machine code's kernels, by name."""
    module = _call("cuModuleLoadData", code)
    return {name: _call("cuModuleGetFunction", module, name.encode()) for name in names}


class Device:
    """The first GPU, a stream of its own, and the kernels by name. Raises NoDeviceError where there is none."""

    def __init__(self):
        if why := why_not():
            raise NoDeviceError(why)
        from cuda.bindings import driver

        self._driver = driver
        handle = _call("cuDeviceGet", 0)
        _call("cuCtxSetCurrent", _call("cuDevicePrimaryCtxRetain", handle))
        attribute = driver.CUdevice_attribute
        major, minor, self.processors = (_call("cuDeviceGetAttribute", a, handle) for a in (
            attribute.CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MAJOR, attribute.CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MINOR,
            attribute.CU_DEVICE_ATTRIBUTE_MULTIPROCESSOR_COUNT))
        self.name = _call("cuDeviceGetName", 128, handle).split(b"\0")[0].decode()
        self.architecture = f"sm_{major}{minor}"
        self.kernels: dict = {}
        self.load(cubin(self.architecture), KERNELS)
        self.stream = _call("cuStreamCreate", driver.CUstream_flags.CU_STREAM_NON_BLOCKING)

    def load(self, code: bytes, names: Iterable[str]) -> None:
        """Adds kernels from machine code."""
        self.kernels |= _functions(code, tuple(names))

    def launch(self, kernel: str, grid: tuple[int, int], threads: int, struct: ctypes.Structure) -> None:
        """Launches a kernel, which takes one struct by value."""
        arguments = (ctypes.c_void_p * 1)(ctypes.addressof(struct))
        _call("cuLaunchKernel", self.kernels[kernel], grid[0], grid[1], 1, threads, 1, 1, 0, self.stream,
              ctypes.addressof(arguments), 0)

    def wait(self) -> None:
        """Until the stream has done all its work."""
        _call("cuStreamSynchronize", self.stream)

    def graph(self, record: Callable[[], object]) -> Any:
        """Handle of a graph of all that `record` launches; `replay` runs it."""
        driver = self._driver
        _call("cuStreamBeginCapture", self.stream, driver.CUstreamCaptureMode.CU_STREAM_CAPTURE_MODE_THREAD_LOCAL)
        record()
        captured = _call("cuStreamEndCapture", self.stream)
        ready = _call("cuGraphInstantiate", captured, 0)
        _call("cuGraphDestroy", captured)
        return ready

    def replay(self, graph: Any) -> None:
        """Puts a graph's work into the stream."""
        _call("cuGraphLaunch", graph, self.stream)

    def drop(self, graph: Any) -> None:
        """Frees a graph."""
        _call("cuGraphExecDestroy", graph)

    def event(self) -> Any:
        """Handle of a new event, for `mark`."""
        return _call("cuEventCreate", 0)

    def mark(self, event: Any) -> None:
        """Records the event at this place of the stream."""
        _call("cuEventRecord", event, self.stream)

    def milliseconds(self, begin: Any, end: Any) -> float:
        """From one marked event to the other."""
        _call("cuEventSynchronize", end)
        return float(_call("cuEventElapsedTime", begin, end))
