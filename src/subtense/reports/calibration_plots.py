"""Pictures of a calibration: residuals, coverage, uncertainty, board and lens, drawn by matplotlib.

The same calibration gives the same bytes: no dates, no settings of the user's, matplotlib's own fonts. Pictures have their y
axis down, as the photos have.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from ..arrays import Array
from ..calibration import Calibration, Picture
from ..calibration_checks import ENOUGH_TILT_RAD
from ..calibration_maps import uncertainty_map
from ..calibration_residuals import board_shifts_m, by_radius, lens_curve, residuals_of, running_mean
from ..calibration_summary import bow_text, camera_titles, printable
from ..camera import Camera
from ..distribution import HALF_WIDTH_95
from ..errors import InputError, MissingExtraError
from ..plot import Plot
from ..whole_file import write_whole

Figure = Any
"""Matplotlib's, which is imported only where a picture is drawn."""
Axes = Any
DPI, WIDTH_IN = 150, 8.0
BLUE, ORANGE, GREEN, VERMILLION, PURPLE = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7"
"""Of Okabe and Ito, told apart by people who see fewer colours."""
INK, QUIET, TRACK = "#1c1c1c", "#5c6670", "#d8dde1"
SIDES = (("right", BLUE), ("down", ORANGE), ("left", GREEN), ("up", VERMILLION))
STYLE = {
    "font.family": "DejaVu Sans", "font.size": 11, "axes.titlesize": 12.5, "axes.titleweight": "bold", "axes.titlelocation": "left",
    "axes.edgecolor": QUIET, "axes.labelcolor": INK, "xtick.color": QUIET, "ytick.color": QUIET, "xtick.labelcolor": INK,
    "ytick.labelcolor": INK, "axes.spines.top": False, "axes.spines.right": False, "grid.color": TRACK, "legend.frameon": False,
    "legend.fontsize": 10, "text.parse_math": False, "axes.formatter.useoffset": False,
}  # fmt: skip
MOST_NAMES, NAME_LENGTH = 30, 20
"""More pictures than that are told by numbers, those of the table in the reports."""
COLUMNS, ROWS = 5, 4
"""Cells of the coverage, those that the check counts."""


@dataclass(frozen=True)
class _Kind:
    """One row of the table of pictures: `draw` takes the calibration and a camera's number; None for nothing to show."""

    name: str
    title: str
    caption: str
    draw: Callable[[Calibration, int], Figure | None]
    each_camera: bool = True


# -- all of them ---------------------------------------------------------------------------------------------------------


def plots(calibration: Calibration) -> tuple[Plot, ...]:
    """All pictures of a calibration, for a report.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    found = []
    titles = camera_titles(calibration)
    with _own_style():
        for kind in KINDS:
            for index in range(len(titles) if kind.each_camera else 1):
                figure = kind.draw(calibration, index)
                if figure is None:
                    continue
                title = titles[index] if kind.each_camera else ""
                name, head = (
                    (f"{kind.name}-{title}", f"{kind.title}, {title} camera") if title else (kind.name, kind.title)
                )
                found.append(_finished(figure, name, head, kind.caption))
    return tuple(found)


def png_files(calibration: Calibration, folder: Path) -> tuple[Path, ...]:
    """Write all pictures into a folder, which is made where it is missing; each whole or not at all.

    Raises:
        InputError: the folder can't be made or written to.
        MissingExtraError: matplotlib is not installed.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError("--plots", str(folder), f"the folder can't be made ({error.strerror or error})") from None
    drawn = plots(calibration)
    paths = tuple(folder / f"{plot.name}.png" for plot in drawn)
    for plot, path in zip(drawn, paths, strict=True):
        write_whole(path, plot.png, "--plots")
    return paths


_LOCK = Lock()


@contextmanager
def _own_style() -> Iterator[None]:
    """Matplotlib's defaults and STYLE, whatever the user has set; matplotlib's settings are of the process, so one at a time."""
    try:
        import matplotlib
    except ImportError:
        raise MissingExtraError("a picture of a calibration", "plots") from None
    with _LOCK, matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(STYLE)
        yield


def _finished(figure: Figure, name: str, title: str, caption: str) -> Plot:
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=DPI, metadata={"Software": None})
    width, height = (round(side * DPI) for side in figure.get_size_inches())
    return Plot(name, title, caption, out.getvalue(), width, height)


