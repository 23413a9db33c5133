"""Observation: what was seen, in pixels, with its doubt."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from .arrays import Array
from .assumptions import CLICK_SIGMA_PX
from .errors import InputError
from .noun import Noun, Part
from .quantity import Quantity


@dataclass(frozen=True, eq=False)
class Observation(Noun):
    """Points in a picture; point i of an Observation is point i of its Target.

    Attributes:
        points_px: (..., N, 2); (0, 0) is the centre of the top-left pixel of the upright picture.
        sigma_px: standard deviation per coordinate, one for all or (..., N); unused where `cov` is given.
        cov: (2N, 2N) covariance of (x1, y1, x2, y2, ...).
        label: which thing it is ("36h11 id 7").
        score: a detector's own confidence, 0 to 1.
        source: who saw it.
        id: given, or the digest of the content.
    """

    points_px: Array
    sigma_px: float | Array = CLICK_SIGMA_PX
    cov: Array | None = None
    label: str = ""
    score: float = 1.0
    source: str = "clicks"
    id: str | None = None

    widget: ClassVar[str] = "points"
    core: ClassVar[Mapping[str, int]] = {"points_px": 2, "sigma_px": 1}

    def __post_init__(self) -> None:
        points = np.asarray(self.points_px, float)
        if points.ndim < 2 or points.shape[-1] != 2 or not np.all(np.isfinite(points)):
            raise InputError("points_px", f"of shape {points.shape}", "give N x 2 finite pixel coordinates")
        object.__setattr__(self, "points_px", points)
        sigma = np.asarray(self.sigma_px, float)
        if not np.all(np.isfinite(sigma)) or np.any(sigma < 0):
            raise InputError("sigma_px", self.sigma_px, "give a standard deviation in pixels of 0 or above")
        if sigma.ndim and sigma.shape[-1] != points.shape[-2]:
            raise InputError(
                "sigma_px", f"of shape {sigma.shape}", f"give one, or one for each of {points.shape[-2]} points"
            )
        if self.cov is not None:
            cov, n = np.asarray(self.cov, float), 2 * points.shape[-2]
            if cov.shape != (n, n) or not np.all(np.isfinite(cov)):
                raise InputError("cov", f"of shape {cov.shape}", f"give {n} x {n} finite numbers in square pixels")
            object.__setattr__(self, "cov", cov)

    @classmethod
    def parse(cls, text: str, *, name: str = "points", count: int | None = None) -> Self:
        """Read `x1,y1;x2,y2[;...][ ± 0.5px]`; a comma between points is understood too."""
        head, _, tail = re.sub(r"\+/-|\+-", "±", text).partition("±")
        try:
            numbers = [float(word) for word in re.split(r"[\s,;]+", head.strip()) if word]
        except ValueError:
            numbers = []
        wanted = f"{count} points" if count else "points"
        if not numbers or len(numbers) % 2 or (count and len(numbers) != 2 * count) or not np.all(np.isfinite(numbers)):
            raise InputError(name, text, f"give {wanted} in pixels, as in '120,80;640,80 ± 0.5px'")
        points = np.array(numbers).reshape(-1, 2)
        if not tail:
            return cls(points, CLICK_SIGMA_PX, source=f"assumed: a clicked end is known to {CLICK_SIGMA_PX} px")
        doubt = Quantity.parse(f"0 ± {tail.strip()}", "px", name=name)
        return cls(points, float(doubt.u), source=doubt.source)

    @property
    def standard_deviations(self) -> Array:
        """(2N,) or (..., 2N) standard deviations of the coordinates."""
        if self.cov is not None:
            return np.asarray(np.sqrt(np.diag(self.cov)))
        sigma = np.asarray(self.sigma_px, float)
        if sigma.ndim == 0:
            return np.full(2 * self.points_px.shape[-2], float(sigma))
        return np.moveaxis(np.repeat(np.moveaxis(sigma, -1, 0), 2, axis=0), 0, -1)

    def parts(self) -> tuple[Part, ...]:
        flat = self.points_px.reshape(*self.points_px.shape[:-2], -1)
        value = np.moveaxis(flat, -1, 0)
        label = "pixel positions" + (f" of {self.label}" if self.label else "")
        if self.cov is not None and np.any(self.cov - np.diag(np.diag(self.cov))):
            return (Part("points", label, self.source, value, cov=self.cov),)
        u = np.moveaxis(self.standard_deviations, -1, 0)
        u = u.reshape(*u.shape, *(1,) * (value.ndim - u.ndim))
        return (Part("points", label, self.source, value, u),) if np.any(u) else ()

    def moved(self, values: Mapping[str, Array]) -> Self:
        flat = values["points"]
        paired = flat.reshape(-1, 2, *flat.shape[1:])
        return self._with(points_px=np.moveaxis(paired, (0, 1), (-2, -1)))

    def to_json(self) -> dict[str, Any]:
        data: dict[str, Any] = {
            "points_px": self.points_px.tolist(), "sigma_px": np.asarray(self.sigma_px).tolist(),
            "cov": None if self.cov is None else self.cov.tolist(), "label": self.label, "score": self.score,
            "source": self.source,
        }  # fmt: skip
        return {**data, "id": self.id} if self.id else data

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """The inverse of `to_json`."""
        sigma, cov = data.get("sigma_px", CLICK_SIGMA_PX), data.get("cov")
        return cls(
            np.asarray(data["points_px"], float), np.asarray(sigma, float) if isinstance(sigma, list) else float(sigma),
            None if cov is None else np.asarray(cov, float), str(data.get("label", "")), float(data.get("score", 1)),
            str(data.get("source", "")), data.get("id"),
        )  # fmt: skip
