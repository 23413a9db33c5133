"""`subtense stereo`: distances and depth maps from the two pictures of a rig."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from .options import output_options, show, write_overlay

FILES = (
    ("depth-map", "Depths: .png (16 bit, mm), .pfm, .npy (m)."),
    ("sigma-map", "Their standard deviations, in the same formats."),
    ("depth-picture", "Depths in colour, with a scale: .png or .jpg."),
    ("cloud", "Points of the left picture's matched pixels: .ply, .las or .laz."),
    ("error-plot", "Standard deviation against depth: .csv, or .png with the extra `plots`."),
)


def _files(command: Any) -> Any:
    for name, text in reversed(FILES):
        command = click.option(f"--{name}", metavar="FILE", type=click.Path(path_type=Path), help=text)(command)
    return command


@click.command(
    epilog="Example: subtense stereo left.png right.png --rig rig.json --at 320,240 --depth-map depth.png --cloud scene.ply"
)
@click.argument("left", type=click.Path(path_type=Path))
@click.argument("right", type=click.Path(path_type=Path))
@click.option("--rig", multiple=True, metavar="FILE", help="Of `subtense calibrate --stereo`, OpenCV, ROS (two files), Kalibr, Middlebury "
              "or KITTI; FILE#P2 names one of several.")  # fmt: skip
@click.option(
    "--baseline",
    metavar="LENGTH",
    help='Distance of the cameras, as "120 ± 0.5 mm"; with --camera where there is no rig.',
)
@click.option("--camera", metavar="CAMERA", help='Of a rectified pair without a rig\'s file, as "f=700 ± 2 px".')
@click.option(
    "--doffs", metavar="PIXELS", help="Principal point of the right picture less the left one's.  [default: 0 ± 0.5 px]"
)
@click.option("--unit", default="", metavar="UNIT", help="Of lengths in an OpenCV file: m, cm, mm or in.")
@click.option(
    "--rectified", is_flag=True, help="The pictures are rectified, though the rig's file is of cameras with distortion."
)
@click.option("--at", multiple=True, metavar="X,Y", help="Distance of what this pixel of LEFT shows; may be repeated.")
@click.option("--box", "boxes", multiple=True, metavar="X1,Y1,X2,Y2", help="Distance of what this box of LEFT shows.")
@click.option("--between", multiple=True, metavar="X1,Y1;X2,Y2", help="Length between what two pixels of LEFT show.")
@click.option(
    "--disparities", default="", metavar="LOW:HIGH", help="What to look for, px.  [default: as the pictures show]"
)
@click.option("--fill", is_flag=True, help="Give pixels without a match what is around them, with the doubt that has.")
@click.option("--smooth", is_flag=True, help="Smooth along the picture by weighted least squares, and fill.")
@click.option(
    "--model",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Match by this ONNX network of two pictures instead.",
)
@click.option(
    "--shutter", default="global", show_default=True, metavar="KIND", help="Of the cameras: global or rolling."
)
@_files
@click.option("--overlay", type=click.Path(path_type=Path), help="Write LEFT with the result drawn on it.")
@output_options
def stereo(left: Path, right: Path, overlay: Path | None, form: str, files: tuple[Path, ...], level: float, seed: int,
           depth_map: Path | None, sigma_map: Path | None, depth_picture: Path | None, cloud: Path | None, error_plot: Path | None,
           **told: Any) -> None:  # fmt: skip
    """Distances from LEFT and RIGHT, two pictures of a rig: of pixels, of boxes, between pixels, and of every pixel.

    Each has its interval, from the match, the focal lengths, the baseline and the turn between the cameras. A pair that is not
    rectified is rectified by itself. Without a question the answer is a summary of the depths.
    """
    from ..photo import Photo
    from ..workflow.report_of import report_of
    from ..workflow.stereo import Asked
    from ..workflow.stereo_output import Wanted, stereo_with_files

    report_of(form)
    wanted = Wanted(depth_map, sigma_map, depth_picture, cloud, error_plot)
    pair = Photo.load(left), Photo.load(right)
    document = stereo_with_files(*pair, Asked(**told), wanted, level=level, seed=seed)
    write_overlay(document, pair[0], overlay)
    show(document, form, files, pair[0])
