"""The distance between two things that were placed in one camera's frame, whatever method placed each."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from .. import unresolved
from ..arrays import Array
from ..errors import InputError
from ..method import Method, Output
from ..propagate import Combination, measure_together, sample_together
from ..quantity import Measurement, Note
from .given import given

DRAWS = 50_000
"""Of the difference of two places, where its length is near its noise."""


def _apart(places: Sequence[Array]) -> Array:
    step = np.asarray(places[1]) - np.asarray(places[0])
    return np.stack([np.sqrt(np.sum(step * step, axis=0)), step[2]])


BETWEEN = Combination(
    "between",
    (Output("length_m", "length", "m", "length"),
     Output("depth_difference_m", "depth_difference", "m", "how much deeper the second is", nonnegative=False)),
    _apart, of_places=True,
)  # fmt: skip
_STEP = Combination(
    "between", tuple(Output(axis, axis, "m", axis, nonnegative=False) for axis in "xyz"),
    lambda places: np.asarray(places[1]) - np.asarray(places[0]), of_places=True,
)  # fmt: skip


def between(
    first: tuple[Method, Any], second: tuple[Method, Any], *, level: float = 0.95, seed: int = 0, draws: int | None = None,
    label: str = "",
) -> tuple[Measurement, ...]:  # fmt: skip
    """The straight distance between what two methods placed, and how much deeper the second is.

    Args:
        first: a method that places what it ranges, and its Inputs.
        second: likewise; nouns that are the same in both (the camera, a reference) are moved together.
        level: coverage of the intervals.
        seed: of the draws.
        draws: how many, where they are needed; None for DRAWS.
        label: what is measured.

    Returns:
        Length (note `length_not_resolved` where it is less than 5 of its u) and difference of depth, m.

    Raises:
        InputError: a method that gives no place, or two cameras.
        GeometryError: one of both has no finite answer.
    """
    pairs = _one_lens(first, second)
    kept = {name: {"method": method.name, "given": given(inputs)} for name, (method, inputs) in zip(("first", "second"), pairs,
                                                                                                    strict=True)}  # fmt: skip
    length, deeper = measure_together(
        pairs,
        BETWEEN,
        level=level,
        seed=seed,
        draws=draws or DRAWS,
        label=label,
        given=kept,
        notes=lambda: _doubts(pairs),
    )
    drawn = sample_together(pairs, _STEP, draws or DRAWS, seed=seed).values
    answered = drawn[:, np.isfinite(drawn).all(axis=0)]
    nominal = _step_of(pairs)
    if answered.shape[1] < 0.99 * drawn.shape[1] or length.value >= unresolved.RESOLVED * unresolved.largest_sigma(
        answered
    ):
        return length, deeper
    low, high = unresolved.interval(nominal, nominal[:, None] - answered, level)
    how = f"law of the observed length inverted, {drawn.shape[1]} draws"
    return _inverted(dataclasses.replace(length, evaluation=how), low, high, level), deeper


def _inverted(length: Measurement, low: float, high: float, level: float) -> Measurement:
    """The length with an interval from the law of the observed length."""
    from ..distribution import normal_quantile

    # noise makes lengths longer: what was observed may lie above all that is likely, and the interval holds it still
    high = max(high, length.value)
    u = (high - low) / (2 * normal_quantile(0.5 + level / 2))
    notes = length.notes
    if length.value < unresolved.RESOLVED * u:
        text = (f"the two are less than {unresolved.RESOLVED:g} u apart; noise makes so small a distance longer, and its "
                "interval allows for it")  # fmt: skip
        cure = "place both more closely, or measure the length between them by one method, as in a plane"
        notes = (*notes, Note("length_not_resolved", text, cure))
    return dataclasses.replace(length, low=min(low, length.value), high=high, u=u, notes=notes)


def _step_of(pairs: Sequence[tuple[Method, Any]]) -> Array:
    """(3,) from the nominal first place to the second."""
    places = []
    for method, inputs in pairs:
        ready = method.prepare(inputs)
        assert method.place is not None
        places.append(np.asarray(method.place(ready, *((method.start(ready),) if method.start else ())), float))
    return np.asarray(places[1] - places[0])


def _one_lens(first: tuple[Method, Any], second: tuple[Method, Any]) -> list[tuple[Method, Any]]:
    """Both with one camera, and one focus where both leave it to be assumed."""
    cameras: list[Any] = [getattr(inputs, "camera", None) for _, inputs in (first, second)]
    for (method, _), camera in zip((first, second), cameras, strict=True):
        if method.place is None or camera is None:
            raise InputError("between", method.name, "it gives no place in the camera's frame; use known_size, pose, circle, sphere, "
                             "ground_plane, plane_distance, same_plane_distance, surveyed_ground")  # fmt: skip
    if cameras[0].identity != cameras[1].identity:
        raise InputError(
            "between", "two cameras", "measure both in one picture; for two pictures use stereo or triangulation"
        )
    focus: list[Any] = [getattr(inputs, "focus", None) for _, inputs in (first, second)]
    if None not in focus and focus[0].source == focus[1].source:  # one picture has one focus
        second = (second[0], dataclasses.replace(second[1], focus=focus[0]))
    return [first, second]


def _doubts(pairs: Sequence[tuple[Method, Any]]) -> tuple[Note, ...]:
    """What is doubted of either place, once."""
    found: list[Note] = []
    for method, inputs in pairs:
        ready = method.prepare(inputs)
        result = method.function(ready, *((method.start(ready),) if method.start else ()))
        found += method.notes(ready, result)
    return tuple(dict.fromkeys(found))
