"""A part of a TFLite network: from some of its tensors to some others, and nothing in between that is not needed.

This is how a network with operations of its maker's own is run: the plain parts by the engine, what lies between by us. The
file's bytes keep their place; only the lists of inputs, outputs and operations of the copy get shorter.

Source: the FlatBuffers binary format (tables, vtables, vectors), and TFLite's schema for the numbers of the fields.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

from ..errors import InputError

_SUBGRAPHS, _TENSORS, _INPUTS, _OUTPUTS, _OPERATORS = 2, 0, 1, 2, 3
_TENSOR_NAME, _OPERATOR_INPUTS, _OPERATOR_OUTPUTS = 3, 1, 2


class _Flat:
    """A FlatBuffer, changed in place."""

    def __init__(self, content: bytes) -> None:
        self.bytes = bytearray(content)

    def number(self, form: str, at: int) -> int:
        return int(struct.unpack_from(form, self.bytes, at)[0])

    def follow(self, at: int) -> int:
        """Where an offset at this place leads."""
        return at + self.number("<I", at)

    def field(self, table: int, number: int) -> int:
        """Where a field of a table leads; 0 where the table has none."""
        vtable = table - self.number("<i", table)
        slot = 4 + 2 * number
        inner = self.number("<H", vtable + slot) if slot < self.number("<H", vtable) else 0
        return self.follow(table + inner) if inner else 0

    def numbers(self, vector: int) -> list[int]:
        """The elements of a vector of 32-bit numbers."""
        return list(struct.unpack_from(f"<{self.number('<I', vector)}i", self.bytes, vector + 4)) if vector else []

    def tables(self, vector: int) -> list[int]:
        """Where the elements of a vector of tables lie."""
        return [self.follow(vector + 4 + 4 * i) for i in range(self.number("<I", vector))]

    def text(self, vector: int) -> str:
        """A string."""
        return self.bytes[vector + 4 : vector + 4 + self.number("<I", vector)].decode()

    def shorten(self, vector: int, numbers: Sequence[int]) -> None:
        """Write no more numbers into a vector than it has."""
        if len(numbers) > self.number("<I", vector):
            raise InputError("part", f"{len(numbers)} tensors", f"give at most {self.number('<I', vector)}")
        struct.pack_into(f"<I{len(numbers)}i", self.bytes, vector, len(numbers), *numbers)


def part_of(content: bytes, inputs: Sequence[str], outputs: Sequence[str]) -> bytes:
    """The part of a network between tensors.

    Args:
        content: of a TFLite file.
        inputs: names of the tensors that will be given; no more than the file has inputs.
        outputs: names of the tensors wanted; no more than the file has outputs.

    Raises:
        InputError: no such tensor, or too many.
    """
    flat = _Flat(content)
    graph = flat.tables(flat.field(flat.follow(0), _SUBGRAPHS))[0]
    tensors = flat.tables(flat.field(graph, _TENSORS))
    numbers = {flat.text(flat.field(tensor, _TENSOR_NAME)): i for i, tensor in enumerate(tensors)}
    for name in (*inputs, *outputs):
        if name not in numbers:
            raise InputError("part", name, "the network has no tensor of this name")
    given, wanted = [numbers[name] for name in inputs], [numbers[name] for name in outputs]
    vector = flat.field(graph, _OPERATORS)
    kept, needed = [], set(wanted) - set(given)
    for operator in reversed(flat.tables(vector)):  # they stand in the order of running
        if needed.intersection(flat.numbers(flat.field(operator, _OPERATOR_OUTPUTS))):
            kept.append(operator)
            needed.update(set(flat.numbers(flat.field(operator, _OPERATOR_INPUTS))) - set(given))
    places = [vector + 4 + 4 * i for i in range(len(kept))]
    flat.shorten(vector, [target - place for target, place in zip(reversed(kept), places, strict=True)])
    flat.shorten(flat.field(graph, _INPUTS), given)
    flat.shorten(flat.field(graph, _OUTPUTS), wanted)
    return bytes(flat.bytes)
