"""How everything here is measured: against a named peer, by turns in the same run, so that a busy machine slows both."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

HEADINGS = ("what", "time", "peer", "peer time", "ratio", "of minima", "target", "met")


@dataclass(frozen=True)
class Comparison:
    """What was timed, against which peer, and the seconds of every turn.

    Attributes:
        what: the thing timed.
        peer: what it is compared with.
        seconds: one number per turn.
        peer_seconds: those of the peer; turn i of both ran one after the other.
        target: the largest ratio wanted; None where the figure is for information.
    """

    what: str
    peer: str
    seconds: tuple[float, ...]
    peer_seconds: tuple[float, ...]
    target: float | None = None

    @property
    def ratio(self) -> float:
        """Median over the turns of our time by the peer's."""
        return statistics.median(a / b for a, b in zip(self.seconds, self.peer_seconds, strict=True))

    @property
    def ratio_of_minima(self) -> float:
        """Our shortest time by the peer's shortest."""
        return min(self.seconds) / min(self.peer_seconds)

    @property
    def verdict(self) -> str:
        """`met` or `MISSED`, by the median ratio; `-` without a target."""
        if self.target is None:
            return "-"
        return "met" if self.ratio <= self.target else "MISSED"

    def cells(self) -> tuple[str, ...]:
        """One row of the table, under HEADINGS."""
        target = "-" if self.target is None else f"≤ {self.target:g}"
        return (self.what, _times(self.seconds), self.peer, _times(self.peer_seconds), f"{self.ratio:.3g}",
                f"{self.ratio_of_minima:.3g}", target, self.verdict)  # fmt: skip

    def to_json(self) -> dict[str, Any]:
        """Plain data for results.json."""
        return {
            "what": self.what, "peer": self.peer, "seconds": list(self.seconds),
            "peer_seconds": list(self.peer_seconds), "ratio": self.ratio, "ratio_of_minima": self.ratio_of_minima,
            "target": self.target, "verdict": self.verdict,
        }  # fmt: skip


def compare(
    what: str, ours: Callable[[], Any], peer: str, theirs: Callable[[], Any], *, turns: int, target: float | None = None
) -> Comparison:
    """Time two functions by turns, after one turn of each that does not count."""
    seconds, peer_seconds = [], []
    _timed(ours), _timed(theirs)
    for _ in range(turns):
        seconds.append(_timed(ours))
        peer_seconds.append(_timed(theirs))
    return Comparison(what, peer, tuple(seconds), tuple(peer_seconds), target)


def table(comparisons: list[Comparison]) -> str:
    """A Markdown table, columns aligned so that a terminal shows it well too."""
    rows = [HEADINGS, *(c.cells() for c in comparisons)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(HEADINGS))]
    lines = ["| " + " | ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)) + " |" for row in rows]
    return "\n".join([lines[0], "|" + "|".join("-" * (w + 2) for w in widths) + "|", *lines[1:]])


def _timed(function: Callable[[], Any]) -> float:
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def _times(seconds: tuple[float, ...]) -> str:
    """Median, and the minimum in brackets."""
    middle, least = statistics.median(seconds), min(seconds)
    if middle < 1:
        return f"{middle * 1000:.3g} ms ({least * 1000:.3g})"
    return f"{middle:.3g} s ({least:.3g})"