# -- parts of pictures -----------------------------------------------------------------------------------------------------


def _figure(height_in: float, panels: int = 1) -> tuple[Figure, Sequence[Axes]]:
    from matplotlib import figure as drawing

    figure = drawing.Figure(figsize=(WIDTH_IN, height_in), layout="constrained")
    return figure, np.atleast_1d(figure.subplots(panels, 1, sharex=panels > 1)).tolist()


def _frame(camera: Camera, extra_in: float = 0.9) -> tuple[Figure, Axes]:
    """A figure with one picture of the camera, in pixels."""
    width, height = camera.width_px, camera.height_px
    figure, (axes,) = _figure(min(max(6.6 * height / width + extra_in, 4.0), 9.5))
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), aspect="equal", xlabel="x, px", ylabel="y, px")
    for side in axes.spines.values():
        side.set_visible(True)
    return figure, axes


def _nice(value: float) -> float:
    """The nearest of 1, 2, 5, 10, ... at or below."""
    if not value > 0 or not math.isfinite(value):
        return 1.0
    power = 10.0 ** math.floor(math.log10(value))
    return power * next(step for step in (5, 2, 1) if step * power <= value * (1 + 1e-9))


def _key(axes: Axes, at: tuple[float, float], length: float, text: str) -> None:
    """An arrow of known length outside the axes, above their right end, with what it stands for."""
    from matplotlib.transforms import offset_copy

    shown = offset_copy(axes.transAxes, fig=axes.get_figure(root=True), y=0.12)
    x = at[0]
    axes.annotate("", (x, at[1]), (x - length, at[1]), xycoords=shown, textcoords=shown, annotation_clip=False,
                  arrowprops={"arrowstyle": "->", "color": INK, "lw": 1.4, "shrinkA": 0, "shrinkB": 0})  # fmt: skip
    axes.text(x - length - 0.012, at[1], text, transform=shown, ha="right", va="center", fontsize=10)


def _short(name: str) -> str:
    """A stranger's name, short, of characters that the font has."""
    from matplotlib.font_manager import FontProperties, findfont, get_font

    known = get_font(findfont(FontProperties(family="DejaVu Sans"))).get_charmap()
    clean = "".join(c if ord(c) in known else "?" for c in printable(name))
    return clean if len(clean) <= NAME_LENGTH else f"{clean[: NAME_LENGTH // 2]}…{clean[-NAME_LENGTH // 2 + 1 :]}"


def _titled(calibration: Calibration, index: int, text: str) -> str:
    """The title of a picture, with the camera's where there are two."""
    title = camera_titles(calibration)[index]
    return f"{text}, {title} camera" if title else text


def _of_camera(calibration: Calibration, index: int) -> list[tuple[int, Picture]]:
    """The pictures of a camera with their numbers in the reports' table, from 1."""
    return [(i + 1, p) for i, p in enumerate(p for p in calibration.pictures if p.camera == index)]


# -- residuals -------------------------------------------------------------------------------------------------------------


def picture_residuals(calibration: Calibration, _: int = 0) -> Figure:
    """Bars of the rms of each picture, camera by camera."""
    cameras = len(calibration.cameras)
    most = max(len(_of_camera(calibration, c)) for c in range(cameras))
    named = most <= MOST_NAMES
    figure, axes = _figure(1.0 + (3.6 if named else 2.6) * cameras)
    if cameras > 1:
        figure.clear()
        axes = figure.subplots(cameras, 1).tolist()
    for index, ax in enumerate(axes):
        _bars(ax, _of_camera(calibration, index), named)
        rms = np.sqrt(np.mean(np.sum(residuals_of(calibration.solution, index).off_px ** 2, 1)))
        ax.set_title(_titled(calibration, index, f"Residuals per picture ({rms:.2f} px rms together)"))
    return figure


