"""The only place that calculates with sigma: budgets (GUM) and Monte Carlo (JCGM 101).

`measure` is what everything calls: it moves the inputs of a method by central differences, and draws where the
response bends so much that an interval end would be off by half a unit of the second significant digit of u
(JCGM 101, 8.2). `first_order` gives one scene or some rows; `rows` serves millions; `sample` and `monte_carlo` draw;
`joint` gives several outputs of several methods with their covariance, each shared noun moved once.
"""

from .differences import Propagated, first_order
from .draws import Draws, monte_carlo, sample
from .joint import joint, mean_of
from .measurement import measure
from .rows import rows

__all__ = ["Draws", "Propagated", "first_order", "joint", "mean_of", "measure", "monte_carlo", "rows", "sample"]
