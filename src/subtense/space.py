"""The uncertain numbers behind some inputs, as independent lines of a budget.

`Space` walks through inputs (dataclasses or mappings of nouns), takes each noun once however often it stands there,
and turns the parts of all nouns into `Line`s that do not depend on each other. It knows how to put moved numbers back.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .arrays import Array
from .distribution import NORMAL, Distribution
from .errors import InputError
from .noun import Noun, Part, fields_of
from .quantity import Quantity

Correlations = Mapping[tuple[str, str], float]
Moved = dict[Hashable, dict[str, Array]]


@dataclass(frozen=True)
class Line:
    """A group of numbers that vary together and independently of all other lines.

    Attributes:
        name: what a budget calls it.
        source: where its uncertainty comes from.
        members: (noun identity, part key, number of components) in the order of `value`.
        value: (k, ...) nominal numbers.
        u: (k, ...) standard deviations of independent components; None where `factor` is given.
        factor: (k, m) such that value + factor @ z has the wanted covariance.
        laws: the law of each of the m standardised variables z.
        dof: degrees of freedom.
    """

    name: str
    source: str
    members: tuple[tuple[Hashable, str, int], ...]
    value: Array
    u: Array | None
    factor: Array | None
    laws: tuple[Distribution, ...]
    dof: float

    @property
    def count(self) -> int:
        """m, the number of standardised variables."""
        return len(self.laws)

    def shift(self, j: int) -> Array:
        """(k, ...) change of the numbers when variable j grows by 1."""
        if self.factor is not None:
            column = self.factor[:, j]
            return np.asarray(column.reshape(-1, *(1,) * (self.value.ndim - 1)))
        assert self.u is not None
        change = np.zeros_like(np.broadcast_arrays(self.value, self.u)[0])
        change[j] = self.u[j]
        return change

    def at(self, z: Array) -> Array:
        """(k, n) numbers at standardised deviations z (m, n), for lines without leading axes."""
        if self.factor is not None:
            return np.asarray(self.factor @ z + self.value[:, None])
        assert self.u is not None
        return np.asarray(z * self.u[:, None] + self.value[:, None])

    def draw(self, rng: np.random.Generator, n: int) -> Array:
        """(k, n) random numbers."""
        if all(law == NORMAL for law in self.laws):
            return self.at(rng.standard_normal((self.count, n)))
        return self.at(np.stack([law.draw(rng, (n,)) for law in self.laws]))

    def put(self, numbers: Array, moved: Moved) -> None:
        """Write (k, ...) numbers into `moved`, noun by noun."""
        first = 0
        for identity, key, count in self.members:
            moved.setdefault(identity, {})[key] = numbers[first : first + count]
            first += count


class Space:
    """The nouns behind one or several inputs, and their lines.

    Args:
        inputs: one or several dataclasses or mappings whose fields are nouns (other fields are left alone).
        correlations: {(field, field): coefficient} between quantities of the first inputs.
    """

    def __init__(self, inputs: Sequence[Any], correlations: Correlations | None = None) -> None:
        self.inputs = tuple(inputs)
        self.nouns: dict[Hashable, Noun] = {}
        names: dict[Hashable, str] = {}
        for name, noun in _walk(self.inputs):
            self.nouns.setdefault(noun.identity, noun)
            names.setdefault(noun.identity, name)
        lines = [
            _line(identity, part, names[identity] if isinstance(noun, Quantity) else part.label)
            for identity, noun in self.nouns.items()
            for part in noun.parts()
        ]
        self.lines = _correlate(lines, self.inputs[0], correlations) if correlations else tuple(lines)

    @property
    def leading(self) -> tuple[int, ...]:
        """The leading axes of all nouns, by broadcasting."""
        return np.broadcast_shapes(*{noun.leading for noun in self.nouns.values()})

    def rebuilt(self, moved: Moved) -> tuple[Any, ...]:
        """The inputs with moved numbers in place."""
        new = {i: self.nouns[i].moved(values) for i, values in moved.items()}
        return tuple(_replaced(inputs, new) for inputs in self.inputs)


def map_nouns(inputs: Any, change: Any) -> Any:
    """The same dataclass or mapping with `change` applied to each noun in it."""

    def one(value: Any) -> Any:
        if isinstance(value, Noun):
            return change(value)
        if isinstance(value, tuple):
            return tuple(one(v) for v in value)
        return value

    fields = {name: one(value) for name, value in fields_of(inputs).items()}
    return fields if isinstance(inputs, Mapping) else dataclasses.replace(inputs, **fields)


def _walk(inputs: Sequence[Any]) -> Iterator[tuple[str, Noun]]:
    for one in inputs:
        for name, value in fields_of(one).items():
            if isinstance(value, Noun):
                yield name.replace("_", " "), value
            elif isinstance(value, tuple):
                for i, noun in enumerate(value, 1):
                    if isinstance(noun, Noun):
                        yield f"{name.replace('_', ' ')} {i}", noun


def _replaced(inputs: Any, new: Mapping[Hashable, Noun]) -> Any:
    return map_nouns(inputs, lambda noun: new.get(noun.identity, noun)) if new else inputs


def _line(identity: Hashable, part: Part, name: str) -> Line:
    members = ((identity, part.key, len(part.value)),)
    laws = part.distributions or (NORMAL,) * len(part.value)
    if part.cov is None:
        return Line(name, part.source, members, part.value, part.u, None, laws, part.dof)
    factor = _root(part.cov)
    return Line(name, part.source, members, part.value, None, factor, (NORMAL,) * factor.shape[1], part.dof)


def _root(cov: Array) -> Array:
    """(k, m) matrix L with L L^T = cov, whatever the units of the components."""
    scale = np.sqrt(np.diag(cov))
    safe = np.where(scale > 0, scale, 1.0)
    values, vectors = np.linalg.eigh(cov / np.outer(safe, safe))
    if values.min() < -1e-8 * max(values.max(), 1.0):
        raise InputError("covariance", f"with eigenvalue {values.min():.3g}", "it must be positive semi-definite")
    keep = values > 1e-14 * values.max()
    return np.asarray(safe[:, None] * vectors[:, keep] * np.sqrt(values[keep]))


def _correlate(lines: list[Line], inputs: Any, correlations: Correlations) -> tuple[Line, ...]:
    """Merge the lines of quantities that were said to be correlated."""
    fields = fields_of(inputs)
    order: list[str] = []
    for pair in correlations:
        for name in pair:
            if not isinstance(fields.get(name), Quantity):
                raise InputError("correlations", name, f"name quantities among {', '.join(fields)}")
            if name not in order:
                order.append(name)
    wanted = [fields[name].identity for name in order]
    mine = {line.members[0][0]: line for line in lines if line.members[0][0] in wanted}
    if len(mine) < len(order):
        raise InputError("correlations", order, "an exact quantity can't be correlated; give it an uncertainty")
    u = np.array([float(np.ravel(mine[i].u)[0]) for i in wanted])  # type: ignore[arg-type]
    r = np.eye(len(order))
    for (a, b), coefficient in correlations.items():
        if not -1 <= coefficient <= 1:
            raise InputError(f"correlation of {a} and {b}", coefficient, "give a number between -1 and 1")
        i, j = order.index(a), order.index(b)
        r[i, j] = r[j, i] = coefficient
    factor = _root(np.outer(u, u) * r)
    merged = Line(
        ", ".join(n.replace("_", " ") for n in order), "correlated",
        tuple(mine[i].members[0] for i in wanted), np.concatenate([mine[i].value for i in wanted]), None, factor,
        (NORMAL,) * factor.shape[1], min(mine[i].dof for i in wanted),
    )  # fmt: skip
    return (*(line for line in lines if line.members[0][0] not in wanted), merged)
