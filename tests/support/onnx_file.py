"""Writes small ONNX files, as onnx.proto3 lays them out, so that made-up networks can be read in the test that makes them."""

from pathlib import Path

import numpy as np

FLOAT, INTS = 1, 7
OPSET, IR = 13, 8


def write_network(path: Path, given: tuple[str, tuple], gives: tuple[str, tuple], nodes: list[bytes],
                  weights: dict[str, np.ndarray]) -> Path:
    """given, gives: name and shape of input and output, a name for a free length; nodes: of `node`; weights: by name."""
    graph = b"".join([*(_field(1, node) for node in nodes), _field(2, b"made-up"),
                      *(_field(5, _tensor(name, value)) for name, value in weights.items()),
                      _field(11, _value(*given)), _field(12, _value(*gives))])
    path.write_bytes(_field(1, IR) + _field(7, graph) + _field(8, _field(1, b"") + _field(2, OPSET)))
    return path


def node(operator: str, inputs: list[str], output: str, **ints: list[int]) -> bytes:
    """One operation; ints: its attributes, lists of whole numbers."""
    attributes = (_field(1, name.encode()) + b"".join(_field(8, value) for value in values) + _field(20, INTS)
                  for name, values in ints.items())
    return b"".join([*(_field(1, name.encode()) for name in inputs), _field(2, output.encode()), _field(4, operator.encode()),
                     *(_field(5, attribute) for attribute in attributes)])


def _field(number: int, value: int | bytes) -> bytes:
    if isinstance(value, int):
        return _varint(number << 3) + _varint(value)
    return _varint(number << 3 | 2) + _varint(len(value)) + value


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    return bytes([*out, value])


def _tensor(name: str, value: np.ndarray) -> bytes:
    dims = b"".join(_field(1, length) for length in value.shape)
    return dims + _field(2, FLOAT) + _field(8, name.encode()) + _field(9, value.astype("<f4").tobytes())


def _value(name: str, shape: tuple) -> bytes:
    dims = (_field(1, length) if isinstance(length, int) else _field(2, length.encode()) for length in shape)
    kind = _field(1, FLOAT) + _field(2, b"".join(_field(1, dim) for dim in dims))
    return _field(1, name.encode()) + _field(2, _field(1, kind))
