"""Millions of rows: first order, chunk by chunk and on all cores, by a method's own derivative where it has one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..arrays import Array
from ..distribution import normal_quantile
from ..errors import InputError
from ..method import Method, Partials
from ..space import Line, Space, map_nouns
from .differences import Propagated, rows_by_differences
from .model import model_of

CHUNK = 65_536
"""Rows evaluated at once: smaller ones fit the caches better, but hand the interpreter's lock over too often."""


def rows(
    method: Method, inputs: Any, *, level: float = 0.95, chunk: int = CHUNK, threads: int | None = None
) -> Propagated:
    """`first_order` for nouns with one long leading axis, chunk by chunk and on all cores.

    Where the method gives its own derivative for these inputs, it is used in place of differences; `bend` is then NaN.
    """
    inputs = _pinned(method.prepare(inputs))
    leading = Space((inputs,)).leading
    if len(leading) != 1:
        raise InputError("inputs", f"with leading axes {leading}", "give one leading axis, the rows")
    n = leading[0]
    cuts = [slice(a, min(a + chunk, n)) for a in range(0, n, chunk)] or [slice(0, 0)]
    first = _rows_of(method, map_nouns(inputs, lambda noun: noun.rows(cuts[0])), level)
    whole = {name: _room(getattr(first, name), n) for name in _ARRAYS}

    def work(cut: slice) -> None:
        part = first if cut is cuts[0] else _rows_of(method, map_nouns(inputs, lambda noun: noun.rows(cut)), level)
        for name, array in whole.items():
            if array.flags.writeable:
                array[..., cut] = getattr(part, name)

    from concurrent.futures import ThreadPoolExecutor  # slow to import, and rarely needed

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, cuts))
    return Propagated(first.names, first.lines, **whole, cov=None, u_second_order=None)


_ARRAYS = ("value", "u", "coverage", "dof", "contributions", "bend", "reason")


def _room(part: Any, n: int) -> Any:
    """An array like a chunk's, for n rows; one number spread over all rows stays one number."""
    if part.strides[-1] == 0 and part.shape[-1] > 1:
        return np.broadcast_to(part[..., :1], (*part.shape[:-1], n))
    return np.empty((*part.shape[:-1], n), part.dtype)


def _pinned(inputs: Any) -> Any:
    """The same inputs with an id in every noun: cut into chunks, one noun in two fields must stay one."""
    ids: dict[Any, str] = {}

    def pin(noun: Any) -> Any:
        return noun if noun.id else noun._with(id=ids.setdefault(id(noun), f"noun {len(ids)}"))

    return map_nouns(inputs, pin)


def _rows_of(method: Method, inputs: Any, level: float) -> Propagated:
    space = Space((inputs,))
    if method.derivative is not None and all(math.isinf(line.dof) for line in space.lines):
        result = method.function(inputs)
        partials = method.derivative(inputs, result)
        if partials is not None:
            return _rows_by_derivative(method, space, result, partials, level)
    return rows_by_differences(model_of(method, inputs), space, level)


def _rows_by_derivative(
    method: Method, space: Space, result: Any, partials: Mapping[str, Mapping[tuple[str, str], Partials]], level: float
) -> Propagated:
    """Rows whose method told its own partial derivatives."""
    reason = np.asarray(result.reason)
    names = tuple(output.name for output in method.outputs)
    value = np.empty((len(names), *reason.shape))
    for row, name in zip(value, names, strict=True):
        row[...] = getattr(result, name)
    if reason.any():
        value[:, reason != 0] = np.nan
    fields = {noun.identity: name for name, noun in _fields(space.inputs[0])}
    contributions, variance = np.empty((len(space.lines), *value.shape)), np.zeros_like(value)
    for row, line in enumerate(space.lines):
        identity, key, _ = line.members[0]
        for o, name in enumerate(names):
            _add_effect(line, partials[name][fields[identity], key], contributions[row, o], variance[o])
    u = np.sqrt(variance, out=variance)
    k, dof, bend = (np.broadcast_to(x, value.shape) for x in (normal_quantile(0.5 + level / 2), np.inf, np.nan))
    return Propagated(names, tuple(line.name for line in space.lines), value, u, k, dof,
                      contributions, None, None, bend, reason)  # fmt: skip


def _fields(inputs: Any) -> list[tuple[str, Any]]:
    return [(name, value) for name, value in vars(inputs).items() if hasattr(value, "identity")]


def _add_effect(line: Line, partial: Partials, out: Array, variance: Array) -> None:
    """Write a line's contribution into `out` and add its square to `variance`."""
    if line.factor is not None:
        lead = np.broadcast_shapes(*(p.shape for p in partial))
        stacked = np.stack([np.broadcast_to(p, lead) for p in partial])
        effects = list(np.tensordot(line.factor, stacked, axes=(0, 0)))
    else:
        assert line.u is not None
        effects = [p * u for p, u in zip(partial, line.u, strict=True)]
    if len(effects) == 1:
        out[...] = effects[0]
        variance += np.square(effects[0])
        return
    out[...] = 0.0
    for effect in effects:
        out += np.square(effect)
    variance += out
    np.sqrt(out, out=out)
