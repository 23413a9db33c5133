"""`subtense depth`: distances in a photo by a depth map, of a network or made elsewhere; `subtense depth-models`: the table."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .ground import standing_options, standing_texts
from .options import output_options, searching, show, write_overlay

if TYPE_CHECKING:
    from ..photo import Photo
    from ..workflow.depth import Anchored


def model_folder() -> Path:
    """Where networks of depth are looked for, unless another folder is named."""
    return Path.home() / ".local" / "share" / "subtense" / "depth_models"


FOLDER = click.option(
    "--models", "folder", type=click.Path(path_type=Path), metavar="FOLDER",
    help="Where networks lie.  [default: ~/.local/share/subtense/depth_models]",
)  # fmt: skip
WHERE = (
    click.option("--point", "points", multiple=True, metavar="X,Y", help="How far what is seen there is; may be repeated."),
    click.option("--box", "boxes", multiple=True, metavar="LEFT,TOP,RIGHT,BOTTOM",
                 help="The same of the middle half of a box around a thing."),
    click.option("--between", "pairs", multiple=True, metavar="X1,Y1;X2,Y2",
                 help="The straight distance between what is seen at two points."),
    click.option("--anchor", "anchors", multiple=True, metavar="WHERE=WHAT",
                 help="What is known: '320,240 = 3.2 ± 0.1 m' (range), '320,240 = depth 3.2 m', '320,90;322,700 = 1.75 m' (a "
                 "size), '320,700 = ground'."),
    click.option("--anchor-by", "things", multiple=True, metavar="NAME[=SIZE]",
                 help="Find it and anchor the map by it: 'markers = 50 mm', a4, person; see `subtense targets`."),
)  # fmt: skip
"""What to measure, and what is known."""
MAP = (
    click.option("--prefer", metavar="NAME", help="The network, as in `subtense depth-models`.  [default: the only one here]"),
    click.option("--model", type=click.Path(path_type=Path), metavar="FILE", help="The network's ONNX file."),
    FOLDER,
    click.option("--depth", "file", type=click.Path(path_type=Path), metavar="FILE",
                 help="A map made elsewhere instead: 16-bit .png, .pfm or .npy."),
    click.option("--depth-unit", "unit", metavar="LENGTH", help="What one number of it is, as '1 mm' or '1/256 m'."),
    click.option("--depth-error", "error", metavar="ERROR", help="How well its depths are known, as '1 %' or '5 mm + 1 %'; of a "
                 "network in place of its published error."),
    click.option("--gives", metavar="KIND", help="What the numbers of a file, or of a network of your own, are: metric, scaled, "
                 "affine or disparity; range in a file."),
    click.option("--takes", metavar="HOW", help="How a network of your own takes pixels: imagenet, imagenet_inside, half, unit."),
)  # fmt: skip
"""Which map."""
WRITTEN = (
    click.option("--depth-map", type=click.Path(path_type=Path), help="Write the depths: .png (mm), .pfm or .npy (m)."),
    click.option("--sigma-map", type=click.Path(path_type=Path), help="Write their standard deviations likewise."),
    click.option("--depth-picture", type=click.Path(path_type=Path), help="Write the depths as a picture in colours."),
    click.option("--cloud", type=click.Path(path_type=Path), help="Write points in colour: .ply, .las or .laz."),
)
"""Files of the map."""


def _options(command: Any) -> Any:
    for option in reversed((*WHERE, *MAP)):
        command = option(command)
    return command


def _written(command: Any) -> Any:
    for option in reversed(WRITTEN):
        command = option(command)
    return command


@click.command(
    epilog="Examples: subtense depth photo.jpg --prefer metric3d-v2-small --point 640,400 --anchor '320,240 = 3.2 ± 0.02 m'; "
    "subtense depth photo.jpg --depth sensor.png --depth-unit '1 mm' --depth-error '1 %' --between '100,200;400,210'"
)
@click.argument("photo", type=click.Path(path_type=Path))
@_options
@standing_options
@click.option("--camera", metavar="CAMERA", help="What is known of it; see `subtense measure --help`.")
@_written
@click.option("--overlay", type=click.Path(path_type=Path), help="Write the photo with the result drawn on it.")
@output_options
def depth(photo: Path, points: tuple[str, ...], boxes: tuple[str, ...], pairs: tuple[str, ...], anchors: tuple[str, ...],
          things: tuple[str, ...], folder: Path | None, camera: str | None, depth_map: Path | None, sigma_map: Path | None,
          depth_picture: Path | None, cloud: Path | None, overlay: Path | None, form: str, files: tuple[Path, ...],
          level: float, seed: int, **told: Any) -> None:  # fmt: skip
    """Distances in PHOTO by a depth map: of a network that you fetched, or one made elsewhere, as by a depth camera.

    Known distances or sizes in the picture (anchors) fix the map's scale, and its shift where that is open; without one, the
    network's published error is the doubt. No network comes with this package, and none is fetched: `subtense depth-models`
    says how to have one.
    """
    from ..errors import InputError
    from ..photo import Photo
    from ..workflow.depth import Wanted, depth_document
    from ..workflow.depth_source import DepthTexts
    from ..workflow.ground import GroundTexts
    from ..workflow.report_of import report_of

    report_of(form)
    written = {"--depth-map": depth_map, "--sigma-map": sigma_map, "--depth-picture": depth_picture, "--cloud": cloud}
    if not (points or boxes or pairs or any(written.values())):
        how = "say where to measure, as --point 640,400, --box 100,80,300,240 or --between '100,200;400,210'"
        raise InputError("--point", None, how)
    _check(written)
    ground = GroundTexts(**standing_texts(told))
    said = DepthTexts(**told, folder=folder or model_folder())
    picture = Photo.load(photo)
    with searching() as progress:
        document, found = depth_document(picture, said, Wanted(points, boxes, pairs), anchors=anchors, things=things,
                                         ground=ground, camera=camera, level=level, seed=seed, progress=progress)  # fmt: skip
    _write(written, found, picture)
    write_overlay(document, picture, overlay)
    show(document, form, files, picture)


def _check(written: dict[str, Path | None]) -> None:
    """Refuse names of files that can't be written, before the work is done."""
    from ..reports.depth_files import check

    for option, path in written.items():
        if path is not None:
            check(path, option)


