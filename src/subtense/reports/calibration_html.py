"""A calibration as one HTML file: nothing from elsewhere, no script, readable on a phone, in the dark and on paper."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from html import escape

from ..calibration import Calibration, Picture
from ..calibration_summary import (
    Number,
    bow_text,
    camera_numbers,
    camera_titles,
    fit_text,
    lengths,
    model_text,
    next_text,
    other_notes,
    percent,
    printable,
    reason,
    rig_numbers,
    size_text,
    verdict,
)
from ..plot import Plot
from .rounding import interval, number, rounded

STYLE = """
:root { color-scheme: light dark; --paper: #fff; --card: #f4f6f8; --ink: #1c1c1c; --quiet: #4f5963; --rule: #c3cad0;
  --good: #00644b; --gaps: #7a4d00; --doubtful: #a12d00; --accent: #1f5673; }
@media (prefers-color-scheme: dark) { :root { --paper: #14181c; --card: #1f252b; --ink: #eceff1; --quiet: #b1bbc4;
  --rule: #46515b; --good: #5fd0ac; --gaps: #f0bd5e; --doubtful: #ff9b73; --accent: #8cc4e2; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink); font: 1rem/1.5 system-ui, sans-serif; }
header, main { max-width: 76rem; margin: 0 auto; padding: 0 1.25rem; }
header { padding-top: 1.5rem; }
h1 { font-size: 1.6rem; line-height: 1.2; margin: 0 0 .25rem; }
h2 { font-size: 1.25rem; margin: 2.2rem 0 .6rem; color: var(--accent); }
h3 { font-size: 1rem; margin: 0 0 .3rem; }
p, ul, ol { margin: .4rem 0; max-width: 56rem; }
.quiet { color: var(--quiet); }
.verdict { background: var(--card); border-left: .4rem solid var(--accent); padding: .9rem 1.2rem; margin-top: 1.2rem; }
.verdict h2 { margin: 0 0 .3rem; font-size: 1.4rem; }
.verdict ul { padding-left: 1.2rem; }
.verdict.good { border-color: var(--good); } .good h2, .passed { color: var(--good); }
.verdict.gaps { border-color: var(--gaps); } .gaps h2 { color: var(--gaps); }
.verdict.doubtful { border-color: var(--doubtful); } .doubtful h2, .failed { color: var(--doubtful); }
.passed, .failed { font-weight: 700; }
code { white-space: nowrap; font-size: .95em; }
.wide { overflow-x: auto; margin: .8rem 0 1.4rem; }
table { border-collapse: collapse; width: 100%; font-size: .94rem; }
caption { text-align: left; font-weight: 700; padding: .3rem 0; }
th, td { text-align: left; vertical-align: top; padding: .32rem .9rem .32rem 0; border-bottom: 1px solid var(--rule); }
th:last-child, td:last-child { padding-right: 0; }
thead th { border-bottom: 2px solid var(--accent); vertical-align: bottom; }
tbody th { font-weight: 400; min-width: 9.5rem; }
.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
.name { overflow-wrap: anywhere; }
.words { min-width: 14rem; }
tr.headline th, tr.headline td { font-weight: 700; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .25rem 1.2rem; margin: .8rem 0; }
dt { color: var(--quiet); } dd { margin: 0; overflow-wrap: anywhere; }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 32rem), 1fr)); gap: 1.2rem; align-items: start; }
figure { margin: 0; background: #fff; color: #1c1c1c; border: 1px solid var(--rule); border-radius: .4rem; padding: .7rem; }
figure img { display: block; width: 100%; height: auto; max-height: 46rem; object-fit: contain; }
figcaption { font-size: .9rem; margin-top: .5rem; }
details summary { cursor: pointer; color: var(--accent); font-weight: 700; }
pre { overflow-x: auto; background: var(--card); padding: .8rem; font-size: .8rem; max-height: 40rem; }
main { padding-bottom: 3rem; }
@media (max-width: 40rem) { tbody th { min-width: 5.5rem; } .words { min-width: 11rem; }
  dl { grid-template-columns: 1fr; } dd { margin-bottom: .4rem; } }
@page { size: A4; margin: 15mm; }
@media print {
  :root { color-scheme: light; --paper: #fff; --card: #f4f6f8; --ink: #1c1c1c; --quiet: #4f5963; --rule: #c3cad0;
    --good: #00644b; --gaps: #7a4d00; --doubtful: #a12d00; --accent: #1f5673; }
  body { font-size: 10pt; } header, main { max-width: none; padding: 0; }
  .figures { display: block; } figure { break-inside: avoid; margin-bottom: 6mm; border: 0; padding: 0; }
  figure img { max-height: 105mm; width: auto; max-width: 100%; } h2 { break-after: avoid; }
  tr, .verdict { break-inside: avoid; } thead { display: table-header-group; } .wide { overflow: visible; }
  .screen { display: none; }
}
"""
SOURCES = (
    "Z. Zhang, A flexible new technique for camera calibration, IEEE Transactions on Pattern Analysis and Machine Intelligence 22, "
    "2000",
    "B. Triggs et al., Bundle adjustment: a modern synthesis, Vision Algorithms: Theory and Practice, 1999",
    "D. C. Brown, Close-range camera calibration, Photogrammetric Engineering 37, 1971 (lens models opencv4 to opencv12)",
    "J. Kannala and S. S. Brandt, A generic camera model and calibration method, IEEE Transactions on Pattern Analysis and Machine "
    "Intelligence 28, 2006 (lens model fisheye)",
    "D. Kogan, mrcal: projection uncertainty, deformation of the board, cross-validation",
)
NO_PLOTS = 'No pictures: they are drawn by matplotlib, which is not installed (pip install "subtense[plots]").'


def html(calibration: Calibration, plots: Sequence[Plot] = ()) -> str:
    """The calibration as a self-contained page.

    Args:
        calibration: what to show.
        plots: its pictures, as `calibration_plots.plots` draws them; without them the page says how to have them.
    """
    digest = base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode()
    policy = f"default-src 'none'; img-src data:; style-src 'sha256-{digest}'; base-uri 'none'; form-action 'none'"
    title = "Calibration of two cameras" if calibration.rig else "Calibration of a camera"
    parts = (_verdict, _numbers, _checks)
    body = "\n".join(line for part in parts for line in part(calibration))
    rest = "\n".join(line for part in (_pictures, _computed, _json) for line in part(calibration))
    figures = "\n".join(_figures(plots))
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<meta name="referrer" content="no-referrer">
<title>{title}</title>
<style>{STYLE}</style>
</head>
<body>
<header>
<h1>{title}</h1>
<p class="quiet">{_told(_what(calibration))}</p>
</header>
<main>
{body}
{figures}
{rest}
</main>
</body>
</html>
"""


def _told(text: str) -> str:
    """Text of strangers in HTML; a number and its percent sign stay together, and so do options."""
    return re.sub(r"--[a-z]+", r"<code>\g<0></code>", _plain(text))


def _plain(text: str) -> str:
    """The same without markup, as attributes need it."""
    return escape(printable(text)).replace(" %", "&nbsp;%")


def _what(calibration: Calibration) -> str:
    used, all_ = len(calibration.used), len(calibration.pictures)
    many = f"{used}" if used == all_ else f"{used} of {all_}"
    return f"{size_text(calibration)}, from {many} pictures of a {calibration.board.text}"


def _verdict(calibration: Calibration) -> Iterator[str]:
    """The first thing to read: may I use it, for what, and what to do next."""
    found = verdict(calibration)
    yield f'<section class="verdict {found.grade}" aria-labelledby="verdict">'
    yield f'<h2 id="verdict">{_told(found.title)}</h2>'
    yield "<ul>" + "".join(f"<li>{_told(sentence)}</li>" for sentence in found.sentences) + "</ul>"
    said = lengths(calibration.board)
    yield f"<p>{_told(said[0].upper() + said[1:])}.</p>"
    yield f"<p><strong>Next picture:</strong> {_told(next_text(calibration))}.</p>"
    yield "</section>"


# -- numbers -----------------------------------------------------------------------------------------


def _numbers(calibration: Calibration) -> Iterator[str]:
    yield "<h2>Numbers</h2>"
    if calibration.rig:
        yield _number_table("Right camera to left camera", rig_numbers(calibration))
    for title, camera in zip(camera_titles(calibration), calibration.cameras, strict=True):
        yield _number_table(f"{title} camera".capitalize() if title else "The camera", camera_numbers(camera))
    rows = [("points", fit_text(calibration)), ("lens model", model_text(calibration))]
    if bow := bow_text(calibration):
        rows.append(("board", f"it bulges by {bow}; that is taken into account"))
    rows += [(f"note: {n.code.replace('_', ' ')}", f"{n.text}. {n.cure}".strip()) for n in other_notes(calibration)]
    yield "<dl>" + "".join(f"<dt>{_told(name)}</dt><dd>{_told(text)}</dd>" for name, text in rows) + "</dl>"


def _number_table(caption: str, numbers: Sequence[Number]) -> str:
    rows = []
    for i, n in enumerate(numbers):
        u = number(n.u, n.unit, n.u, reference=n.value) if n.u else ""
        share = f" ({percent(n.u / abs(n.value))})" if n.u and not i else ""
        cells = [rounded(n.value, n.unit, n.u), u + share, interval(n.value, n.unit, n.u) if n.u else ""]
        numeric = "".join(f'<td class="number">{_told(cell)}</td>' for cell in cells)
        name = f'<th scope="row">{_told(n.name)}</th>'
        row = '<tr class="headline">' if i == 0 else "<tr>"
        rows.append(f'{row}{name}{numeric}<td class="words">{_told(n.remark)}</td></tr>')
    return _table(caption, ("number", "value:n", "u:n", "95 % interval:n", "remark"), rows)


def _table(caption: str, heads: Sequence[str], rows: Iterable[str]) -> str:
    """A table that scrolls sideways where it has to; ":n" marks columns of numbers."""
    numeric = {True: ' class="number"', False: ""}
    cells = "".join(f'<th scope="col"{numeric[h.endswith(":n")]}>{_told(h.removesuffix(":n"))}</th>' for h in heads)
    return (f'<div class="wide" role="region" aria-label="{_plain(caption)}" tabindex="0"><table><caption>{_told(caption)}</caption>'
            f"<thead><tr>{cells}</tr></thead><tbody>{''.join(rows)}</tbody></table></div>")  # fmt: skip


def _checks(calibration: Calibration) -> Iterator[str]:
    """Those that failed first, with what to do."""
    yield "<h2>Checks</h2>"
    failed = sum(not c.passed for c in calibration.checks)
    rows = []
    for check in sorted(calibration.checks, key=lambda c: c.passed):
        word = "passed" if check.passed else "failed"
        cure = "" if check.passed or not check.cure else f"<br><strong>Cure:</strong> {_told(check.cure)}"
        rows.append(f'<tr><td class="{word}">{word}</td><th scope="row">{_told(check.name)}</th>'
                    f'<td class="words">{_told(check.found)}{cure}</td></tr>')  # fmt: skip
    yield _table(f"{len(calibration.checks)} checks, {failed or 'none'} failed", ("result", "what", "found"), rows)


# -- pictures ----------------------------------------------------------------------------------------


def _figures(plots: Sequence[Plot]) -> Iterator[str]:
    yield "<h2>Figures</h2>"
    if not plots:
        yield f"<p>{_told(NO_PLOTS)}</p>"
        return
    yield '<div class="figures">'
    for plot in plots:
        data = base64.b64encode(plot.png).decode()
        yield (f'<figure><img alt="{_plain(plot.title)}, diagram" width="{plot.width_px}" height="{plot.height_px}" '
               f'src="data:image/png;base64,{data}"><figcaption>{_told(plot.caption)}</figcaption></figure>')  # fmt: skip
    yield "</div>"


def _pictures(calibration: Calibration) -> Iterator[str]:
    yield "<h2>Pictures</h2>"
    heads = ("no.:n", "picture", "points:n", "rms:n", "tilt:n", "range:n", "detector")
    for index, title in enumerate(camera_titles(calibration)):
        mine = [p for p in calibration.pictures if p.camera == index]
        out = sum(bool(p.left_out) for p in mine)
        caption = f"{len(mine) - out} pictures used" + (f", {out} left out" if out else "")
        yield _table(f"{title.capitalize()} camera: {caption}" if title else caption, heads,
                     [_picture(i + 1, p) for i, p in enumerate(mine)])  # fmt: skip


def _picture(index: int, p: Picture) -> str:
    head = f'<tr><td class="number">{index}</td><th scope="row" class="name">{_told(p.name)}</th>'
    if p.left_out:
        return f'{head}<td class="words" colspan="5"><span class="failed">left out:</span> {_told(reason(p))}</td></tr>'
    cells = (
        str(p.points), "" if p.rms_px is None else f"{p.rms_px:.2f} px",
        "" if p.tilt_rad is None else f"{math.degrees(p.tilt_rad):.0f}°",
        "" if p.range_m is None else f"{p.range_m:#.3g} m".replace(". m", " m"),
    )  # fmt: skip
    numeric = "".join(f'<td class="number">{_told(cell)}</td>' for cell in cells)
    return f'{head}{numeric}<td class="words">{_told(p.detector)}</td></tr>'


# -- how, and everything -----------------------------------------------------------------------------


def _computed(_: Calibration) -> Iterator[str]:
    yield "<h2>How it was computed</h2>"
    yield ("<p>All points of all pictures were explained at once, by least squares weighted with what the detector says of each "
           "point, through the lens and one place of the board for each picture. The covariance is that of the solution, scaled by "
           "the noise that was seen; what a check showed besides is added to it. u is one standard deviation; intervals hold the "
           "truth in 95&nbsp;% of cases. Left out were pictures and points that the others contradict.</p>")  # fmt: skip
    yield "<ul>" + "".join(f"<li>{_told(source)}</li>" for source in SOURCES) + "</ul>"


def _json(calibration: Calibration) -> Iterator[str]:
    whole = json.dumps(calibration.to_json(), indent=1, ensure_ascii=False)
    yield '<section class="screen"><h2>Everything</h2><details><summary>The calibration file, as JSON</summary>'
    yield f'<pre role="region" aria-label="JSON" tabindex="0">{escape(whole)}</pre></details></section>'
