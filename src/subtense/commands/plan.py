"""`subtense plan`: which set-up reaches an accuracy, and what a set-up gives."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

OPTIONS = (
    ("focal", "LENGTH", 'Focal length, mm if bare, with --sensor; or in pixels, as "1500 ± 5 px".'),
    ("sensor", "LENGTH", "Width of the sensor, mm if bare, or a preset's name, as 1/2.3 or aps-c."),
    ("width-px", "PIXELS", "Width of the picture."),
    ("height-px", "PIXELS", "Height of the picture.  [default: three quarters of its width]"),
    ("size", "LENGTH", "known_size: real size of the object, mm if bare."),
    ("tilt", "ANGLE", 'known_size: of the object to the image plane.  [default: "0 ± 20 deg (limits)"]'),
    ("baseline", "LENGTH", "stereo: distance of the two cameras."),
    ("offset-error", "PIXELS", "stereo: ± of the difference of the two principal points."),
    ("height", "LENGTH", "ground, drone: of the camera above the ground, m if bare."),
    ("pitch", "ANGLE", "ground: of the camera above the horizon.  [default: aimed at the distance]"),
    ("pitch-error", "ANGLE", "ground, drone: ± of the pitch."),
    ("roll-error", "ANGLE", "ground, drone: ± of the roll."),
    ("slope", "ANGLE", 'ground, drone: of the ground, as "0 ± 0.2 deg".'),
    ("pixel-error", "PIXELS", "± of each end, of the foot point, or of the disparity."),
)
"""Numbers of a set-up: each is assumed, and said so, where it is left out."""


def _numbers(command: Callable[..., Any]) -> Callable[..., Any]:
    for name, kind, text in reversed(OPTIONS):
        command = click.option(f"--{name}", metavar=kind, help=text)(command)
    return command


@click.command(
    epilog="Example: subtense plan --distance '20 m' --accuracy '5 cm' --way stereo --baseline '50 cm ± 0.1 %'"
)
@click.option(
    "--distance",
    required=True,
    metavar="LENGTH",
    help="Of what is to be measured; with `drone`, its length on the ground.",
)
@click.option(
    "--accuracy",
    metavar="LENGTH",
    help='Half-width of the 95 % interval that is wanted, as "5 cm" or "1 %"; or "2.5 cm (1s)".',
)
@click.option("--way", metavar="WAY", help="known_size, ground, stereo or drone.  [default: all that fit what is said]")
@click.option("--solve", multiple=True, metavar="NUMBER", help="Solve for this only: focal, width-px, size, baseline, height, distance, "
              "or how well one must be known, as focal-error; may be repeated.")  # fmt: skip
@_numbers
@click.option(
    "--calibrated",
    is_flag=True,
    help="The camera is calibrated: its focal length is known to 0.2 % (1s) where no ± is said.",
)
@click.option("--between", metavar="DISTANCES", help='Of the table and the chart, as "1 m to 50 m".')
@click.option(
    "--chart", type=click.Path(path_type=Path), help="Draw the error against distance into this .png or .svg file."
)
@click.option("--format", "form", type=click.Choice(["text", "json"]), default="text", show_default=True)
def plan(solve: tuple[str, ...], between: str | None, chart: Path | None, form: str, **texts: Any) -> None:
    """Which set-up measures a distance as well as is wanted, and how well a given set-up does.

    What is said is held; one number at a time is solved for, and what it would take to know all of them better is told.
    A bare ± is a 95 % half-width; write (1s) or (limits) behind it for a standard deviation or hard limits.
    """
    from .. import __version__
    from ..reports import plan_chart, plan_json, plan_text
    from ..workflow.plan import plan as planned
    from ..workflow.plan_input import PlanTexts

    if chart is not None:
        plan_chart.check_ending(chart)
    found = planned(PlanTexts(**texts), solve=solve, between=between, curve=chart is not None)
    if chart is not None:
        plan_chart.write(found, chart)
    click.echo(plan_json.report(found, __version__) if form == "json" else plan_text.report(found))
