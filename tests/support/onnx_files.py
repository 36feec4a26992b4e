"""Made-up networks as ONNX files, whose answers are known."""

from pathlib import Path

import numpy as np
from onnx import TensorProto, helper, numpy_helper, save


def write_network(path: Path, takes: tuple | dict[str, tuple], gives: dict[str, tuple], nodes: list,
                  constants: dict[str, np.ndarray]) -> Path:
    """takes: shape of the one input `image`, or input -> shape; gives: output -> shape; nodes: of `helper.make_node`. Opset 17."""
    takes = takes if isinstance(takes, dict) else {"image": takes}
    describe = lambda name, shape: helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)  # noqa: E731
    ends = ([describe(*item) for item in each.items()] for each in (takes, gives))
    fixed = [numpy_helper.from_array(np.asarray(value), name) for name, value in constants.items()]
    graph = helper.make_graph(nodes, "made-up", *ends, fixed)
    save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9), path)
    return path


def write_encoder(path: Path, mixing: np.ndarray, constant: np.ndarray, size: int = 224) -> Path:
    """A network of one output: mixing (12, n) of the mean red, green and blue of the crop's quadrants, plus constant (n,)."""
    nodes = [helper.make_node("AveragePool", ["image"], ["pooled"], kernel_shape=[size // 2] * 2, strides=[size // 2] * 2),
             helper.make_node("Flatten", ["pooled"], ["flat"]), helper.make_node("MatMul", ["flat", "mixing"], ["mixed"]),
             helper.make_node("Add", ["mixed", "constant"], ["codes"])]
    return write_network(path, ("N", 3, size, size), {"codes": ("N", mixing.shape[1])}, nodes,
                         {"mixing": mixing.astype(np.float32), "constant": constant.astype(np.float32)})


def write_instant_hmr(path: Path, flat: np.ndarray, points: np.ndarray) -> Path:
    """InstantHMR's shapes; joints_2d is flat (13, 70, 2), joints_3d points (13, 70, 3) times these numbers: the highest red, green
    and blue of the crop in 0..1, the three of cliff_cond, x of the middle of red, green and blue in -1..1 of the crop, y, and 1."""
    gives = {"mhr_params": (1, 204), "shape_params": (1, 45), "cam_trans": (1, 3), "joints_2d": (1, 70, 2), "joints_3d": (1, 70, 3)}
    constants = {"deviation": np.float32([0.229, 0.224, 0.225]).reshape(1, 3, 1, 1), "one": np.ones((1, 1), np.float32),
                 "mean": np.float32([0.485, 0.456, 0.406]).reshape(1, 3, 1, 1), "tiny": np.float32([1e-6]),
                 "places": np.float32((np.arange(224) + 0.5) / 112 - 1)[:, None], "both": np.array([2, 3]),
                 "flat": np.array([1, 3]), "down": np.array([2]), "across": np.array([3])}
    node = helper.make_node
    nodes = [node("Mul", ["image", "deviation"], ["scaled"]), node("Add", ["scaled", "mean"], ["rgb"]),
             node("ReduceMax", ["rgb"], ["most"], axes=[2, 3], keepdims=0),
             node("ReduceSum", ["rgb", "both"], ["sum"], keepdims=0), node("Add", ["sum", "tiny"], ["mass"])]
    for name, over in (("x", "down"), ("y", "across")):
        nodes += [node("ReduceSum", ["rgb", over], [f"line_{name}"], keepdims=0),
                  node("MatMul", [f"line_{name}", "places"], [f"moment_{name}"]),
                  node("Reshape", [f"moment_{name}", "flat"], [f"flat_{name}"]),
                  node("Div", [f"flat_{name}", "mass"], [f"at_{name}"])]
    nodes.append(node("Concat", ["most", "cliff_cond", "at_x", "at_y", "one"], ["numbers"], axis=1))
    for name, mixing in (("joints_2d", flat), ("joints_3d", points)):
        constants |= {f"mix_{name}": np.float32(mixing).reshape(13, -1), f"shape_{name}": np.array(gives[name])}
        nodes += [node("MatMul", ["numbers", f"mix_{name}"], [f"row_{name}"]),
                  node("Reshape", [f"row_{name}", f"shape_{name}"], [name])]
    for name in ("mhr_params", "shape_params", "cam_trans"):
        constants[f"zero_{name}"] = np.zeros(gives[name], np.float32)
        nodes.append(node("Identity", [f"zero_{name}"], [name]))
    return write_network(path, {"image": (1, 3, 224, 224), "cliff_cond": (1, 3)}, gives, nodes, constants)


POINTS = 133
SIGMA = np.sqrt([288 / 8, 384 / 8])
"""Of mmpose's labels for 288 x 384 px along x and y, bins of half a pixel."""


def write_wholebody(path: Path, nodes: list, constants: dict[str, np.ndarray]) -> Path:
    """A whole-body network of the official shapes, 288 x 384 px."""
    return write_network(path, (1, 3, 384, 288), {"simcc_x": (1, POINTS, 576), "simcc_y": (1, POINTS, 768)}, nodes, constants)


def write_brightest(path: Path, top: float) -> Path:
    """A whole-body network: point i peaks where the red, green or blue (i modulo 3) of the crop is highest, as high as top times
    that colour's share of 255; heights are read off the input by undoing mmpose's own normalisation."""
    constants = {"deviation": np.array([58.395, 57.12, 57.375], np.float32).reshape(1, 3, 1, 1) * np.float32(top / 255),
                 "mean": np.array([123.675, 116.28, 103.53], np.float32).reshape(1, 3, 1, 1) * np.float32(top / 255),
                 "colour": np.arange(POINTS) % 3, "last": np.array([3]), "halves": np.array([1, 0.9], np.float32)}
    nodes = [helper.make_node("Mul", ["image", "deviation"], ["scaled"]), helper.make_node("Add", ["scaled", "mean"], ["rgb"])]
    for name, across, size in (("x", 2, 288), ("y", 3, 384)):
        constants[f"shape_{name}"] = np.array([1, POINTS, 2 * size])
        nodes += [helper.make_node("ReduceMax", ["rgb"], [f"line_{name}"], axes=[across], keepdims=0),
                  helper.make_node("Gather", [f"line_{name}", "colour"], [f"points_{name}"], axis=1),
                  helper.make_node("Unsqueeze", [f"points_{name}", "last"], [f"column_{name}"]),
                  helper.make_node("Mul", [f"column_{name}", "halves"], [f"bins_{name}"]),
                  helper.make_node("Reshape", [f"bins_{name}", f"shape_{name}"], [f"simcc_{name}"])]
    return write_wholebody(path, nodes, constants)


def write_figure(path: Path, at: np.ndarray, high: np.ndarray, low: np.ndarray) -> Path:
    """A whole-body network whose points (133, 2) px of the crop stay in place. Its peaks (133,) have the form of mmpose's labels;
    they are high where the crop has blue, low where it has none."""
    constants = {"blue": np.array([2]), "none": np.array([-103.53 / 57.375 + 1], np.float32)}
    nodes = [helper.make_node("Gather", ["image", "blue"], ["channel"], axis=1),
             helper.make_node("ReduceMax", ["channel"], ["most"], keepdims=0),
             helper.make_node("Greater", ["most", "none"], ["is_blue"])]
    for i, (name, size) in enumerate((("x", 288), ("y", 384))):
        form = np.exp(-((np.arange(2 * size) - 2 * at[:, i, None] + 1) / SIGMA[i]) ** 2 / 2)[None]
        constants |= {f"{kind}_{name}": (form * peaks[:, None]).astype(np.float32)
                      for kind, peaks in (("high", high), ("low", low))}
        nodes.append(helper.make_node("Where", ["is_blue", f"high_{name}", f"low_{name}"], [f"simcc_{name}"]))
    return write_wholebody(path, nodes, constants)
