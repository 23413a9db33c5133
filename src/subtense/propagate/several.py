"""Several measurements of one scene, each shared noun moved once; and the mean of repeated readings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..arrays import Array, Codes
from ..errors import InputError
from ..method import Method
from ..quantity import Quantity
from ..space import Space
from .differences import Propagated, scene
from .draws import Draws, sample_space
from .model import Model, model_of


def joint(pairs: Sequence[tuple[Method, Any]], *, draws: int = 100_000, seed: int = 0) -> tuple[Propagated, Draws]:
    """Several measurements of one scene, each shared noun moved once.

    Returns:
        The first-order result, whose `cov` is the covariance of all outputs of all methods in order, and joint draws.
    """
    space = Space([inputs for _, inputs in pairs])
    models = [model_of(method, inputs) for method, inputs in pairs]

    def call(moved: tuple[Any, ...]) -> tuple[Array, Codes]:
        results = [model.call((one,)) for model, one in zip(models, moved, strict=True)]
        shape = np.broadcast_shapes(*(reason.shape for _, reason in results))
        values = np.concatenate([np.broadcast_to(v, (len(v), *shape)) for v, _ in results])
        worst = np.max(np.stack([np.broadcast_to(reason, shape) for _, reason in results]), axis=0)
        return values, worst

    names = tuple(f"{i}.{name}" for i, model in enumerate(models, 1) for name in model.names)
    model = Model(names, call)
    return scene(model, space, 0.95), sample_space(model, space, draws, np.random.default_rng(seed))


def mean_of(readings: Sequence[float], unit: str = "1", source: str = "mean of readings") -> Quantity:
    """The mean of repeated readings as a t-distributed quantity (GUM 4.2)."""
    values = np.asarray(readings, float)
    if values.size < 2:
        raise InputError("readings", f"{values.size} of them", "give two or more, or one value with its ±")
    u = float(np.std(values, ddof=1) / math.sqrt(values.size))
    return Quantity.student_t(float(values.mean()), u, values.size - 1, unit, source)
