"""The photo with what was measured drawn on it: ends or corners, the distance and its interval."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..document import Document, Shape
from ..errors import InputError
from ..photo import Photo
from .rounding import digits_for, fitting_unit, grouped

INK, HALO, PLATE = (255, 221, 51), (20, 20, 20), (20, 20, 20, 190)
SMOOTHED_PIXELS = 30_000_000
"""Larger pictures are drawn on directly."""
MARKED_ENDS = 16
"""Points of a shape that are marked one by one; of a contour the line is enough."""
FORMATS = (".png", ".jpg", ".jpeg", ".webp")


def write(document: Document, photo: Photo, path: Path) -> None:
    """Write the annotated picture; whole or not at all.

    Raises:
        InputError: not a picture's name, or no such folder.
    """
    if path.suffix.lower() not in FORMATS:
        raise InputError("--overlay", str(path), f"give a name that ends in {', '.join(FORMATS)}")
    if not path.parent.is_dir():
        raise InputError("--overlay", str(path), "its folder does not exist")
    if path.exists() and photo.path.exists() and path.samefile(photo.path):
        raise InputError("--overlay", str(path), "that is the photo itself; give another name")
    picture = draw(document, photo)
    part = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        picture.save(part, quality=92)
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise InputError("--overlay", str(path), f"it can't be written ({error.strerror or error})") from None


def draw(document: Document, photo: Photo) -> Any:
    """The annotated picture as a Pillow image."""
    from PIL import Image, ImageDraw

    picture = Image.fromarray(photo.pixels).convert("RGB")
    unit = max(picture.size) / 1600
    smooth = 2 if picture.width * picture.height <= SMOOTHED_PIXELS else 1
    layer = Image.new("RGBA", (picture.width * smooth, picture.height * smooth), (0, 0, 0, 0))
    pen = ImageDraw.Draw(layer)
    for shape in document.shapes:
        _outline(pen, shape, unit * smooth, smooth)
    if smooth > 1:
        layer = layer.resize(picture.size, Image.Resampling.BOX)
    picture.paste(layer, mask=layer)
    pen = ImageDraw.Draw(picture, "RGBA")
    taken: list[tuple[float, float, float, float]] = []
    captioned: set[str] = set()
    for shape in document.shapes:
        if shape.label not in captioned:  # an outline and the extent of it that was measured are of one label
            _plate(pen, _caption(document, shape.label), shape, unit, picture.size, taken)
        captioned.add(shape.label)
    return picture


def _outline(pen: Any, shape: Shape, unit: float, smooth: int) -> None:
    """Lines and hollow ends on a layer `smooth` times larger, whose pixel centres lie at (x + 0.5) smooth - 0.5."""
    ends = [((x + 0.5) * smooth - 0.5, (y + 0.5) * smooth - 0.5) for x, y in shape.points_px]
    points = [*ends, *(ends[:1] if shape.closed else ())]
    for colour, width in ((HALO, 5 * unit), (INK, 2.4 * unit)):
        pen.line(points, fill=colour, width=max(round(width), 1), joint="curve")
    r = 7 * unit
    for x, y in ends if len(ends) <= MARKED_ENDS else ():  # hollow, so that the end itself stays visible
        for colour, width in ((HALO, 4 * unit), (INK, 2 * unit)):
            pen.ellipse((x - r, y - r, x + r, y + r), outline=colour, width=max(round(width), 1))


def _caption(document: Document, label: str) -> list[str]:
    group = [m for m in document.measurements if m.label == label]
    if not group:
        return [label]
    m = group[0]
    name, factor = fitting_unit(m.value, m.unit)
    doubt = m.u if m.u is not None else m.value / 10
    decimals = max(digits_for(doubt / factor), 0)
    low, high = (None if x is None else grouped(x / factor, decimals) for x in (m.low, m.high))
    lines = [f"{m.what.replace('_', ' ')} {grouped(m.value / factor, decimals)} {name}"]
    if m.u != 0:
        lines.append(f"{100 * m.level:g} %: {low or '0'} to {high or 'open'} {name}")
    return [label, *lines] if label else lines


def _plate(
    pen: Any,
    lines: list[str],
    shape: Shape,
    unit: float,
    size: tuple[int, int],
    taken: list[tuple[float, float, float, float]],
) -> None:
    """The caption on a dark plate beside the shape, inside the picture, off the plates already there."""
    from PIL import ImageFont

    font = ImageFont.load_default(size=max(22 * unit, 1))
    boxes = [pen.textbbox((0, 0), line, font=font) for line in lines]
    pad, step = 8 * unit, 28 * unit
    width, height = max(b[2] for b in boxes) + 2 * pad, step * len(lines) + 1.5 * pad
    x, y = _place(shape, width, height, 14 * unit, size, taken)
    taken.append((x, y, x + width, y + height))
    pen.rounded_rectangle((x, y, x + width, y + height), 6 * unit, fill=PLATE)
    for i, line in enumerate(lines):
        pen.text(
            (x + pad, y + pad / 2 + i * step),
            line,
            font=font,
            fill=INK if i == len(lines) - min(len(lines), 2) else "white",
        )


def _place(
    shape: Shape,
    width: float,
    height: float,
    gap: float,
    size: tuple[int, int],
    taken: list[tuple[float, float, float, float]],
) -> tuple[float, float]:
    xs, ys = [p[0] for p in shape.points_px], [p[1] for p in shape.points_px]
    middle_x, middle_y = (min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2
    spots = (
        (middle_x - width / 2, max(ys) + gap), (middle_x - width / 2, min(ys) - gap - height),
        (max(xs) + gap, middle_y - height / 2), (min(xs) - gap - width, middle_y - height / 2),
    )  # fmt: skip

    def cost(spot: tuple[float, float]) -> float:
        x, y = spot
        outside = max(-x, 0) + max(-y, 0) + max(x + width - size[0], 0) + max(y + height - size[1], 0)
        over = sum(
            max(min(x + width, b[2]) - max(x, b[0]), 0) * max(min(y + height, b[3]) - max(y, b[1]), 0) for b in taken
        )
        return outside + over

    x, y = min(spots, key=cost)
    return min(max(x, 0), max(size[0] - width, 0)), min(max(y, 0), max(size[1] - height, 0))
