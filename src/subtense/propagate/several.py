"""Several measurements of one scene, each shared noun moved once; and the mean of repeated readings."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Array, Codes
from ..errors import InputError
from ..method import Method, Output
from ..quantity import Measurement, Note, Quantity
from ..space import Space
from .differences import Propagated, scene
from .draws import Draws, sample_space
from .measurement import Told, check_level, measure_model, one_scene
from .model import Model, model_of

Pairs = Sequence[tuple[Method, Any]]


@dataclass(frozen=True)
class Combination:
    """What is calculated from the answers of several methods.

    Attributes:
        name: stands as the method of the measurement.
        outputs: the numbers it gives, headline first.
        function: from the answers, one array each, to the outputs (o, ...): of `places` (..., 3) m, else (outputs, ...).
        of_places: whether it takes where the methods place what they range, in the camera's frame, or their outputs.
    """

    name: str
    outputs: tuple[Output, ...]
    function: Callable[[Sequence[Array]], Array]
    of_places: bool = False


def joint(pairs: Pairs, *, draws: int = 100_000, seed: int = 0) -> tuple[Propagated, Draws]:
    """Several measurements of one scene, each shared noun moved once.

    Returns:
        The first-order result, whose `cov` is the covariance of all outputs of all methods in order, and joint draws.
    """
    space = Space([inputs for _, inputs in pairs])
    models = [model_of(method, inputs) for method, inputs in pairs]

    def call(moved: tuple[Any, ...]) -> tuple[Array, Codes]:
        answers, worst = _answers([model.call((one,)) for model, one in zip(models, moved, strict=True)])
        return np.concatenate(answers), worst

    names = tuple(f"{i}.{name}" for i, model in enumerate(models, 1) for name in model.names)
    model = Model(names, call)
    return scene(model, space, 0.95), sample_space(model, space, draws, np.random.default_rng(seed))


def _answers(results: Sequence[tuple[Array, Codes]]) -> tuple[list[Array], Codes]:
    """The answers brought to one shape, and the worst reason of each scene."""
    shape = np.broadcast_shapes(*(reason.shape for _, reason in results))
    values = [np.broadcast_to(v, (len(v), *shape)) for v, _ in results]
    return values, np.max(np.stack([np.broadcast_to(reason, shape) for _, reason in results]), axis=0)


def prepared(pairs: Pairs) -> list[tuple[Method, Any]]:
    """The pairs with what their inputs leave open settled, so that all that is moved is the same noun in both."""
    return [(method, method.prepare(inputs)) for method, inputs in pairs]


def combined_model(pairs: Pairs, combination: Combination) -> Model:
    """The model of a combination of methods at prepared inputs."""
    models = [_places(*pair) if combination.of_places else model_of(*pair) for pair in pairs]

    def call(moved: tuple[Any, ...]) -> tuple[Array, Codes]:
        answers, worst = _answers([model.call((one,)) for model, one in zip(models, moved, strict=True)])
        return combination.function(answers), worst

    return Model(tuple(output.name for output in combination.outputs), call)


def _places(method: Method, inputs: Any) -> Model:
    """Where a method places what it ranges, (3, ...) m."""
    if method.place is None:
        raise InputError("method", method.name, "it gives no place in the camera's frame")
    start = (method.start(inputs),) if method.start else ()
    place = method.place

    def call(moved: tuple[Any, ...]) -> tuple[Array, Codes]:
        reason = np.asarray(method.function(moved[0], *start).reason)
        there = np.moveaxis(np.broadcast_to(place(moved[0], *start), (*reason.shape, 3)), -1, 0)
        return np.where(reason == 0, there, np.nan), reason

    return Model(("x", "y", "z"), call)


def measure_together(
    pairs: Pairs, combination: Combination, *, level: float = 0.95, seed: int = 0, draws: int | None = None, label: str = "",
    given: Mapping[str, Any] | None = None, notes: Callable[[], tuple[Note, ...]] = lambda: (),
) -> tuple[Measurement, ...]:  # fmt: skip
    """What is calculated from several measurements of one scene, each shared noun moved once.

    Args:
        pairs: methods and their Inputs, which share nouns (the camera, a reference) by identity.
        combination: of their answers.
        level: coverage of the intervals.
        seed: of the draws, where they are needed.
        draws: how many; None for as many as the adaptive procedure wants.
        label: what is measured.
        given: what to keep with each measurement.
        notes: makes the doubts, once there is an answer.

    Raises:
        GeometryError: this view has no finite answer.
        InputError: a method that gives no place where places are wanted.
    """
    check_level(level)
    ready = prepared(pairs)
    space = one_scene([inputs for _, inputs in ready])
    told = Told(combination.name, level, label, given or {}, notes)
    return measure_model(combined_model(ready, combination), space, combination.outputs, told, seed=seed, draws=draws)


def sample_together(pairs: Pairs, combination: Combination, draws: int, *, seed: int = 0) -> Draws:
    """A fixed number of draws of a combination."""
    ready = prepared(pairs)
    space = Space([inputs for _, inputs in ready])
    return sample_space(combined_model(ready, combination), space, draws, np.random.default_rng(seed))


def mean_of(readings: Sequence[float], unit: str = "1", source: str = "mean of readings") -> Quantity:
    """The mean of repeated readings as a t-distributed quantity (GUM 4.2)."""
    values = np.asarray(readings, float)
    if values.size < 2:
        raise InputError("readings", f"{values.size} of them", "give two or more, or one value with its ±")
    u = float(np.std(values, ddof=1) / math.sqrt(values.size))
    return Quantity.student_t(float(values.mean()), u, values.size - 1, unit, source)