def _bars(ax: Axes, pictures: list[tuple[int, Picture]], named: bool) -> None:
    used = [(n, p.rms_px) for n, p in pictures if p.rms_px is not None]
    out = [n for n, p in pictures if p.left_out]
    median = float(np.median([rms for _, rms in used]))
    ax.bar(
        [n for n, _ in used], [rms for _, rms in used], color=BLUE, width=0.7 * min(1.0, len(pictures) / 10), zorder=2
    )
    ax.axhline(median, color=ORANGE, lw=1.6, ls=(0, (5, 3)), label=f"median {median:.2f} px", zorder=3)
    top = 1.3 * max(rms for _, rms in used)
    if out:
        ax.plot(
            out,
            [0.05 * top] * len(out),
            "X",
            color=VERMILLION,
            ms=9,
            mec="white",
            label=f"left out: {len(out)}",
            zorder=3,
        )
    ax.set(
        ylim=(0, top),
        xlim=(0.3, len(pictures) + 0.7),
        ylabel="rms, px",
        xlabel="" if named else "number of the picture",
    )
    ax.grid(axis="y", zorder=0)
    if named:
        ax.set_xticks([n for n, _ in pictures], [f"{_short(p.name)}  {n}" for n, p in pictures], rotation=90,
                      fontsize=9, parse_math=False)  # fmt: skip
    ax.legend(loc="upper right", ncols=2)


def reprojection(calibration: Calibration, index: int = 0) -> Figure:
    """Arrows from where points were seen to where the camera puts them, too long by a round factor."""
    from matplotlib.lines import Line2D

    camera = calibration.cameras[index]
    points = residuals_of(calibration.solution, index)
    long = float(np.percentile(np.hypot(*points.off_px.T), 95))
    times = _nice(0.06 * camera.width_px / max(long, 1e-9))
    side = (np.round(np.arctan2(points.off_px[:, 1], points.off_px[:, 0]) / (np.pi / 2)).astype(int)) % 4
    figure, axes = _frame(camera, 1.3)
    axes.quiver(*points.seen_px.T, *points.off_px.T, color=np.array([c for _, c in SIDES])[side], angles="xy", scale_units="xy",
                scale=1 / times, width=0.0016 if len(side) > 1500 else 0.0022, headwidth=4, headlength=5)  # fmt: skip
    axes.set_title(_titled(calibration, index, f"Reprojection vectors, {times:g} times as long"), pad=24)
    length = _nice(2 * long)
    _key(axes, (1.0, 1.0), length * times / camera.width_px, f"{length:g} px")
    keys = [Line2D([], [], color=colour, lw=3, label=word) for word, colour in SIDES]
    figure.legend(handles=keys, loc="outside lower center", ncols=4, title="the camera puts the point too far")
    return figure


def radius_residuals(calibration: Calibration, index: int = 0) -> Figure:
    """The residuals' parts away from the middle and across, against the radius, with their running mean."""
    camera = calibration.cameras[index]
    radius, away, across = by_radius(residuals_of(calibration.solution, index), camera)
    reach = 1.15 * float(np.percentile(np.abs([away, across]), 99.7))
    figure, axes = _figure(6.2, 2)
    for ax, part, word in zip(axes, (away, across), ("away from the middle, px", "across, px"), strict=True):
        ax.plot(radius, part, ".", color=BLUE, ms=3, alpha=0.35, mew=0, rasterized=True)
        middle, mean, half = running_mean(radius, part)
        ax.fill_between(middle, mean - half, mean + half, color=ORANGE, alpha=0.45, lw=0, label="95 % of the mean")
        ax.plot(middle, mean, color=VERMILLION, lw=2, label="running mean")
        ax.axhline(0, color=INK, lw=0.8)
        ax.set(ylim=(-reach, reach), ylabel=word)
        ax.grid(axis="y")
    axes[0].set_title(_titled(calibration, index, "Residuals against the radius"), pad=24)
    axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2)
    axes[1].set(xlabel="radius from the principal point, px", xlim=(0, None))
    return figure


# -- over the picture ------------------------------------------------------------------------------------------------------


