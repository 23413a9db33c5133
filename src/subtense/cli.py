"""The command line: arguments to nouns, and documents to text. It contains no measuring logic."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from . import __version__
from .commands.ground import standing_options as _standing_options
from .commands.ground import standing_texts as _standing_texts
from .commands.options import output_options as _output_options
from .commands.options import search_options as _search_options
from .commands.options import searching as _searching
from .commands.options import show as _show
from .commands.options import write_overlay as _write_overlay
from .errors import SubtenseError

if TYPE_CHECKING:
    from .board import Board
    from .calibration import Calibration
    from .method import Method
    from .quantity import Quantity


_ELSEWHERE = {
    "depth": ("depth", "Distances in PHOTO by a depth map: of a network that you fetched, or one made elsewhere, as by a depth camera."),
    "depth-models": ("depth", "Networks of depth: what each gives, how far off it was where that was published, its licence, and how to "
                     "have it."),
    "fuse": ("together", "One number from several measurements of the same thing, each in a JSON file that --format json wrote."),
    "ground": ("ground", "Distances, lengths and speeds on the ground of PHOTO, by the camera's height above it and how it looks down."),
    "methods": ("together", "Which methods can answer with what is known: FACTS are names of inputs, as camera, ends, size, foot, height."),
    "plan": ("plan", "Which set-up measures a distance as well as is wanted, and how well a given set-up does."),
    "plane": ("plane", "Lengths, areas and angles in a plane of PHOTO, by what holds in it: right angles, parallels, equal and known "
              "lengths."),
    "reconstruct": ("scenes", "A scene from the pictures in FOLDER, in metres by what is known of its size, and lengths in it with their "
                    "uncertainty."),
    "stereo": ("stereo", "Distances from LEFT and RIGHT, two pictures of a rig: of pixels, of boxes, between pixels, and of every pixel."),
    "triangulate": ("scenes", "Points seen in two or more PHOTOS of one camera that was moved by a known length without turning it, or "
                    "from known places."),
}  # fmt: skip
"""Commands by the module of `commands` that has them, which is loaded when one of them is asked for, and what the list of commands says."""


class _Group(click.Group):
    """Turns our errors into one line and their exit code; anything else keeps its traceback."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted({*super().list_commands(ctx), *_ELSEWHERE})

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _ELSEWHERE:
            return super().get_command(ctx, cmd_name)
        from importlib import import_module

        found: click.Command = getattr(
            import_module(f".commands.{_ELSEWHERE[cmd_name][0]}", __package__), cmd_name.replace("-", "_")
        )
        return found

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The list of commands, without loading those that stand elsewhere."""
        names = self.list_commands(ctx)
        width = formatter.width - 6 - max(map(len, names))
        rows = []
        for name in names:
            command = (
                click.Command(name, help=_ELSEWHERE[name][1]) if name in _ELSEWHERE else super().get_command(ctx, name)
            )
            if command is not None and not command.hidden:
                rows.append((name, command.get_short_help_str(width)))
        with formatter.section("Commands"):
            formatter.write_dl(rows)

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except SubtenseError as error:
            click.echo(f"subtense: {_one_line(str(error))}", err=True)
            ctx.exit(error.exit_code)
        except click.UsageError as error:
            where = error.ctx.command_path if error.ctx else "subtense"
            click.echo(f"subtense: {_one_line(error.format_message())} See {where} --help", err=True)
            ctx.exit(error.exit_code)
        except BrokenPipeError:
            sys.stderr.close()
            ctx.exit(0)


def _one_line(text: str) -> str:
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="subtense")
def main() -> None:
    """Distances from images, each with the uncertainty it deserves.

    Lengths may carry a unit and a doubt: "5 m", "6 ft 2 in", "200 ± 0.5 mm". A bare ± is a 95 % half-width; write
    (1s) or (limits) behind it for a standard deviation or hard limits.
    """


@main.command(epilog="Example: subtense calc --focal 35 --sensor-width 14.1 --image-width 4096 --size 200 --extent 150")
@click.option("--focal", metavar="LENGTH", help="Focal length; mm if bare.")
@click.option("--size", metavar="LENGTH", help="Real size of the object; mm if bare.")
@click.option("--extent", metavar="PIXELS", help="Its length in the picture, px.")
@click.option("--distance", metavar="LENGTH", help="Depth along the axis; mm if bare.")
@click.option("--sensor-width", metavar="LENGTH", help="Width of the sensor; mm if bare.")
@click.option("--sensor-height", metavar="LENGTH", help="Instead of the width; needs --image-height.")
@click.option("--sensor-diagonal", metavar="LENGTH", help="Instead of the width; needs --image-height.")
@click.option("--image-width", metavar="PIXELS", help="Width of the picture, px.")
@click.option("--image-height", metavar="PIXELS", help="Height of the picture, px.")
@click.option("--preset", metavar="NAME", help="A camera class or sensor, see `subtense presets`.")
@click.option("--along", type=click.Choice(["width", "height"]), default="width", show_default=True,
              help="Which way the extent was measured.")  # fmt: skip
@click.option("--aspect", metavar="RATIO", help="Pixel width over pixel height.  [default: 1]")
@click.option(
    "--tilt", metavar="ANGLE", help='Of the object to the image plane, as "0 ± 20 deg (limits)".  [default: 0]'
)
@click.option("--offset", metavar="X,Y", help="Of the object's middle from the picture's, px.  [default: 0,0]")
@_output_options
def calc(form: str, files: tuple[Path, ...], level: float, seed: int, **text: str | None) -> None:
    """Distance = size x focal length in pixels / extent in pixels; leave one value out to solve for it.

    Leave out --distance, --size, --extent, --focal, --sensor-width or --image-width. What is said without ± gets an
    honest default, marked "assumed".
    """
    from .workflow.calculate import calculate
    from .workflow.calculator_input import calculator_input

    inputs, image_height = calculator_input(text)
    _show(calculate(inputs, image_height=image_height, level=level, seed=seed), form, files)


class _UnnamedContext(click.Context):
    """That of a command without a name, which leaves a space less in the path to it."""

    @property
    def command_path(self) -> str:
        return super().command_path.strip()


class _Unnamed(click.Command):
    context_class = _UnnamedContext


class _Camera(click.Group):
    """`camera PHOTO` with options of its own, or one of the commands below it."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """What is no command's name is a photo or an option of the command without a name."""
        if not (args and (args[0] in self.commands or args[0] in ctx.help_option_names)):
            args = [_UNNAMED, *args]
        return super().parse_args(ctx, args)

    def collect_usage_pieces(self, ctx: click.Context) -> list[str]:
        """Both ways to call it."""
        return ["PHOTO [OPTIONS]", "|", *super().collect_usage_pieces(ctx)[1:]]

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The options of the command without a name, then the commands."""
        self.commands[_UNNAMED].format_options(ctx, formatter)
        self.format_commands(ctx, formatter)


_UNNAMED = ""


@main.group(cls=_Camera, epilog="Example: subtense camera examples/desk.jpg")
def camera() -> None:
    """Which camera took PHOTO, by every source: what was chosen, why, and what the others say."""


@camera.command(_UNNAMED, cls=_Unnamed, hidden=True)
@click.argument("photo", type=click.Path(path_type=Path))
@click.option("--camera", metavar="CAMERA", help="What is known of it; see `subtense measure --help`.")
@click.option("--format", "form", default="text", show_default=True, help="text, json or csv.")
@click.option("--private", is_flag=True, help="Print position, altitude above the sea and serial numbers instead.")
def camera_of(photo: Path, camera: str | None, form: str, private: bool) -> None:
    """Which camera took PHOTO, by every source: what was chosen, why, and what the others say."""
    if private:
        _show_private(photo)
        return
    from .photo import Photo
    from .workflow.measure import camera_document

    picture = Photo.load(photo)
    _show(camera_document(picture, camera), form, photo=picture)


def _show_private(photo: Path) -> None:
    """What no report has: it is read and printed here only."""
    from .private_tags import private_tags

    found = private_tags(photo)
    click.echo(
        "\n".join(f"{what}: {value}" for what, value in found.items())
        or "the file tells no position and no serial number"
    )


@camera.command(epilog="Example: subtense camera convert calib.yml#640x480 cameras.txt")
@click.argument("source", metavar="A")
@click.argument("target", metavar="B", type=click.Path(path_type=Path))
@click.option("--from", "from_form", metavar="FORMAT", help="Format of A.  [default: told by what it says]")
@click.option("--to", "to_form", metavar="FORMAT", help="Format of B.  [default: by its ending]")
def convert(source: str, target: Path, from_form: str | None, to_form: str | None) -> None:
    """Write the calibration file A again as B, with every digit.

    Formats: subtense, opencv, opencv_xml, opencv_json, ros, kalibr, colmap, colmap_bin, mrcal, opensfm, matlab, open3d.
    What A does not say stands behind its name: A#640x480 (picture size), A#cam1 (which camera), A#fisheye.
    """
    from .workflow.convert_camera import convert_camera

    if lost := convert_camera(source, target, from_form=from_form, to_form=to_form):
        click.echo(f"note: {_one_line(lost)}", err=True)


@main.command(
    epilog="Examples: subtense measure examples/desk.jpg --marker-size '50 mm' --overlay out.png; subtense measure street.jpg"
)
@click.argument("photo", type=click.Path(path_type=Path))
@click.option(
    "--line", "lines", multiple=True, metavar="X1,Y1,X2,Y2", help="Two ends of an object, px; may be repeated."
)
@click.option(
    "--size",
    "sizes",
    multiple=True,
    metavar="LENGTH",
    help="Its real size, mm if bare; one for all lines or one each. Without lines, of what is found and nothing else tells.",
)
@click.option(
    "--outline",
    "outlines",
    multiple=True,
    metavar="PLACE",
    help="Find the outline of what is at X,Y or in the box X1,Y1,X2,Y2, px; --size is that of its --extent.",
)
@click.option(
    "--extent", default="longest", show_default=True, help="Of an outline: longest, shortest, width or height."
)
@click.option("--outline-model", metavar="FILE", help="Cut it out with this ONNX network, or one for people: person.")
@click.option("--tilt", metavar="ANGLE", help='Of the object to the image plane.  [default: "0 ± 20 deg (limits)"]')
@click.option("--snap", is_flag=True, help="Move the ends of lines to the edges and corners near them.")
@click.option(
    "--marker-size", metavar="LENGTH", help="Find ArUco and AprilTag markers; side of the black square, mm if bare."
)
@_search_options
@_standing_options
@click.option(
    "--between",
    multiple=True,
    metavar="A,B",
    help="How far apart two things are, by their numbers or names in the report; or all.",
)
@click.option("--same", multiple=True, metavar="A,B", help="These things are one and the same: one number from them.")
@click.option("--camera", metavar="CAMERA", help='A calibration file, "f=1500px", "f=35mm,sensor=14.1mm", "fov=70deg", or a preset.'
              "  [default: from the photo's metadata]")  # fmt: skip
@click.option("--overlay", type=click.Path(path_type=Path), help="Write the photo with the result drawn on it.")
@_output_options
def measure(photo: Path, lines: tuple[str, ...], sizes: tuple[str, ...], outlines: tuple[str, ...], extent: str,
            outline_model: str | None, tilt: str | None, snap: bool, marker_size: str | None, camera: str | None,
            between: tuple[str, ...], same: tuple[str, ...], overlay: Path | None, form: str, files: tuple[Path, ...], level: float,
            seed: int, **told: Any) -> None:  # fmt: skip
    """Measure in PHOTO: objects of known size by their ends, or everything that is found by itself.

    Without --line or --outline it looks for markers, QR codes, sheets, faces, people, vehicles and more, and lists each
    with its distance and what its size is taken to be. Where it is told how the camera stands (--height, --pitch), what
    stands on the ground is ranged by that too: the better answer comes first, and the other is a check on it. Pixel
    (0, 0) is the centre of the top-left pixel of the upright picture.
    """
    from .photo import Photo
    from .workflow.found import Asked
    from .workflow.ground import GroundTexts
    from .workflow.measure_input import gray_will_do, measure_document
    from .workflow.report_of import report_of

    report_of(form)
    ground = GroundTexts(**_standing_texts(told))
    asked = Asked(**told)
    shown = overlay is not None or bool(files) or bool(outlines)
    picture = Photo.load(photo, gray=not shown and gray_will_do(asked, marker_size, lines))
    if outlines:
        from .workflow.outline import outline_document

        document = outline_document(picture, outlines, sizes, extent=extent, model=outline_model, tilt=tilt, camera=camera,
                                    level=level, seed=seed, beside=bool(lines or marker_size))  # fmt: skip
    else:
        with _searching() as progress:
            document = measure_document(picture, lines=lines, sizes=sizes, tilt=tilt, snap=snap, marker_size=marker_size,
                                        asked=asked, camera=camera, level=level, seed=seed, progress=progress, ground=ground,
                                        between=between, same=same)  # fmt: skip
    _write_overlay(document, picture, overlay)
    _show(document, form, files, picture)


@main.command(epilog="Example: subtense detect examples/desk.jpg --only markers --overlay seen.png")
@click.argument("photo", type=click.Path(path_type=Path))
@_search_options
@click.option(
    "--camera",
    metavar="CAMERA",
    help="What is known of the camera; it tells shapes apart. See `subtense measure --help`.",
)
@click.option("--overlay", type=click.Path(path_type=Path), help="Write the photo with what was found drawn on it.")
@click.option("--format", "form", type=click.Choice(["text", "json", "csv"]), default="text", show_default=True)
def detect(photo: Path, camera: str | None, overlay: Path | None, form: str, **told: Any) -> None:
    """What is found in PHOTO by itself: where, how well it is known, and what it is taken to be. Nothing is measured."""
    from .photo import Photo
    from .reports import detections as shown
    from .workflow.detect import detection_json, shapes_of
    from .workflow.found import Asked, found_in

    picture = Photo.load(photo)
    with _searching() as progress:
        found = found_in(picture, Asked(**told), camera, progress)
    if overlay is not None:
        from .reports.overlay import write

        write(shapes_of(found, picture), picture, overlay)
    rows = [detection_json(one) for one in found.detections]
    click.echo(getattr(shown, form)(rows, picture, found.notes))


@main.command(epilog="Example: subtense serve examples/desk.jpg")
@click.argument("photos", nargs=-1, type=click.Path(path_type=Path))
@click.option("--host", default="127.0.0.1", show_default=True, metavar="ADDRESS",
              help="Where to listen. One that others reach needs a password in SUBTENSE_PASSWORD.")  # fmt: skip
@click.option("--port", type=click.IntRange(1, 65535), default=8517, show_default=True)
@click.option("--name", "names", multiple=True, metavar="NAME", help="A further host name to answer to.")
@click.option(
    "--limit",
    "limits",
    multiple=True,
    metavar="NAME=VALUE",
    help="Another limit on what is sent, as upload_bytes=100000000.",
)
@click.option("--browser/--no-browser", default=True, show_default=True, help="Open the page in the browser.")
def serve(
    photos: tuple[Path, ...], host: str, port: int, names: tuple[str, ...], limits: tuple[str, ...], browser: bool
) -> None:
    """The page: the calculator, and measuring in PHOTOS. It answers to this machine only, and sends nothing anywhere."""
    import os

    from .web.serve import serve as run
    from .web.serve import settings_for

    settings = settings_for(host, port, os.environ.get("SUBTENSE_PASSWORD"), limits, names)
    run(settings, host, photos, browser=browser, say=lambda text: click.echo(text, err=True))


class _Methods(click.Group):
    """One command per row of METHODS, made from its Inputs when it is asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        from .workflow.tables import METHODS

        return list(METHODS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        from .workflow.tables import METHODS

        found = METHODS.get(cmd_name)
        return None if found is None else _method_command(found)


@main.group(cls=_Methods)
def method() -> None:
    """Any method by its own inputs: a camera, points, quantities, as text or @file.json.

    Nothing is assumed here: every quantity needs its ±, or the word exact. With --photo the camera is had from the picture,
    and what is left out is assumed as in `measure`.
    """


def _method_command(found: Method) -> click.Command:
    from .workflow.describe import field_text
    from .workflow.given import noun_types

    options = [
        click.Option(
            ["--" + name.replace("_", "-")], metavar=kind.__name__.upper(), help=field_text(found.inputs, name)
        )
        for name, kind in noun_types(found.inputs).items()
    ]
    inputs = click.Option(
        ["--inputs"], type=click.Path(path_type=Path), help="All of them in a JSON file, as under `given`."
    )

    in_photo = [
        click.Option(["--photo"], type=click.Path(path_type=Path),
                     help="The picture of the points; it tells the camera, or --camera does, and defaults are those of `measure`."),
        click.Option(["--overlay"], type=click.Path(path_type=Path), help="Write the photo with the result drawn on it."),
    ]  # fmt: skip

    @_output_options
    def run(
        form: str, files: tuple[Path, ...], level: float, seed: int, inputs: Path | None, photo: Path | None,
        overlay: Path | None, **texts: str | None,
    ) -> None:  # fmt: skip
        from .photo import Photo
        from .workflow.measure import measure_inputs

        said = {k: v for k, v in texts.items() if v is not None}
        picture = None if photo is None else Photo.load(photo)
        document = measure_inputs(found, inputs, said, photo=picture, level=level, seed=seed)
        if picture is not None:
            _write_overlay(document, picture, overlay)
        _show(document, form, files, picture)

    params = [*options, inputs, *in_photo, *reversed(run.__click_params__)]  # type: ignore[attr-defined]
    text = f"{found.title[0].upper()}{found.title[1:]}.\n\n{found.needs}"
    return click.Command(found.name, params=params, callback=run, help=text)


@main.command(
    epilog="Example: subtense calibrate shots/*.jpg --board charuco --squares 8x6 --square '25 mm' --marker '18 mm' "
    "--dictionary 4x4_50 -o camera.json"
)
@click.argument("images", nargs=-1, type=click.Path(path_type=Path), metavar="IMAGES...")
@click.option(
    "--board",
    "kind",
    default="charuco",
    show_default=True,
    metavar="KIND",
    help="chessboard, charuco, circles or aprilgrid.",
)
@click.option("--squares", metavar="COLUMNSxROWS", help="How many squares (circles, tags) across and down, as 10x7.")
@click.option("--square", metavar="LENGTH", help="Side of a square, mm if bare.")
@click.option("--marker", metavar="LENGTH", help="Side of a marker's black square, mm if bare.")
@click.option("--dictionary", metavar="NAME", help="Of the markers, as 4x4_50 or 36h11.")
@click.option("--legacy", is_flag=True, help="A ChArUco pattern of OpenCV before 4.6.")
@click.option("--printed", metavar="LENGTH", help="The pattern's whole width as measured on the print, mm if bare.")
@click.option(
    "--model",
    metavar="NAME",
    help="Lens model: pinhole, k1, k1k2, opencv4, opencv5, opencv8, opencv12, fisheye.  "
    "[default: what foretells unseen pictures best]",
)
@click.option("--square-pixels", is_flag=True, help="Hold the pixels square.")
@click.option("--stereo", is_flag=True, help="Two cameras: two folders, or all left IMAGES and then all right ones.")
@click.option(
    "--check", metavar="FILE", help="Audit this calibration by IMAGES instead; exit code 3 if it can't be trusted."
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="Write the camera: .json, or .yaml, .xml, .txt of other tools.",
)
@click.option("--report", type=click.Path(path_type=Path), help="Write a report: .html with pictures, .txt or .json.")
@click.option(
    "--plots", type=click.Path(path_type=Path), help="Write the pictures of the report as PNG into this folder."
)
@click.option("--format", "form", type=click.Choice(["text", "json"]), default="text", show_default=True)
def calibrate(images: tuple[Path, ...], kind: str, squares: str | None, square: str | None, marker: str | None, dictionary: str | None,
              legacy: bool, printed: str | None, model: str | None, square_pixels: bool, stereo: bool, check: str | None,
              output: Path | None, report: Path | None, plots: Path | None, form: str) -> None:  # fmt: skip
    """Calibrate a camera from IMAGES of a board (files or folders): intrinsics with their uncertainty, and how far to trust them.

    About 20 pictures at one focus and zoom: the board tilted by 30 to 45 degrees to each side, near and far, all over the picture.
    """
    from .workflow import calibrate as way
    from .workflow.calibrate_input import board_of, pairs_of, pictures_of, printed_width
    from .workflow.calibration_output import check_report

    board = board_of(kind, squares, square, marker, dictionary, legacy=legacy)
    width = printed_width(printed)
    if report is not None:
        check_report(report)
    if check is not None:
        _audit(check, pictures_of(images), board, width, form)
        return
    if stereo:
        left, right = pairs_of(images)
        with _progress(len(left) + len(right)) as told:
            found = way.calibrate_rig(
                left, right, board, printed=width, model=model, square_pixels=square_pixels, progress=told
            )
    else:
        pictures = pictures_of(images)
        with _progress(len(pictures)) as told:
            found = way.calibrate(
                pictures, board, printed=width, model=model, square_pixels=square_pixels, progress=told
            )
    _show_calibration(found, form, output, report, plots)


@contextmanager
def _progress(pictures: int) -> Iterator[Callable[[int, int], None]]:
    """A bar on the terminal's error stream, told (done, of how many); nothing where that is no terminal."""
    with click.progressbar(
        length=pictures, label="Finding the board", file=sys.stderr, hidden=not sys.stderr.isatty()
    ) as bar:
        yield lambda done, _: bar.update(done - bar.pos)


def _show_calibration(
    found: Calibration, form: str, output: Path | None, report: Path | None, plots: Path | None
) -> None:
    import json

    from .reports.calibration_text import text
    from .workflow.calibration_output import camera_file, report_file

    if output is not None and (lost := camera_file(found, output)):
        click.echo(f"subtense: {lost}", err=True)
    if report is not None:
        report_file(found, report)
    if plots is not None:
        from .reports.calibration_plots import png_files

        png_files(found, plots)
    click.echo(json.dumps(found.to_json(), allow_nan=False) if form == "json" else text(found))


def _audit(check: str, pictures: list[Path], board: Board, width: Quantity | None, form: str) -> None:
    import json

    from .camera_files import selector
    from .camera_sources import calibration_file
    from .reports.audit_text import text
    from .workflow.audit import audit

    path, pick = selector.split(check)
    stated = calibration_file.read(path, pick).camera
    with _progress(len(pictures)) as told:
        found = audit(stated, pictures, board, printed=width, progress=told)
    click.echo(json.dumps(found.to_json(), allow_nan=False) if form == "json" else text(found))
    if not found.trusted:
        sys.exit(3)


@main.command(
    epilog="Example: subtense board charuco --squares 10x7 --square '25 mm' --marker '18 mm' --dictionary 4x4_50 -o board.pdf"
)
@click.argument("kind", metavar="KIND")
@click.option("--squares", metavar="COLUMNSxROWS", help="How many squares (circles, tags) across and down, as 10x7.")
@click.option("--square", metavar="LENGTH", help="Side of a square, mm if bare; of circles the distance from row to row, "
              "of an AprilGrid from a tag's left side to the next tag's.")  # fmt: skip
@click.option("--marker", metavar="LENGTH", help="Side of a marker's black square, mm if bare.")
@click.option("--dictionary", metavar="NAME", help="Of the markers, as 4x4_50 or 36h11.")
@click.option("--legacy", is_flag=True, help="A ChArUco pattern of OpenCV before 4.6.")
@click.option("--paper", default="A4", show_default=True, metavar="PAPER",
              help="A4, A3, A2, letter, legal, tabloid, or width x height in mm, as 300x400.")  # fmt: skip
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="Write it here: .pdf or .svg.")
def board(kind: str, squares: str | None, square: str | None, marker: str | None, dictionary: str | None, legacy: bool,
          paper: str, output: Path) -> None:  # fmt: skip
    """A calibration board to print at exact scale, with rulers to check the print: KIND is chessboard, charuco, circles
    or aprilgrid.
    """
    from .reports.board_sheet import write
    from .workflow.calibrate_input import board_of

    made = board_of(kind, squares, square, marker, dictionary, legacy=legacy)
    sheet = write(made, output, paper)
    click.echo(f"{output}: {made.text}, on paper of {sheet.width_mm:g} x {sheet.height_mm:g} mm")
    wide_mm = made.width_m * 1000
    click.echo(f"Print it at 100 %, measure {wide_mm:.6g} mm across, and give what you find to calibrate --printed.")


@main.command()
@click.argument("words", nargs=-1)
def presets(words: tuple[str, ...]) -> None:
    """Camera classes and sensors that --preset and --camera know."""
    from .presets import presets as table
    from .reports.table import preset_table

    click.echo(
        preset_table([p for p in table().values() if all(w.lower() in f"{p.name} {p.title}".lower() for w in words)])
    )


@main.command()
@click.argument("words", nargs=-1)
def sensors(words: tuple[str, ...]) -> None:
    """Sensors of phones' lenses, drones, camera boards and machine vision: what is known of a camera by its name."""
    from .reports.table import sensor_table
    from .sensors import search

    click.echo(sensor_table(search(words)))


@main.command()
@click.argument("words", nargs=-1)
@click.option("--file", "extra", type=click.Path(path_type=Path), help="More of them, from a TOML file of your own.")
def targets(words: tuple[str, ...], extra: Path | None) -> None:
    """Things of known size: paper, cards, coins, plates, signs, balls, bodies, ..., each with its doubt."""
    from .reports.table import target_table
    from .targets import search

    click.echo(target_table(search(words, extra)))
