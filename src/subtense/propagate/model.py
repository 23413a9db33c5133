"""A function with named outputs, whatever it was made of: a Method, or a plain function of quantities."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Array, Codes
from ..method import Method
from ..space import Moved, Space

Function = Callable[..., Any]


@dataclass(frozen=True)
class Model:
    """A function with named outputs, of one or several inputs."""

    names: tuple[str, ...]
    call: Callable[[tuple[Any, ...]], tuple[Array, Codes]]
    most_draws: int = 1_000_000


def model_of(method: Method | Function, inputs: Any) -> Model:
    """The model of a method at these inputs, or of a plain function of arrays named like the quantities in `inputs`.

    A plain function returns one array, or a mapping of named ones; a row without an answer is NaN.
    """
    if isinstance(method, Method):
        return method_model(method, inputs)

    def call(moved: tuple[Any, ...]) -> tuple[Array, Codes]:
        result = method(**{name: q.value for name, q in moved[0].items()})
        named = result if isinstance(result, Mapping) else {"result": result}
        values = np.stack(np.broadcast_arrays(*(np.asarray(v, float) for v in named.values())))
        return values, np.zeros(values.shape[1:], np.int8)

    first = method(**{name: q.value for name, q in inputs.items()})
    return Model(tuple(first) if isinstance(first, Mapping) else ("result",), call)


def method_model(method: Method, inputs: Any) -> Model:
    """The model of a method, with the nominal solution of these inputs where it needs one."""
    start = (method.start(inputs),) if method.start else ()
    names = tuple(output.name for output in method.outputs)

    def call(moved: tuple[Any, ...]) -> tuple[Array, Codes]:
        result = method.function(moved[0], *start)
        reason = np.asarray(result.reason)
        values = np.empty((len(names), *reason.shape))
        for row, name in zip(values, names, strict=True) if reason.shape else ():
            row[...] = getattr(result, name)
        if not reason.shape:
            values[...] = [float(getattr(result, name)) for name in names]
        if reason.any():
            values[:, reason != 0] = np.nan
        return values, reason

    return Model(names, call, method.most_draws)


def evaluate_at(model: Model, space: Space, z: Array) -> tuple[Array, Codes]:
    """Outputs (o, n) of one scene at standardised deviations z (m, n)."""
    moved: Moved = {}
    first = 0
    for line in space.lines:
        line.put(line.at(z[first : first + line.count]), moved)
        first += line.count
    return evaluate(model, space, moved, z.shape[1])


def evaluate(model: Model, space: Space, moved: Moved, n: int) -> tuple[Array, Codes]:
    """Outputs (o, n) of one scene with moved numbers; what no moved number enters is the same n times."""
    values, reason = model.call(space.rebuilt(moved))
    if values.ndim == 1:
        values, reason = values[:, None], np.asarray(reason)[None]
    return np.broadcast_to(values, (len(values), n)), np.broadcast_to(reason, (n,))
