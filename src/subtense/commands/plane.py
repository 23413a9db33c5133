"""`subtense plane`: lengths, areas and angles in a plane of a photo, by right angles, parallels and lengths in it."""

from __future__ import annotations

from pathlib import Path

import click

from .options import output_options, show, write_overlay

FOUR = "X1,Y1;...;X4,Y4"
TWO_LINES = "X1,Y1;X2,Y2 | X3,Y3;X4,Y4"


@click.command(
    epilog="Example: subtense plane wall.jpg --rectangle '212,300;911,352;918,803;205,871' --length '212,300;911,352 = 2.4 m' "
    "--path '300,400;700,600'"
)
@click.argument("photo", type=click.Path(path_type=Path))
@click.option(
    "--rectangle", "rectangle", multiple=True, metavar=FOUR, help="Corners of a rectangle in the plane, in order, px."
)
@click.option("--square", "square", multiple=True, metavar=FOUR, help="Corners of a square.")
@click.option(
    "--parallel", "parallel", multiple=True, metavar=TWO_LINES, help="Two or more lines that are parallel in the plane."
)
@click.option("--right-angle", "right_angle", multiple=True, metavar="POINTS",
              help="X1,Y1;X2,Y2;X3,Y3 with the corner in the middle, or two lines as of --parallel.")  # fmt: skip
@click.option(
    "--equal-length", "equal_length", multiple=True, metavar=TWO_LINES, help="Two or more lines that are equally long."
)
@click.option("--length", "length", multiple=True, metavar="X1,Y1;X2,Y2 = LENGTH",
              help="A line and how long it is, mm if bare; up to three. Angles need none.")  # fmt: skip
@click.option(
    "--path", "paths", multiple=True, metavar="X1,Y1;X2,Y2[;...]", help="A length to measure; may be repeated."
)
@click.option(
    "--area", "areas", multiple=True, metavar="X1,Y1;...", help="Corners of an area to measure, in order around it."
)
@click.option(
    "--angle",
    "angles",
    multiple=True,
    metavar="X1,Y1;X2,Y2;X3,Y3",
    help="An angle to measure, its corner in the middle.",
)
@click.option("--camera", metavar="CAMERA", help="What is known of it, see `subtense measure --help`, or none to do without."
              "  [default: from the photo's metadata, else none]")  # fmt: skip
@click.option("--overlay", type=click.Path(path_type=Path), help="Write the photo with the result drawn on it.")
@output_options
def plane(photo: Path, rectangle: tuple[str, ...], square: tuple[str, ...], parallel: tuple[str, ...], right_angle: tuple[str, ...],
          equal_length: tuple[str, ...], length: tuple[str, ...], paths: tuple[str, ...], areas: tuple[str, ...],
          angles: tuple[str, ...], camera: str | None, overlay: Path | None, form: str, files: tuple[Path, ...], level: float,
          seed: int) -> None:  # fmt: skip
    """Lengths, areas and angles in a plane of PHOTO, by what holds in it: right angles, parallels, equal and known lengths.

    With the camera two conditions and a length are enough (a rectangle counts as three), without it four and a length. More of
    them check each other. All points lie in the one plane; points at the same pixel are the same point.
    """
    from ..photo import Photo
    from ..workflow.plane_conditions import PlaneTexts, plane_document
    from ..workflow.report_of import report_of

    report_of(form)
    said = PlaneTexts(rectangle, square, parallel, right_angle, equal_length, length)
    picture = Photo.load(photo)
    document = plane_document(
        picture, said, paths=paths, areas=areas, angles=angles, camera=camera, level=level, seed=seed
    )
    write_overlay(document, picture, overlay)
    show(document, form, files, picture)
