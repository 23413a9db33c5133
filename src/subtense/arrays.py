"""The kinds of arrays in annotations. `numpy.typing` is slow to import, and only a type checker needs it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt

    Array = npt.NDArray[np.float64]
    Bools = npt.NDArray[np.bool_]
    Codes = npt.NDArray[np.int8]
    Indices = npt.NDArray[np.intp]
    Pixels = npt.NDArray[np.uint8]
else:
    Array = Bools = Codes = Indices = Pixels = np.ndarray

__all__ = ["Array", "Bools", "Codes", "Indices", "Pixels"]
