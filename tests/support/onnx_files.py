"""Made-up networks as ONNX files, whose answers are known."""

from pathlib import Path

import numpy as np
from onnx import TensorProto, helper, numpy_helper, save


def write_network(path: Path, takes: tuple, gives: dict[str, tuple], nodes: list, constants: dict[str, np.ndarray]) -> Path:
    """takes: shape of the one input `image`; gives: output -> shape; nodes: of `helper.make_node`. Opset 17."""
    describe = lambda name, shape: helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)  # noqa: E731
    graph = helper.make_graph(nodes, "made-up", [describe("image", takes)], [describe(*item) for item in gives.items()],
                              [numpy_helper.from_array(np.asarray(value), name) for name, value in constants.items()])
    save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9), path)
    return path


def write_encoder(path: Path, mixing: np.ndarray, constant: np.ndarray, size: int = 224) -> Path:
    """A network of one output: mixing (12, n) of the mean red, green and blue of the crop's quadrants, plus constant (n,)."""
    nodes = [helper.make_node("AveragePool", ["image"], ["pooled"], kernel_shape=[size // 2] * 2, strides=[size // 2] * 2),
             helper.make_node("Flatten", ["pooled"], ["flat"]), helper.make_node("MatMul", ["flat", "mixing"], ["mixed"]),
             helper.make_node("Add", ["mixed", "constant"], ["codes"])]
    return write_network(path, ("N", 3, size, size), {"codes": ("N", mixing.shape[1])}, nodes,
                         {"mixing": mixing.astype(np.float32), "constant": constant.astype(np.float32)})
