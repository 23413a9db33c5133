"""Which methods can answer with what is known, and what the others miss."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass

from ..errors import InputError
from ..method import Method
from .tables import METHODS


@dataclass(frozen=True)
class Applicable:
    """A method, and what it needs beside what is known.

    Attributes:
        method: of METHODS.
        used: the facts that it takes.
        missing: inputs that it needs and that are not known; alternatives are joined by " or ".
    """

    method: Method
    used: tuple[str, ...]
    missing: tuple[str, ...]

    @property
    def answers(self) -> bool:
        """Whether it needs nothing more."""
        return not self.missing


def applicable(facts: Iterable[str], what: str | None = None) -> tuple[Applicable, ...]:
    """The methods that take any of the facts, those that can answer first, then by how little they miss.

    Args:
        facts: names of inputs that are known: camera, ends, size, foot, height, pitch, reference, ...; none for all methods.
        what: only methods that measure this: range, length, height, ...

    Raises:
        InputError: a fact that no method takes, or something that none measures.
    """
    known = list(dict.fromkeys(fact.strip().lower().replace("-", "_") for fact in facts))
    fields = {name for method in METHODS.values() for name in _names(method)}
    for fact in known:
        if fact not in fields:
            raise InputError("fact", fact, f"known are {', '.join(sorted(fields))}")
    measured = {output.what for method in METHODS.values() for output in method.outputs}
    if what is not None and what not in measured:
        raise InputError("--what", what, f"known are {', '.join(sorted(measured))}")
    found = [
        _fitted(method, known)
        for method in METHODS.values()
        if what is None or any(output.what == what for output in method.outputs)
    ]
    return tuple(
        sorted((one for one in found if one.used or not known), key=lambda one: (len(one.missing), -len(one.used)))
    )


def _names(method: Method) -> list[str]:
    return [field.name for field in dataclasses.fields(method.inputs)]


def _fitted(method: Method, known: list[str]) -> Applicable:
    needed: list[tuple[str, ...]] = [
        (field.name,)
        for field in dataclasses.fields(method.inputs)
        if field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
    ]
    needed += list(getattr(method.inputs, "one_of", ()))
    missing = tuple(" or ".join(names) for names in needed if not set(names) & set(known))
    return Applicable(method, tuple(name for name in known if name in _names(method)), missing)
