"""Commands about scenes seen from several places: `triangulate` and `reconstruct`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..errors import InputError
from .options import output_options, show

if TYPE_CHECKING:
    from ..quantity import Note


@click.command(
    epilog="Example: subtense triangulate left.jpg right.jpg --baseline '500 ± 0.5 mm' "
    "--point 'left.jpg:812,604; right.jpg:640,604'"
)
@click.argument("photos", nargs=-1, type=click.Path(path_type=Path))
@click.option("--point", "points", multiple=True, metavar="TRACK",
              help="A point in two pictures or more, as 'a.jpg:120,80; b.jpg:95,82 ± 0.5px'; may be repeated.")  # fmt: skip
@click.option("--baseline", metavar="LENGTH", help="How far apart the first two pictures were taken.")
@click.option("--slide", default="1,0,0", show_default=True, metavar="X,Y,Z",
              help="Direction of the camera's motion in its own frame: x right, y down, z forward.")  # fmt: skip
@click.option("--turn", metavar="ANGLE", help='How well it kept its direction, as "0 ± 0.2 deg".  [default: 0.1° (1s)]')
@click.option("--camera", metavar="CAMERA", help="What is known of it; see `subtense measure --help`.")
@click.option("--views", metavar="VIEWS", help="Instead of PHOTOS: pictures with their places, as a JSON file or as "
              "'CAMERA | a.jpg 0,0,0 | b.jpg 0.5,0,0 ± 1mm'.")  # fmt: skip
@output_options
def triangulate(photos: tuple[Path, ...], points: tuple[str, ...], baseline: str | None, slide: str, turn: str | None,
                camera: str | None, views: str | None, form: str, files: tuple[Path, ...], level: float, seed: int) -> None:  # fmt: skip
    """Points seen in two or more PHOTOS of one camera that was moved by a known length without turning it, or from known places.

    Range and depth are those from the first picture of each point; with several points, the length from each to the next too.
    """
    from ..workflow import triangulate as way
    from ..workflow.report_of import report_of

    report_of(form, photo=False)
    notes: tuple[Note, ...] = ()
    if (views is None) == (not photos):
        raise InputError("--views", views, "give either PHOTOS or --views")
    if views is not None:
        known = way.views_of(views)
    elif baseline is None:
        raise InputError(
            "--baseline", None, "say how far apart the first two pictures were taken, as --baseline '500 ± 0.5 mm'"
        )
    else:
        known, notes = way.moved_camera(photos, slide=slide, turn=turn, camera=camera)
    show(way.triangulate(known, points, baseline=baseline, level=level, seed=seed, notes=notes), form, files)
