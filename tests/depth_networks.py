"""Small networks of depth, written byte by byte: what they give follows from the picture by arithmetic, so the truth is known."""

from pathlib import Path

import numpy as np
from onnx_files import FLOAT, TYPES, field, value_info


def _tensor(name: str, values: np.ndarray) -> bytes:
    array = np.asarray(values, np.float32)
    sizes = b"".join(field(1, n) for n in array.shape)
    return field(5, sizes + field(2, FLOAT) + field(8, name) + field(9, array.tobytes()))


def _node(operation: str, inputs: list[str], output: str, attributes: bytes = b"") -> bytes:
    return field(1, b"".join(field(1, one) for one in inputs) + field(2, output) + field(4, operation) + attributes)


def gray_network(
    path: Path, slope: float, start: float, *, shape=(1, 3, "h", "w"), output: str = "predicted_depth", more=None, extra=None
) -> Path:  # fmt: skip
    """A network whose output is start + slope times the mean of the input's channels.

    Args:
        path: where to write it.
        slope: see above.
        start: see above.
        shape: of the picture it takes; words are free sizes.
        output: its name.
        more: names and values of constants that it gives beside.
        extra: names to (type, shape) of inputs that it takes beside.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    axes = field(5, field(1, "axes") + field(20, 7) + field(8, 1))
    keep = field(5, field(1, "keepdims") + field(20, 2) + field(3, 1))
    graph = _node("ReduceMean", ["image"], "mean", axes + keep)
    graph += _node("Mul", ["mean", "slope"], "scaled") + _node("Add", ["scaled", "start"], output)
    for name in more or {}:
        graph += _node("Identity", [f"{name}_value"], name)
    graph += field(2, "gray")
    graph += _tensor("slope", np.array([slope])) + _tensor("start", np.array([start]))
    for name, values in (more or {}).items():
        graph += _tensor(f"{name}_value", values)
    graph += field(11, value_info("image", FLOAT, shape))
    for name, (kind, sizes) in (extra or {}).items():
        graph += field(11, value_info(name, TYPES[kind], sizes))
    graph += field(12, value_info(output, FLOAT, (1, 1, shape[2], shape[3])))
    for name, values in (more or {}).items():
        graph += field(12, value_info(name, FLOAT, np.shape(values)))
    path.write_bytes(field(1, 8) + field(7, graph) + field(8, field(1, "") + field(2, 17)))
    return path