def _write(written: dict[str, Path | None], found: Anchored, picture: Photo) -> None:
    """The map's files, as far as they were asked for."""
    if not any(written.values()):
        return
    from ..reports import depth_files
    from ..workflow.depth import depth_map_of

    made = depth_map_of(found)
    for option, values in (("--depth-map", made.depth_m), ("--sigma-map", made.sigma_m)):
        path = written[option]
        if path is not None:
            depth_files.write_map(values, path, option)
    if (path := written["--depth-picture"]) is not None:
        depth_files.write_picture(made, path, "--depth-picture")
    if (path := written["--cloud"]) is not None:
        depth_files.write_cloud(made, picture.pixels, path, "--cloud")


@click.command("depth-models")
@click.argument("words", nargs=-1)
@FOLDER
def depth_models(words: tuple[str, ...], folder: Path | None) -> None:
    """Networks of depth: what each gives, how far off it was where that was published, its licence, and how to have it."""
    from ..depth_models import search
    from ..reports.table import columns
    from ..workflow.depth_source import here

    place = folder or model_folder()
    kinds = {"points": "metric", "disparity": "relative"}
    lines = [("name", "gives", "error (1s)", "licence", "here", "what it is")]
    for row in search(words):
        error = "needs anchors" if row.relative else f"{100 * row.u_total:.0f} %"
        told = "by transformers" if row.runs == "transformers" else "yes" if here(row, place) else "no"
        lines.append((row.name, kinds.get(row.gives, row.gives), error, row.licence, told, row.title))
    click.echo(columns(lines))
    for row in search(words):
        click.echo(f"\n{row.name}\n  {row.how_to_have(place)}\n  {row.source}")
        click.echo(
            f"  error: {row.doubt}"
            if not row.relative
            else f"  needs anchors; beside them {100 * row.u_local:.0f} % (1s)"
        )