def coverage(calibration: Calibration, index: int = 0) -> Figure:
    """All points over the picture, and how many lie in each cell of the grid that the check counts."""
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.patches import Rectangle

    camera = calibration.cameras[index]
    seen = residuals_of(calibration.solution, index).seen_px
    width, height = camera.width_px, camera.height_px
    edges = np.linspace(-0.5, width - 0.5, COLUMNS + 1), np.linspace(-0.5, height - 0.5, ROWS + 1)
    count = np.histogram2d(seen[:, 0], seen[:, 1], bins=edges)[0].T
    figure, axes = _frame(camera)
    shades = LinearSegmentedColormap.from_list("shades", ["#ffffff", "#7fb8da"])
    axes.pcolormesh(*edges, count, cmap=shades, vmin=0, vmax=max(count.max(), 1), edgecolors="white", linewidth=1.5)
    axes.plot(*seen.T, ".", color=BLUE, ms=3.2, mew=0, alpha=0.6 if len(seen) < 2000 else 0.35)
    for row, column in np.ndindex(ROWS, COLUMNS):
        x, y = float(edges[0][column]), float(edges[1][row])
        n = int(count[row, column])
        if not n:
            axes.add_patch(Rectangle((x, y), width / COLUMNS, height / ROWS, fill=False, hatch="//", ec=VERMILLION, lw=0,
                                     alpha=0.7))  # fmt: skip
        axes.text(x + width / COLUMNS / 2, y + height / ROWS / 2, str(n) if n else "none", ha="center", va="center", fontsize=11,
                  weight="bold", color=INK if n else VERMILLION,
                  bbox={"boxstyle": "round,pad=0.25", "fc": "white", "ec": "none", "alpha": 0.85})  # fmt: skip
    filled = np.count_nonzero(count) / count.size
    axes.set_title(_titled(calibration, index, f"{len(seen)} points, in {100 * filled:.0f} % of the picture"))
    return figure


def uncertainty_px(calibration: Calibration, index: int = 0) -> Figure:
    """How well it is known where a direction is seen, px."""
    camera = calibration.cameras[index]
    found = uncertainty_map(camera, 81, 61)
    return _map(calibration, index, HALF_WIDTH_95 * found.u_px, "Projection uncertainty (95 %)", "± px", "{:g} px")


def uncertainty_range(calibration: Calibration, index: int = 0) -> Figure:
    """The relative uncertainty of a range from a known size seen at each place, by the camera alone."""
    camera = calibration.cameras[index]
    found = uncertainty_map(camera, 81, 61)
    values = 100 * HALF_WIDTH_95 * found.relative_u_range
    return _map(calibration, index, values, "Relative uncertainty of a range (95 %)", "± %", "{:g} %")


def _map(calibration: Calibration, index: int, values: Array, title: str, unit: str, form: str) -> Figure:
    from matplotlib.colors import LogNorm, Normalize
    from matplotlib.patheffects import withStroke
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    camera = calibration.cameras[index]
    figure, axes = _frame(camera, 0.7)
    axes.set_title(_titled(calibration, index, title))
    good = values[np.isfinite(values)]
    if not good.size or not good.max() > 0:
        axes.text(0.5, 0.5, "the camera has no uncertainty here", transform=axes.transAxes, ha="center")
        return figure
    levels, wide = _levels(float(good.min()), float(good.max()))
    norm = LogNorm(max(good.min(), good.max() / 1e4), good.max()) if wide else Normalize(good.min(), good.max())
    axes.set_facecolor(TRACK)
    edge = (-0.5, camera.width_px - 0.5, camera.height_px - 0.5, -0.5)
    image = axes.imshow(values, extent=edge, cmap="cividis", norm=norm, interpolation="bilinear")
    x, y = np.linspace(0, camera.width_px - 1, 81), np.linspace(0, camera.height_px - 1, 61)
    lines = axes.contour(x, y, np.ma.masked_invalid(values), levels=levels, colors="white", linewidths=1.3)
    lines.set_path_effects([withStroke(linewidth=2.3, foreground=INK, alpha=0.5)])
    for label in axes.clabel(lines, fmt=form.format, fontsize=10.5):
        label.set_path_effects([withStroke(linewidth=2.5, foreground=INK)])
    seen = residuals_of(calibration.solution, index).seen_px
    axes.plot(*seen.T, ".", color="white", ms=2.2, mew=0, alpha=0.6)
    bar = figure.colorbar(image, ax=axes, label=unit, shrink=0.85, pad=0.02, aspect=28)
    bar.ax.yaxis.set_major_locator(FixedLocator(levels))
    bar.ax.yaxis.set_minor_locator(NullLocator())
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    return figure


