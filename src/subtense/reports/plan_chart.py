"""The error of planned set-ups against distance, as PNG or SVG drawn by matplotlib.

The same plans give the same bytes: no dates, no settings of the user's, matplotlib's own fonts.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from ..distribution import HALF_WIDTH_95
from ..errors import InputError, MissingExtraError
from ..planned import Plan, Row
from ..plot import Plot
from ..whole_file import write_whole

DPI, WIDTH_IN, HEIGHT_IN = 150, 8.0, 5.2
INK, QUIET, TRACK, WANTED = "#1c1c1c", "#5c6670", "#d8dde1", "#D55E00"
COLOURS = ("#0072B2", "#009E73", "#CC79A7", "#E69F00")
"""Of Okabe and Ito, told apart by people who see fewer colours."""
DASHES: tuple[Any, ...] = ((0, (5, 2)), (0, (1, 1.5)), (0, (5, 1.5, 1, 1.5)), (0, (3, 1, 1, 1, 1, 1)))
STYLE = {
    "font.family": "DejaVu Sans", "font.size": 11, "axes.titlesize": 12.5, "axes.titleweight": "bold", "axes.titlelocation": "left",
    "axes.edgecolor": QUIET, "axes.labelcolor": INK, "xtick.color": QUIET, "ytick.color": QUIET, "xtick.labelcolor": INK,
    "ytick.labelcolor": INK, "axes.spines.top": False, "axes.spines.right": False, "grid.color": TRACK, "legend.frameon": False,
    "legend.fontsize": 10, "text.parse_math": False, "axes.formatter.useoffset": False, "svg.hashsalt": "subtense",
    "svg.fonttype": "path",
}  # fmt: skip
MOST_CAUSES = 4
"""Lines of single causes in the chart of one way."""
ENDINGS = {".png": "png", ".svg": "svg"}
_LOCK = Lock()
CAPTION = (
    "The half-width of the 95 % interval against distance; below the dashed line the accuracy is reached. Thin lines are what single "
    "causes make of it."
)


def check_ending(path: Path) -> str:
    """The kind of picture that a file's ending names.

    Raises:
        InputError: neither PNG nor SVG.
    """
    kind = ENDINGS.get(path.suffix.lower())
    if kind is None:
        raise InputError("--chart", str(path), "name a .png or .svg file")
    return kind


def write(plans: Sequence[Plan], path: Path) -> None:
    """Write the chart into a file, whole or not at all.

    Raises:
        InputError: an ending that is no picture's, or the file can't be written.
        MissingExtraError: matplotlib is not installed.
    """
    write_whole(path, _drawn(plans, check_ending(path)), "--chart")


def plot(plans: Sequence[Plan]) -> Plot:
    """The chart as a picture for a report.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    content = _drawn(plans, "png")
    return Plot("plan", "Error against distance", CAPTION, content, round(WIDTH_IN * DPI), round(HEIGHT_IN * DPI))


def _drawn(plans: Sequence[Plan], kind: str) -> bytes:
    try:
        import matplotlib
        from matplotlib import figure as drawing
    except ImportError:
        raise MissingExtraError("a chart of a plan", "plots") from None
    out = io.BytesIO()
    # matplotlib's settings are of the process: one at a time, without the user's own
    with _LOCK, matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(STYLE)
        figure = drawing.Figure(figsize=(WIDTH_IN, HEIGHT_IN), layout="constrained")
        axes = figure.subplots()
        _draw(axes, [plan for plan in plans if plan.curve])
        metadata = {"Software": None} if kind == "png" else {"Date": None, "Creator": None}
        figure.savefig(out, format=kind, dpi=DPI, metadata=metadata)
    return out.getvalue()


def _draw(axes: Any, plans: Sequence[Plan]) -> None:
    alone = len(plans) == 1
    for plan, colour in zip(plans, COLOURS, strict=False):
        x, y = _line(plan.curve)
        axes.plot(x, y, color=INK if alone else colour, lw=2.4, label="all together" if alone else plan.title, zorder=4)
    if alone:
        _causes(axes, plans[0])
    ends = np.array([row.distance_m for plan in plans for row in plan.curve if row.half_width_m is not None])
    if plans and plans[0].wanted is not None and len(ends):
        wanted, x = plans[0].wanted, np.array([ends.min(), ends.max()])
        axes.plot(x, [wanted.at(v) for v in x], color=WANTED, lw=1.6, ls=(0, (6, 3)), label=f"wanted: {wanted.text.lstrip('± ')}",
                  zorder=5)  # fmt: skip
    for plan, colour in zip(plans, COLOURS, strict=False):
        if plan.answer.half_width_m is not None:
            axes.plot(plan.answer.distance_m, plan.answer.half_width_m, "o", color=INK if alone else colour, ms=8, mec="white", mew=1.2,
                      label="planned" if alone else None, zorder=6)  # fmt: skip
    _furnish(axes, plans)


def _furnish(axes: Any, plans: Sequence[Plan]) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set(xscale="log", yscale="log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: _tick(value)))
        axis.set_minor_formatter(NullFormatter())
    what = plans[0].what if len(plans) == 1 else "distance"
    axes.set(xlabel=what, ylabel="± (half-width of the 95 % interval)")
    axes.set_title(f"Error against {what}" + (f": {plans[0].title}" if len(plans) == 1 else ""), pad=12)
    axes.grid(which="major")
    axes.set_axisbelow(True)
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _line(rows: Sequence[Row]) -> tuple[np.ndarray, np.ndarray]:
    """Distances and half-widths; NaN, which breaks the line, where there is none."""
    x = np.array([row.distance_m for row in rows])
    return x, np.array([np.nan if row.half_width_m is None else row.half_width_m for row in rows])


def _causes(axes: Any, plan: Plan) -> None:
    """What the largest causes would make alone, as half-widths."""
    weight: dict[str, float] = {}
    for row in plan.curve:
        for line in row.measured.budget if row.measured and row.half_width_m is not None else ():
            if line.name != "interaction":
                weight[line.name] = max(weight.get(line.name, 0.0), line.share)
    largest = sorted(weight, key=lambda name: -weight[name])[:MOST_CAUSES]
    for name, colour, dash in zip(largest, COLOURS, DASHES, strict=False):
        found = [next((line for line in row.measured.budget if line.name == name), None)
                 if row.measured and row.half_width_m is not None else None for row in plan.curve]  # fmt: skip
        y = [np.nan if line is None else HALF_WIDTH_95 * abs(line.u) for line in found]
        axes.plot([row.distance_m for row in plan.curve], y, color=colour, lw=1.5, ls=dash, label=name, zorder=3)


def _tick(value: float) -> str:
    """A length as short as it can be: 5 mm, 20 cm, 2 m, 1 km."""
    name, factor = next(
        (n, f) for n, least, f in (("km", 1e3, 1e3), ("m", 1.0, 1.0), ("cm", 1e-2, 1e-2), ("mm", 1e-3, 1e-3), ("µm", 0.0, 1e-6))
        if value >= least * (1 - 1e-9)
    )  # fmt: skip
    return f"{value / factor:g} {name}"
