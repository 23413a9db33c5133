"""The command line: arguments to nouns, and documents to text. It contains no measuring logic."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from . import __version__
from .errors import SubtenseError

if TYPE_CHECKING:
    from .document import Document
    from .quantity import Quantity


class _Group(click.Group):
    """Turns our errors into one line and their exit code; anything else keeps its traceback."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except SubtenseError as error:
            click.echo(f"subtense: {_one_line(str(error))}", err=True)
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


def _output_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """--format, --level, --seed: the same for every command that measures."""
    for option in (
        click.option("--seed", type=int, default=0, show_default=True, help="Seed of the Monte Carlo draws."),
        click.option("--level", type=float, default=0.95, show_default=True, help="Coverage of the intervals."),
        click.option("--format", "form", default="text", show_default=True, help="text, json or csv."),
    ):
        command = option(command)
    return command


def _show(document: Document, form: str) -> None:
    from .workflow.tables import report_of

    click.echo(report_of(form)(document))


def _read(text: str | None, unit: str, bare: str, name: str, assume: Callable[[float, float], Quantity]) -> Quantity | None:
    from .quantity import Quantity

    return None if text is None else Quantity.parse(text, unit, bare=bare, name=name, assume=assume)


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
@click.option("--tilt", metavar="ANGLE", help='Of the object to the image plane, as "0 ± 20 deg (limits)".  [default: 0]')
@click.option("--offset", metavar="X,Y", help="Of the object's middle from the picture's, px.  [default: 0,0]")
@_output_options
def calc(form: str, level: float, seed: int, **text: str | None) -> None:
    """Distance = size x focal length in pixels / extent in pixels; leave one value out to solve for it.

    Leave out --distance, --size, --extent or --focal. What is said without ± gets an honest default, marked "assumed".
    """
    from .workflow.calculator_input import calculator_input
    from .workflow.calculate import calculate

    inputs, image_height = calculator_input(text)
    _show(calculate(inputs, image_height=image_height, level=level, seed=seed), form)


@main.command()
@click.argument("words", nargs=-1)
def presets(words: tuple[str, ...]) -> None:
    """Camera classes and sensors that --preset and --camera know."""
    from .presets import presets as table
    from .reports.table import preset_table

    click.echo(preset_table([p for p in table().values() if all(w.lower() in f"{p.name} {p.title}".lower() for w in words)]))
