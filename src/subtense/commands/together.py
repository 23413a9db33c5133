"""`subtense fuse` and `subtense methods`: one number from several measurements, and which methods can answer."""

from __future__ import annotations

from pathlib import Path

import click

from .options import output_options, show


@click.command(epilog="Example: subtense fuse near.json far.json#person --what range")
@click.argument("sources", nargs=-1, metavar="FILE[#LABEL]...")
@click.option("--what", metavar="WHAT", help="range, depth, length, ...  [default: the first that all of them have]")
@output_options
def fuse(
    sources: tuple[str, ...], what: str | None, form: str, files: tuple[Path, ...], level: float, seed: int
) -> None:
    """One number from several measurements of the same thing, each in a JSON file that --format json wrote.

    What they have in common (the camera, a reference, an assumption) does not average away. Where they contradict each
    other it is said, and the interval is widened or the one that is wrong left out.
    """
    from ..workflow.report_of import report_of
    from ..workflow.together import fuse_files

    report_of(form, photo=False)
    document, _ = fuse_files(sources, what, level=level, seed=seed)
    show(document, form, files)


@click.command(epilog="Example: subtense methods camera ends size --what range")
@click.argument("facts", nargs=-1)
@click.option("--what", metavar="WHAT", help="Only those that measure this: range, length, height, speed, ...")
def methods(facts: tuple[str, ...], what: str | None) -> None:
    """Which methods can answer with what is known: FACTS are names of inputs, as camera, ends, size, foot, height.

    Without FACTS all methods with what each needs.
    """
    from ..reports.table import method_table
    from ..workflow.applicable import applicable

    rows = []
    for one in applicable(facts, what):
        measures = ", ".join(output.what for output in one.method.outputs[:2])
        rows.append((one.method.name, measures, ", ".join(one.missing) or "nothing", one.method.title))
    click.echo(method_table(rows))
