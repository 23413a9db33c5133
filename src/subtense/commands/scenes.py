"""Commands about scenes seen from several places: `triangulate` and `reconstruct`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

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


@contextmanager
def _working() -> Iterator[Callable[[str, float], None]]:
    """A bar on the terminal's error stream that says what is done; nothing where that is no terminal."""
    with click.progressbar(length=1000, label="Reading", file=sys.stderr, hidden=not sys.stderr.isatty()) as bar:

        def told(title: str, share: float) -> None:
            bar.label = title.capitalize()
            bar.update(round(1000 * share) - bar.pos)

        yield told


@click.command(
    epilog="Example: subtense reconstruct photos --distance 'a.jpg -> b.jpg = 1.71 m ± 2 mm' "
    "--measure 'a.jpg:812,604 -> a.jpg:640,604' -o scene.ply"
)
@click.argument("folder", metavar="FOLDER", type=click.Path(path_type=Path))
@click.option("--measure", "measures", multiple=True, metavar="ENDS",
              help="A point, for its range, or END -> END, for the length. An end is 'a.jpg:x,y; b.jpg:x,y', a point in one "
              "picture, which is then found in others, or a picture's name.")  # fmt: skip
@click.option(
    "--distance",
    "distances",
    multiple=True,
    metavar="ENDS",
    help="A known length for the scale, as 'END -> END = 1.20 m'.",
)
@click.option(
    "--check", "checks", multiple=True, metavar="ENDS", help="A known length that is kept apart, to check the scale."
)
@click.option(
    "--marker-size", metavar="LENGTH", help="Scale by markers, which are found; side of the black square, mm if bare."
)
@click.option(
    "--things", "targets", is_flag=True, help="Scale by sheets, cards and codes of known size, which are found."
)
@click.option(
    "--board",
    metavar="BOARD",
    help="Scale by a calibration board, which is found: 'charuco, 8x6, 25 mm, 18 mm, 4x4_50'.",
)
@click.option(
    "--baseline",
    metavar="PAIRS",
    help="Scale by a stereo rig, as 'left, right = 120 mm': how the pictures' names begin.",
)
@click.option("--camera-height", "heights", multiple=True, metavar="HEIGHT",
              help="Scale by a picture's height over three points of the ground: 'a.jpg = 1.6 m over END | END | END'.")  # fmt: skip
@click.option("--positions", type=click.Path(path_type=Path), metavar="FILE",
              help="Scale by where pictures were taken: a table name,x,y,z[,u] in m, or name,lat,lon,alt[,u]; "
              "or tags, for the positions in the pictures' own files.")  # fmt: skip
@click.option("--accuracy", metavar="LENGTH", help='Of positions that state none, as "2 cm (1s)" for RTK.')
@click.option(
    "--unscaled", is_flag=True, help="Without a scale: write the scene in a unit of its own, measure nothing."
)
@click.option(
    "--camera", metavar="CAMERA", help="What is known of it; see `subtense measure --help`.  [default: by each picture]"
)
@click.option("--matching", default="exhaustive", show_default=True, help="exhaustive, sequential or position.")
@click.option("--mapping", default="incremental", show_default=True, help="incremental or global.")
@click.option(
    "--features", type=click.IntRange(100, 100_000), default=8192, show_default=True, help="Most features of a picture."
)
@click.option(
    "--photos", type=click.Path(path_type=Path), metavar="FOLDER", help="Where the pictures of an existing scene are."
)
@click.option("-o", "--output", "outputs", multiple=True, type=click.Path(path_type=Path),
              help="Write the scene: .ply, .las, .laz, .geojson, .json, or a folder for COLMAP's files.")  # fmt: skip
@click.option("--pair", "pairs", multiple=True, metavar="RIG",
              help="Write two pictures as a rig, for `subtense stereo`: 'a.jpg, b.jpg = rig.json'.")  # fmt: skip
@click.option("--format", "form", type=click.Choice(["text", "json"]), default="text", show_default=True)
@click.option("--level", type=float, default=0.95, show_default=True, help="Coverage of the intervals.")
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of the Monte Carlo draws.")
def reconstruct(folder: Path, measures: tuple[str, ...], camera: str | None, matching: str, mapping: str, features: int,
                photos: Path | None, outputs: tuple[Path, ...], pairs: tuple[str, ...], form: str, level: float, seed: int, unscaled: bool,
                **told: Any) -> None:  # fmt: skip
    """A scene from the pictures in FOLDER, in metres by what is known of its size, and lengths in it with their uncertainty.

    FOLDER may also hold a scene of COLMAP, OpenSfM or OpenDroneMap. Pictures alone have no scale: without one of --distance,
    --marker-size, --things, --board, --baseline, --camera-height or --positions there are no metres, and nothing is measured.
    """
    from ..workflow.reconstruct_command import Run, run

    asked = Run(
        folder, measures, camera, matching, mapping, features, photos, outputs, level, seed, pairs, unscaled, told
    )
    with _working() as progress:
        shown = run(asked, form, progress)
    click.echo(shown)
