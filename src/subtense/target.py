"""Target: known points of a thing, in metres."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from .arrays import Array
from .distribution import NORMAL, Distribution
from .errors import InputError
from .noun import Noun, Part
from .quantity import Assume, Quantity


@dataclass(frozen=True, eq=False)
class Target(Noun):
    """Points whose places on a thing are known: the corners of a marker, a card, a sheet.

    Attributes:
        name: what it is.
        points_m: (N, 3) or (..., N, 3), in the thing's own frame.
        u_scale: relative standard deviation of its size, common to all points (print scale, tape, spread of a kind).
        scale_distribution: the law of the size.
        sigma_m: standard deviation of each coordinate on its own; 0 for a rigid, exact shape.
        source: where the size comes from.
        id: given, or the digest of the content.
    """

    name: str
    points_m: Array
    u_scale: float = 0.0
    sigma_m: float = 0.0
    scale_distribution: Distribution = NORMAL
    source: str = "stated"
    id: str | None = None

    widget: ClassVar[str] = "target"
    core: ClassVar[Mapping[str, int]] = {"points_m": 2}

    def __post_init__(self) -> None:
        points = np.asarray(self.points_m, float)
        if points.ndim < 2 or points.shape[-1] != 3 or not np.all(np.isfinite(points)):
            raise InputError("points_m", f"of shape {points.shape}", "give N x 3 finite numbers in metres")
        for name in ("u_scale", "sigma_m"):
            if not 0 <= getattr(self, name) < np.inf:
                raise InputError(name, getattr(self, name), "give a standard deviation of 0 or above")
        object.__setattr__(self, "points_m", points)

    @classmethod
    def square(cls, side: Quantity, name: str) -> Self:
        """A flat square: corners top-left, top-right, bottom-right, bottom-left; x right, y down, z into the face."""
        half = float(side.value) / 2
        if not half > 0:
            raise InputError("size", float(side.value), "give a length above 0")
        corners = half * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]])
        return cls(name, corners, float(side.u) / float(side.value), scale_distribution=side.distribution,
                   source=side.source)  # fmt: skip

    @classmethod
    def rectangle(cls, width: Quantity, height: Quantity, name: str) -> Self:
        """A flat rectangle, corners as in `square`; its size is doubtful as a whole, by the larger relative u."""
        w, h = float(width.value), float(height.value)
        if not (w > 0 and h > 0):
            raise InputError("size", f"{w} x {h}", "give lengths above 0")
        corners = np.array([[-w, -h, 0], [w, -h, 0], [w, h, 0], [-w, h, 0.0]]) / 2
        return cls(name, corners, max(float(width.u) / w, float(height.u) / h), source=width.source)

    @classmethod
    def plane(cls, text: str, *, name: str = "target", assume: Assume | None = None) -> Self:
        """Points of a plane, z = 0: `0,0;2.5,0;2.5,1;0,1 m ± 5 mm`, the ± of each coordinate (without one, of the whole size)."""
        example = "write the places as 'plane 0,0;2.5,0;2.5,1.2;0,1.2 m ± 5 mm'"
        head, _, tail = re.sub(r"\+/-|\+-", "±", text).partition("±")
        words = re.fullmatch(r"([-+0-9.eE,;\s]+?)\s*([A-Za-zµ\"']*)\s*", head)
        try:
            places = [[float(x) for x in pair.split(",")] for pair in words.group(1).split(";")] if words else []
        except ValueError:
            places = []
        if words is None or len(places) < 4 or any(len(pair) != 2 for pair in places) or not words.group(2):
            raise InputError(name, text, example)
        unit = float(Quantity.parse(f"1 {words.group(2)} exact", "m", name=name).value)
        points = np.column_stack([unit * np.array(places), np.zeros(len(places))])
        if tail:
            doubt = Quantity.parse(f"0 {words.group(2)} ± {tail.strip()}", "m", name=name)
            return cls("reference points", points, sigma_m=float(doubt.u), source=doubt.source)
        if assume is None:
            raise InputError(name, text, "say how well the places are known: 'plane 0,0;2.5,0;2.5,1.2;0,1.2 m ± 5 mm'")
        whole = assume(1.0, 0.0)
        return cls("reference points", points, float(whole.u), source=whole.source)

    @classmethod
    def parse(cls, text: str, *, name: str = "target", assume: Assume | None = None) -> Self:
        """Read `square 50 ± 0.2 mm`, `rectangle 297 ± 1 mm x 210 ± 1 mm`, or `plane` and places; `assume` is of a side without ±."""
        shape, _, size = text.strip().partition(" ")
        if shape == "plane":
            return cls.plane(size, name=name, assume=assume)
        sides = [Quantity.parse(s, "m", bare="mm", name=name, assume=assume) for s in size.split(" x ")] if size else []
        if shape == "square" and len(sides) == 1:
            return cls.square(sides[0], "square")
        if shape == "rectangle" and len(sides) == 2:
            return cls.rectangle(sides[0], sides[1], "rectangle")
        raise InputError(
            name,
            text,
            "write 'square 50 ± 0.2 mm' or 'rectangle 297 ± 1 mm x 210 ± 1 mm', 'plane 0,0;...', or @file.json",
        )

    def parts(self) -> tuple[Part, ...]:
        parts = []
        if self.u_scale:
            parts.append(Part("scale", f"size of the {self.name}", self.source, np.ones(1),
                              np.array([self.u_scale]), distributions=(self.scale_distribution,)))  # fmt: skip
        if self.sigma_m:
            flat = self.points_m.reshape(*self.points_m.shape[:-2], -1)
            value = np.moveaxis(flat, -1, 0)
            u = np.full((len(value), *(1,) * (value.ndim - 1)), self.sigma_m)
            parts.append(Part("points", f"shape of the {self.name}", self.source, value, u))
        return tuple(parts)

    def moved(self, values: Mapping[str, Array]) -> Self:
        points = self.points_m
        if "points" in values:
            flat = np.moveaxis(values["points"], 0, -1)
            points = flat.reshape(*flat.shape[:-1], -1, 3)
        if "scale" in values:
            points = points * values["scale"][0][..., None, None]
        return self._with(points_m=points)

    def to_json(self) -> dict[str, Any]:
        data = {
            "name": self.name, "points_m": self.points_m.tolist(), "u_scale": self.u_scale, "sigma_m": self.sigma_m,
            "scale_distribution": self.scale_distribution.to_json(), "source": self.source,
        }  # fmt: skip
        return {**data, "id": self.id} if self.id else data

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """The inverse of `to_json`."""
        law = Distribution.from_json(data.get("scale_distribution", "normal"))
        return cls(str(data["name"]), np.asarray(data["points_m"], float), float(data.get("u_scale", 0)),
                   float(data.get("sigma_m", 0)), law, str(data.get("source", "")), data.get("id"))  # fmt: skip
