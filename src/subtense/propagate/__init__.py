"""The only place that calculates with sigma: budgets (GUM) and Monte Carlo (JCGM 101).

`measure` is what everything calls: it moves the inputs of a method by central differences, and draws where the
response bends so much that an interval end would be off by half a unit of the second significant digit of u
(JCGM 101, 8.2). `first_order` gives one scene or some rows; `rows` serves millions; `sample` and `monte_carlo` draw;
`joint` gives several outputs of several methods with their covariance, each shared noun moved once, and
`measure_together` what is calculated from them.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from .differences import Propagated, first_order
from .measurement import DrawsNeeded, measure

if TYPE_CHECKING:
    from .draws import Draws as Draws
    from .draws import monte_carlo as monte_carlo
    from .draws import sample as sample
    from .many import rows as rows
    from .several import Combination as Combination
    from .several import joint as joint
    from .several import mean_of as mean_of
    from .several import measure_together as measure_together
    from .several import sample_together as sample_together

_HOME = {
    "Draws": "draws",
    "monte_carlo": "draws",
    "sample": "draws",
    "Combination": "several",
    "joint": "several",
    "mean_of": "several",
    "measure_together": "several",
    "sample_together": "several",
    "rows": "many",
}

__all__ = [
    "Combination",
    "Draws",
    "DrawsNeeded",
    "Propagated",
    "first_order",
    "joint",
    "mean_of",
    "measure",
    "measure_together",
    "monte_carlo",
    "rows",
    "sample",
    "sample_together",
]


def __getattr__(name: str) -> Any:
    """Load what a single measurement does not need when it is asked for."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = found
    return found
