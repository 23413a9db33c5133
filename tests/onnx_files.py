"""Small ONNX files, written byte by byte: networks whose outputs are constants, for tests of what reads them."""

from pathlib import Path

import numpy as np

FLOAT, UINT8, INT64 = 1, 2, 7
TYPES = {"float32": FLOAT, "uint8": UINT8, "int64": INT64}


def varint(number: int) -> bytes:
    """Protobuf's integer."""
    out = b""
    while True:
        number, low = number >> 7, number & 127
        out += bytes([low | (128 if number else 0)])
        if not number:
            return out


def field(number: int, value: int | bytes | str) -> bytes:
    """Protobuf's field: an integer, or bytes with their length."""
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    data = value.encode() if isinstance(value, str) else value
    return varint(number << 3 | 2) + varint(len(data)) + data


def value_info(name: str, kind: int, shape: tuple[int | str, ...]) -> bytes:
    """A named tensor without values; a size that is a word is free."""
    sizes = b"".join(field(1, field(1, n) if isinstance(n, int) else field(2, n)) for n in shape)
    return field(1, name) + field(2, field(1, field(1, kind) + field(2, sizes)))


def constants(
    path: Path, outputs: dict[str, np.ndarray], *, inputs: dict[str, tuple[str, tuple[int | str, ...]]] | None = None,
    names: str | None = None, free: bool = False,
) -> Path:  # fmt: skip
    """A network that gives the same arrays for every input.

    Args:
        path: where to write it.
        outputs: their names and values, float32.
        inputs: name to (type, shape); one picture of 1 x 3 x 64 x 64 where None.
        names: its metadata of this name.
        free: whether the file leaves the outputs' sizes open.
    """
    inputs = inputs or {"images": ("float32", (1, 3, 64, 64))}
    graph = b""
    for name in outputs:
        graph += field(1, field(1, f"{name}_value") + field(2, name) + field(4, "Identity"))
    graph += field(2, "constants")
    for name, values in outputs.items():
        array = np.asarray(values, np.float32)
        sizes = b"".join(field(1, n) for n in array.shape)
        graph += field(5, sizes + field(2, FLOAT) + field(8, f"{name}_value") + field(9, array.tobytes()))
    for name, (kind, shape) in inputs.items():
        graph += field(11, value_info(name, TYPES[kind], shape))
    for name, values in outputs.items():
        shape = tuple(f"{name}{i}" for i in range(values.ndim)) if free else values.shape
        graph += field(12, value_info(name, FLOAT, shape))
    model = field(1, 8) + field(7, graph) + field(8, field(1, "") + field(2, 17))
    if names is not None:
        model += field(14, field(1, "names") + field(2, names))
    path.write_bytes(model)
    return path
