"""The table of depth networks that are known: what each takes and gives, its licence, and its published error.

The package has no weights and fetches none; a row says which command does. How far off a network is follows from shares of
pixels within a factor of 1.25 as they were published: where errors are normal in the logarithm, a share d of pixels within
it means a standard deviation of ln 1.25 / z((1 + d) / 2). Over several data sets the root mean square is taken, which is the
deviation of a picture that may be of any of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from .distribution import normal_quantile
from .errors import InputError

KINDS = ("metric", "scaled", "affine", "disparity")
"""What the numbers of a map are: depth in metres; up to a factor; up to a factor and a shift; its inverse up to both."""
TAKES = ("imagenet", "imagenet_inside", "half", "unit")
"""How pixels are normalised."""
ASSUMED_LOCAL = 0.11
"""u of single depths once scale and shift are fitted, where a row tells none: that of Depth Anything V2, of which it is known."""
ASSUMED_FACTOR = 0.35
"""u of the common factor where a row tells none: that of Metric3D v2 and Depth Pro in the comparison of six by the latter."""


@dataclass(frozen=True)
class DepthModel:
    """One row.

    Attributes:
        name: as on the command line.
        title: as people call it.
        gives: of KINDS, or "points".
        focal: "canonical", "trained", "told" or "none": how its metres hang on a focal length.
        takes: of TAKES.
        runs: "onnx", "transformers" or "export".
        repository: where its authors publish it.
        licence: of the weights.
        megabytes: of the weights.
        source: who published it.
        file: in the repository; empty for all of it.
        focal_px: of the canonical camera.
        focal_per_side: of the training pictures, in short sides.
        side_px: short side of its input.
        multiple_px: of which the sides of its input are multiples.
        size_px: height and width where it wants one size.
        stretch: whether a picture is squeezed into that size.
        delta1: per cent of pixels within a factor of 1.25, by data set.
        delta1_source: who published them.
        absrel: mean relative error once scale and shift are fitted, by data set.
        absrel_source: who published them.
    """

    name: str
    title: str
    gives: str
    focal: str
    takes: str
    runs: str
    repository: str
    licence: str
    megabytes: float
    source: str
    file: str = ""
    focal_px: float | None = None
    focal_per_side: float | None = None
    side_px: int = 518
    multiple_px: int = 14
    size_px: Sequence[int] | None = None
    stretch: bool = False
    delta1: Mapping[str, float] = field(default_factory=dict)
    delta1_source: str = ""
    absrel: Mapping[str, float] = field(default_factory=dict)
    absrel_source: str = ""

    @property
    def u_total(self) -> float:
        """Relative standard deviation of a depth without an anchor (of its logarithm)."""
        if not self.delta1:
            return math.hypot(ASSUMED_FACTOR, self.u_local)
        return math.sqrt(sum(u_of_share(d / 100) ** 2 for d in self.delta1.values()) / len(self.delta1))

    @property
    def u_local(self) -> float:
        """Relative standard deviation of single depths once scale and shift are fitted: normal errors have a mean
        absolute value of sqrt(2 / pi) of it.
        """
        if not self.absrel:
            return ASSUMED_LOCAL
        return math.sqrt(math.pi / 2 * sum(a**2 for a in self.absrel.values()) / len(self.absrel))

    @property
    def u_factor(self) -> float:
        """Relative standard deviation of the factor that all depths share, in the logarithm."""
        return math.sqrt(max(self.u_total**2 - self.u_local**2, 0.0))

    @property
    def doubt(self) -> str:
        """Where `u_total` comes from."""
        if not self.delta1:
            return "assumed: as the best of those that were compared by A. Bochkovskii et al., arXiv 2410.02073"
        low, high = min(self.delta1.values()), max(self.delta1.values())
        return (
            f"{low:g} to {high:g} % of pixels within a factor of 1.25 on {', '.join(self.delta1)}: {self.delta1_source}"
        )

    @property
    def relative(self) -> bool:
        """Whether its numbers have no unit before they are anchored."""
        return self.gives not in ("metric", "points")

    def fetch(self, folder: Path) -> str:
        """The command that fetches it into a folder where it is found, or to where transformers finds it."""
        if self.runs == "transformers":
            return f"hf download {self.repository}"
        file = f" {self.file}" if self.file else ""
        return f"hf download {self.repository}{file} --local-dir {_short(folder / self.name)}"

    def how_to_have(self, folder: Path) -> str:
        """Which command fetches it, how large it is, and its licence, in one line."""
        then = ""
        if self.runs == "export":
            then = f", export it with its authors' code to {_short(folder / (self.name + '.onnx'))}"
        size = f"{self.megabytes / 1000:.1f} GB" if self.megabytes >= 1000 else f"{self.megabytes:.0f} MB"
        return f"{self.fetch(folder)} (about {size}, {self.licence}){then}"


def _short(path: Path) -> str:
    """With ~ for the home folder, as a shell reads it."""
    home = Path.home()
    return f"~/{path.relative_to(home)}" if path.is_relative_to(home) else str(path)


def u_of_share(share: float) -> float:
    """Standard deviation of ln(depth / true depth) of which a share lies within ln 1.25 of 0."""
    return math.log(1.25) / normal_quantile((1 + min(max(share, 0.01), 0.9999)) / 2)


@cache
def depth_models() -> dict[str, DepthModel]:
    """All rows by name."""
    import tomllib
    from importlib.resources import files

    table = tomllib.loads(files("subtense").joinpath("data/depth_models.toml").read_text("utf-8"))
    return {name: DepthModel(name, **row) for name, row in table.items()}


def find_depth_model(name: str, option: str = "--prefer") -> DepthModel:
    """The row of a name or repository, whatever its case.

    Raises:
        InputError: no such row; the nearest names are given.
    """
    wanted = name.strip().lower()
    for row in depth_models().values():
        if wanted in (row.name, row.repository.lower()):
            return row
    import difflib

    near = difflib.get_close_matches(wanted, depth_models(), 3, 0.3) or list(depth_models())[:3]
    raise InputError(option, name, f"known are {', '.join(near)} and more: see `subtense depth-models`")


def search(words: Sequence[str]) -> list[DepthModel]:
    """Rows that have all words in name, title or licence."""
    return [
        row
        for row in depth_models().values()
        if all(word.lower() in f"{row.name} {row.title} {row.licence}".lower() for word in words)
    ]
