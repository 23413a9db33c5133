"""`subtense ground`: distances, lengths and speeds on the ground of a photo, and how a camera stands above it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from .options import output_options, show, write_overlay

STANDING = (
    ("height", "LENGTH", "Of the camera above the ground, m if bare; '40 ± 1 m above take-off' of a drone."
     "  [default: as the file tells]"),
    ("pitch", "ANGLE", "Of the camera above the horizon, negative downwards; or --horizon, or --parallels."
     "  [default: as the file tells]"),
    ("roll", "ANGLE", 'Of the camera, right side down.  [default: as the file tells, or "0 ± 2.9 deg"]'),
    ("horizon", "POINTS", "Points of the horizon, x1,y1;x2,y2, far apart."),
    ("dip", "SHARE", "Of --horizon: 0 for a vanishing line, 1 for the visible edge of a sea or plain."),
    ("parallels", "POINTS", "Two points of a level line and two of one parallel to it; best the same of another pair."),
    ("reference", "POINTS", "Two points on the ground, instead of the height."),
    ("reference-length", "LENGTH", "How far apart they are, m if bare."),
    ("slope", "ANGLE", 'Of the ground, rising ahead, as "0 ± 0.2 deg".  [default: level to 1 %]'),
    ("cross-slope", "ANGLE", "Of the ground, rising to the right.  [default: as well known as --slope]"),
    ("rise", "LENGTH", "Of the ground there above that at the camera's foot, or above the take-off."),
    ("refraction", "COEFFICIENT", "Of light near the ground.  [default: 0.13 ± 0.26]"),
)  # fmt: skip
"""How the camera stands above the ground; the fields of `GroundTexts`."""


def standing_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Those of STANDING, in their order."""
    for name, kind, text in reversed(STANDING):
        command = click.option(f"--{name}", metavar=kind, help=text)(command)
    return command


def standing_texts(told: dict[str, Any]) -> dict[str, str | None]:
    """What was said of how the camera stands, taken out of all that was told."""
    return {key: told.pop(key) for key in (name.replace("-", "_") for name, _, _ in STANDING)}


@click.command(
    epilog="Example: subtense ground examples/street.jpg --point 672,897 --height '1.6 ± 0.02 m' --pitch '-2 ± 0.5 deg' "
    "--camera 'f=1829 ± 10px'"
)
@click.argument("photo", type=click.Path(path_type=Path))
@click.option("--point", "feet", multiple=True, metavar="X,Y", help="A point on the ground, px; may be repeated.")
@click.option(
    "--length",
    "lengths",
    multiple=True,
    metavar="X1,Y1;X2,Y2",
    help="Two points on the ground: how far apart they are.",
)
@click.option("--move", "moves", multiple=True, metavar="X1,Y1;X2,Y2",
              help="A foot point here, and in a later picture of the camera, which stood still: its speed.")  # fmt: skip
@click.option(
    "--time", metavar="TIME", help='Between the two pictures, "0.5 ± 0.01 s", or "12:00:01.25 to 12:00:01.75".'
)
@click.option("--readout", metavar="TIME", help="Of a rolling shutter from the first row to the last.  [default: none]")
@click.option("--sampling", "places", multiple=True, metavar="X,Y", help="How much ground a pixel covers there.")
@click.option("--footprint", is_flag=True, help="The ground that the picture shows.")
@click.option("--point-height", metavar="LENGTH", help="Of the points above the ground, m if bare.  [default: 0]")
@standing_options
@click.option(
    "--terrain", type=click.Path(path_type=Path), help="A GeoTIFF of the ground's heights, instead of a plane."
)
@click.option("--position", metavar="E,N", help="Of the camera in the terrain model, as '512300,5403100 ± 3 m'.")
@click.option("--heading", metavar="ANGLE", help="Of the picture's upper middle, clockwise from the model's north.")
@click.option("--terrain-sigma", metavar="LENGTH", help="Standard deviation of the model's heights.")
@click.option("--terrain-datum", metavar="NAME", help="What they count from, where the file does not tell.")
@click.option("--camera", metavar="CAMERA", help="What is known of it; see `subtense measure --help`.")
@click.option("--overlay", type=click.Path(path_type=Path), help="Write the photo with the result drawn on it.")
@output_options
def ground(photo: Path, terrain: Path | None, position: str | None, heading: str | None, terrain_sigma: str | None,
           terrain_datum: str | None, point_height: str | None, overlay: Path | None, form: str, files: tuple[Path, ...],
           **told: Any) -> None:  # fmt: skip
    """Distances, lengths and speeds on the ground of PHOTO, by the camera's height above it and how it looks down.

    No object of known size is needed. How the camera stands is as the file tells (drones, some phones) or as it is said here.
    """
    from ..errors import InputError
    from ..photo import Photo
    from ..workflow.ground import GroundTexts, TerrainTexts, ground_document
    from ..workflow.report_of import report_of

    report_of(form)
    said = GroundTexts(**standing_texts(told), point_height=point_height)
    model = None
    if terrain is not None:
        for name, value in (("--position", position), ("--heading", heading), ("--terrain-sigma", terrain_sigma)):
            if value is None:
                raise InputError(name, None, "a terrain model needs --position, --heading and --terrain-sigma")
        model = TerrainTexts(terrain, str(position), str(heading), str(terrain_sigma), terrain_datum)
    picture = Photo.load(photo)
    document = ground_document(picture, said=said, terrain=model, **told)
    write_overlay(document, picture, overlay)
    show(document, form, files, picture)
