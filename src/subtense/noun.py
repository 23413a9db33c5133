"""What all nouns share: identity, the uncertain parts that propagation moves, rows, and JSON.

A noun is a frozen dataclass. Each of its numbers may carry leading axes (rows of a table, Monte Carlo draws), so
one method serves one photo and a million rows. A noun tells `propagate` what of it is uncertain through `parts()`,
and takes moved values back through `moved()`; nothing else in the package knows how the inside of a noun varies.
"""

from __future__ import annotations

import abc
import dataclasses
import json
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self, TypeVar

import numpy as np

from .arrays import Array
from .distribution import Distribution

One = TypeVar("One")


@dataclass(frozen=True)
class Part:
    """One block of uncertain numbers inside a noun, independent of the noun's other parts.

    Attributes:
        key: the noun's own name of the block.
        label: what a budget calls it ("focal length").
        source: where its uncertainty comes from.
        value: (k, ...) the numbers, component first, then the noun's leading axes.
        u: (k, ...) standard deviations of independent components; None where `cov` is given.
        cov: (k, k) or (k, k, ...) covariance; None where `u` is given.
        distributions: k laws; draws of a block with covariance are multivariate normal.
        dof: degrees of freedom of u.
    """

    key: str
    label: str
    source: str
    value: Array
    u: Array | None = None
    cov: Array | None = None
    distributions: tuple[Distribution, ...] = ()
    dof: float = float("inf")


class Noun(abc.ABC):
    """The common half of Quantity, Camera, Target and Observation.

    Class attributes:
        widget: the name of the form element a page shows for it.
        core: for each array field, its number of axes without leading ones.
    """

    widget: ClassVar[str] = "text"
    core: ClassVar[Mapping[str, int]] = {}

    @property
    def identity(self) -> Hashable:
        """What makes two nouns one thing to propagation: the given id, else the content."""
        return getattr(self, "id", None) or self.digest

    @property
    def digest(self) -> str:
        """Twelve hexadecimal digits of a hash of the noun's JSON."""
        import hashlib  # slow to import, and a calculator needs no digests

        text = json.dumps(self.to_json(), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    @abc.abstractmethod
    def parts(self) -> tuple[Part, ...]:
        """The uncertain blocks of this noun; exact numbers are not listed."""

    @abc.abstractmethod
    def moved(self, values: Mapping[str, Array]) -> Self:
        """The noun with the blocks in `values` (part key to (k, ...)) in place of its own."""

    @abc.abstractmethod
    def to_json(self) -> dict[str, Any]:
        """Plain Python data that `from_json` reads back."""

    @property
    def leading(self) -> tuple[int, ...]:
        """The leading axes that the noun's array fields share, by broadcasting."""
        shapes = []
        for name, axes in self.core.items():
            value = getattr(self, name)
            if value is not None:
                shape = np.shape(value)
                shapes.append(shape[: len(shape) - axes])
        return np.broadcast_shapes(*shapes)

    def rows(self, where: slice) -> Self:
        """The noun with the first leading axis cut to `where`; numbers without leading axes stay."""
        changes = {}
        for name, axes in self.core.items():
            value = getattr(self, name)
            if value is not None and np.ndim(value) > axes and np.shape(value)[0] > 1:
                # rows innermost in memory: what a method does with a column then runs along it
                columns = np.ascontiguousarray(np.moveaxis(value[where], 0, -1))
                changes[name] = np.moveaxis(columns, -1, 0)
        return self._with(**changes) if changes else self

    def _with(self, **changes: Any) -> Self:
        """A copy with fields replaced and the constructor's checks left out (draws may leave the allowed range)."""
        new = unchecked(self, **changes)
        new.__dict__.pop("digest", None)
        return new


def unchecked(one: One, **changes: Any) -> One:
    """A copy of a frozen dataclass with fields replaced, without its constructor; several times as fast."""
    new = object.__new__(type(one))
    new.__dict__.update(one.__dict__, **changes)
    return new


def plain(value: Any) -> Any:
    """NumPy numbers and arrays as Python ones, for JSON; anything else as it is."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    return value


def fields_of(inputs: Any) -> dict[str, Any]:
    """The fields of a dataclass, or the items of a mapping, in order."""
    if isinstance(inputs, Mapping):
        return dict(inputs)
    return {f.name: getattr(inputs, f.name) for f in dataclasses.fields(inputs)}