def _levels(low: float, high: float) -> tuple[list[float], bool]:
    """Round values between two, and whether they are steps of a logarithmic scale."""
    wide = high > 3 * low
    if wide:
        low = max(low, high / 1e4)
        powers = 10.0 ** np.arange(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
        steps = (1, 1.5, 2, 3, 5, 7) if high < 8 * low else (1, 2, 5) if high < 300 * low else (1,)
        every = sorted(float(f"{p * s:.3g}") for p in powers for s in steps)
    else:
        step = _nice((high - low) / 4) if high > low else high
        every = [float(f"{k * step:.6g}") for k in range(math.floor(low / step), math.ceil(high / step) + 1)]
    inside = [v for v in every if low < v < high]
    return inside or [float(f"{(low + high) / 2:.3g}")], wide


# -- lens, board, places -----------------------------------------------------------------------------------------------------


def lens(calibration: Calibration, index: int = 0) -> Figure | None:
    """How far the lens moves a point, against the radius; None for a model without distortion."""
    camera = calibration.cameras[index]
    if camera.lens == "pinhole":
        return None
    radius, shift, half = lens_curve(camera)
    points = residuals_of(calibration.solution, index).seen_px
    outermost = float(np.hypot(*(points - [camera.cx_px, camera.cy_px]).T).max())
    figure, (axes,) = _figure(4.6)
    axes.fill_between(radius, shift - half, shift + half, color=ORANGE, alpha=0.45, lw=0, label="95 %")
    axes.plot(radius, shift, color=BLUE, lw=2.2, label="shift away from the middle")
    axes.axhline(0, color=INK, lw=0.8)
    axes.axvline(outermost, color=VERMILLION, lw=1.4, ls=(0, (5, 3)), label="outermost point seen")
    reach = max(float(abs(shift).max()), 1e-3) * 1.25
    axes.set(xlabel="radius from the principal point, px", ylabel="shift, px", xlim=(0, radius.max()))
    axes.set_ylim(min(-0.15 * reach, 1.25 * shift.min()), max(0.15 * reach, 1.25 * shift.max()))
    axes.grid()
    axes.legend(loc="best")
    against = "a lens of equal angles (f times the angle)" if camera.lens == "fisheye" else "a lens without distortion"
    axes.set_title(_titled(calibration, index, f"Distortion against {against}"))
    return figure


def board(calibration: Calibration, _: int = 0) -> Figure:
    """Where each point of the board seems to be besides its place, on the board, and its bow where one was found."""
    from matplotlib.lines import Line2D

    points = calibration.board.points_m[:, :2] * 1000
    shifts, u = (v * 1000 for v in board_shifts_m(calibration.solution))
    known = np.isfinite(u)
    sure = np.hypot(*shifts.T) > 2.448 * u  # the radius that holds 95 % of a circular normal law
    span = np.ptp(points, axis=0)
    long = float(np.percentile(np.hypot(*shifts[known].T), 90))
    times = _nice(0.06 * float(span.max()) / max(long, 1e-9))
    figure, (axes,) = _figure(min(max(6.4 * (span[1] + 30) / (span[0] + 30) + 1.5, 4.2), 9.0))
    margin = 0.09 * float(span.max())
    axes.set(xlim=(-margin, span[0] + margin), ylim=(span[1] + margin, -margin), aspect="equal", xlabel="x on the board, mm",
             ylabel="y, mm")  # fmt: skip
    _bow(figure, axes, calibration, points)
    axes.plot(*points.T, "o", color=QUIET, ms=3.5, mew=0)
    colours = np.where(sure, VERMILLION, BLUE)[known]
    axes.quiver(
        *points[known].T, *shifts[known].T, color=colours, angles="xy", scale_units="xy", scale=1 / times, width=0.0035
    )
    axes.set_title(f"Where points of the board seem to be, {times:g} times as far", pad=24)
    length = _nice(1.5 * long)
    _key(axes, (1.0, 1.0), length * times / float(span[0] + 2 * margin), f"{length:g} mm")
    keys = [Line2D([], [], color=BLUE, lw=3, label="as noise leaves it"),
            Line2D([], [], color=VERMILLION, lw=3, label="more than 95 % of noise")]  # fmt: skip
    figure.legend(handles=keys, loc="outside lower center", ncols=2)
    return figure


def _bow(figure: Figure, axes: Axes, calibration: Calibration, points_mm: Array) -> None:
    """The board's bulge as shades, where one was found."""
    if not bow_text(calibration):
        return
    solution = calibration.solution
    middle, half = points_mm.mean(0), np.ptp(points_mm, axis=0) / 2
    x, y = np.meshgrid(np.linspace(0, points_mm[:, 0].max(), 60), np.linspace(0, points_mm[:, 1].max(), 40))
    out = solution.state.warp_m * 1000
    z = (1 - ((x - middle[0]) / half[0]) ** 2) * out[0] + (1 - ((y - middle[1]) / half[1]) ** 2) * out[1]
    shades = axes.contourf(x, y, z, levels=10, cmap="cividis", alpha=0.55)
    figure.colorbar(shades, ax=axes, label="bulge away from the camera, mm", shrink=0.8, pad=0.02, aspect=24)


def places(calibration: Calibration, _: int = 0) -> Figure:
    """How far away and how tilted the board was in each picture."""
    figure, (axes,) = _figure(4.6)
    used = [(n, p) for n, p in _of_camera(calibration, 0) if p.tilt_rad is not None and p.range_m is not None]
    if calibration.rig:
        used += [
            (n, p) for n, p in _of_camera(calibration, 1) if p.tilt_rad is not None and n not in {m for m, _ in used}
        ]
    tilt = np.array([math.degrees(p.tilt_rad or 0.0) for _, p in used])
    far = np.array([p.range_m or 0.0 for _, p in used])
    axes.axvspan(0, math.degrees(ENOUGH_TILT_RAD), color=TRACK, alpha=0.6, lw=0, label="nearly frontal")
    axes.plot(tilt, far, "o", color=BLUE, ms=7, mec="white", mew=0.8, label="a picture")
    axes.set(xlim=(0, max(50.0, tilt.max() * 1.08)), ylim=(0, far.max() * 1.15), xlabel="tilt of the board, degrees",
             ylabel="range, m")  # fmt: skip
    taken: list[tuple[float, float]] = []
    for n, x, y in zip([n for n, _ in used], tilt, far, strict=True):
        spot = x / axes.get_xlim()[1], y / axes.get_ylim()[1]
        if len(used) <= MOST_NAMES and all(abs(spot[0] - a) > 0.04 or abs(spot[1] - b) > 0.06 for a, b in taken):
            axes.annotate(str(n), (x, y), (5, 4), textcoords="offset points", fontsize=9, color=INK)
            taken.append(spot)
    axes.grid()
    axes.set_axisbelow(True)
    axes.set_title("Where the board was", pad=24)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2)
    return figure


