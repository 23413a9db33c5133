"""Millions of rows: first order, chunk by chunk and on all cores, by a method's own derivative where it has one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..distribution import Array, normal_quantile
from ..errors import InputError
from ..method import Method
from ..space import Line, Space, map_nouns
from .differences import Propagated, rows_by_differences
from .model import model_of

CHUNK = 16384
"""Rows evaluated at once: small enough for the caches of one core."""


def rows(
    method: Method, inputs: Any, *, level: float = 0.95, chunk: int = CHUNK, threads: int | None = None
) -> Propagated:
    """`first_order` for nouns with one long leading axis, chunk by chunk and on all cores.

    Where the method gives its own derivative for these inputs, it is used in place of differences; `bend` is then NaN.
    """
    leading = Space((inputs,)).leading
    if len(leading) != 1:
        raise InputError("inputs", f"with leading axes {leading}", "give one leading axis, the rows")
    n = leading[0]
    cuts = [slice(a, min(a + chunk, n)) for a in range(0, n, chunk)]
    first = _rows_of(method, map_nouns(inputs, lambda noun: noun.rows(cuts[0])), level)
    kept = {
        name: getattr(first, name) for name in ("value", "u", "low", "high", "dof", "contributions", "bend", "reason")
    }
    whole: dict[str, Any] = {name: np.empty((*a.shape[:-1], n), a.dtype) for name, a in kept.items()}

    from concurrent.futures import ThreadPoolExecutor  # slow to import, and rarely needed

    def work(cut: slice) -> None:
        part = _rows_of(method, map_nouns(inputs, lambda noun: noun.rows(cut)), level)
        for name, array in whole.items():
            array[..., cut] = getattr(part, name)

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, cuts))
    return Propagated(first.names, first.lines, **whole, cov=None, u_second_order=None)


def _rows_of(method: Method, inputs: Any, level: float) -> Propagated:
    space = Space((inputs,))
    if method.derivative is not None and all(math.isinf(line.dof) for line in space.lines):
        result = method.function(inputs)
        partials = method.derivative(inputs, result)
        if partials is not None:
            return _rows_by_derivative(method, space, result, partials, level)
    return rows_by_differences(model_of(method, inputs), space, level)


def _rows_by_derivative(
    method: Method, space: Space, result: Any, partials: Mapping[str, Mapping[tuple[str, str], Array]], level: float
) -> Propagated:
    """Rows whose method told its own partial derivatives."""
    reason = np.asarray(result.reason)
    names = tuple(output.name for output in method.outputs)
    value = np.stack([np.where(reason == 0, getattr(result, n), np.nan) for n in names])
    fields = {noun.identity: name for name, noun in _fields(space.inputs[0])}
    contributions = np.empty((len(space.lines), *value.shape))
    for row, line in enumerate(space.lines):
        identity, key, _ = line.members[0]
        for o, name in enumerate(names):
            contributions[row, o] = _line_effect(line, partials[name][fields[identity], key])
    u = np.sqrt(np.sum(contributions**2, axis=0))
    k = normal_quantile(0.5 + level / 2)
    dof = np.broadcast_to(np.inf, value.shape)
    return Propagated(names, tuple(line.name for line in space.lines), value, u, value - k * u, value + k * u, dof,
                      contributions, None, None, np.broadcast_to(np.nan, value.shape), reason)  # fmt: skip


def _fields(inputs: Any) -> list[tuple[str, Any]]:
    return [(name, value) for name, value in vars(inputs).items() if hasattr(value, "identity")]


def _line_effect(line: Line, partial: Array) -> Array:
    """Contribution of one line: partial derivatives (k, ...) through its factor or its u."""
    if line.factor is not None:
        effect = np.tensordot(line.factor, partial, axes=(0, 0))
    else:
        assert line.u is not None
        effect = partial * line.u.reshape(*line.u.shape, *(1,) * (partial.ndim - line.u.ndim))
    return np.asarray(effect[0] if len(effect) == 1 else np.sqrt(np.einsum("i...,i...->...", effect, effect)))
