"""Small ONNX files, written byte by byte, so that no test needs the package onnx."""


def varint(number: int) -> bytes:
    out = bytearray()
    while True:
        number, low = number >> 7, number & 0x7F
        out.append(low | (0x80 if number else 0))
        if not number:
            return bytes(out)


def field(number: int, value: bytes | str | int) -> bytes:
    """One field of a protobuf message."""
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    raw = value.encode() if isinstance(value, str) else value
    return varint(number << 3 | 2) + varint(len(raw)) + raw


def tensor(name: str, shape: tuple[int | str, ...]) -> bytes:
    """Name, float32, and sizes; a text is a free size."""
    sizes = b"".join(field(1, field(1, n) if isinstance(n, int) else field(2, n)) for n in shape)
    return field(1, name) + field(2, field(1, field(1, 1) + field(2, sizes)))


def onnx_file(
    operation: str, shape: tuple[int | str, ...], *, inputs=("x",), domain: str = "", metadata: dict[str, str] | None = None
) -> bytes:  # fmt: skip
    """A network of one operation of float32 arrays of one shape, `y = operation(inputs)`."""
    node = b"".join(field(1, name) for name in inputs) + field(2, "y") + field(4, operation)
    node += field(7, domain) if domain else b""
    graph = field(1, node) + field(2, "made") + b"".join(field(11, tensor(name, shape)) for name in inputs)
    graph += field(12, tensor("y", shape))
    told = b"".join(field(14, field(1, key) + field(2, value)) for key, value in (metadata or {}).items())
    versions = field(8, field(2, 13)) + (field(8, field(1, domain) + field(2, 1)) if domain else b"")
    return field(1, 8) + field(7, graph) + versions + told