KINDS = (
    _Kind("range-uncertainty", "Relative uncertainty of a range",
          "A range that is had from a known size at this place of the picture is uncertain by this, through the camera alone; "
          "white dots are the points that were seen.", uncertainty_range),
    _Kind("projection-uncertainty", "Projection uncertainty",
          "How far off a known direction may be seen at each place of the picture, besides a turn of the whole camera; it grows "
          "where no points (white dots) were.", uncertainty_px),
    _Kind("coverage", "Coverage",
          "All points of all pictures, and their number in each cell; hatched cells had none, there the lens is extrapolated.",
          coverage),
    _Kind("residuals-per-picture", "Residuals per picture",
          "Bars should be about alike: one that stands out is blurred, moved or wrongly found; a cross marks a picture that was "
          "left out.", picture_residuals, each_camera=False),
    _Kind("reprojection-vectors", "Reprojection vectors",
          "From where each point was seen to where the camera puts it, enlarged; colours should be mixed everywhere: a region of "
          "one colour shows a lens model that does not fit.", reprojection),
    _Kind("residuals-over-radius", "Residuals against the radius",
          "The running mean should stay at 0 within its band: waves in the upper half show a lens model with too few terms.",
          radius_residuals),
    _Kind("lens-distortion", "Distortion of the lens",
          "How far the lens moves a point away from the middle of the picture (below 0: towards it); beyond the dashed line the "
          "curve is extrapolated.", lens),
    _Kind("board", "The board",
          "Where each point of the board seems to be besides its place, enlarged; arrows that agree with their neighbours show a "
          "board that was printed or fixed unevenly.", board, each_camera=False),
    _Kind("places", "Where the board was",
          "Good pictures lie well to the right of the shaded band and at different ranges; the numbers are those of the table of "
          "pictures.", places, each_camera=False),
)  # fmt: skip
"""All pictures, the most telling first."""
