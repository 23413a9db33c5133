"""Plot: a finished picture of numbers, with what it shows in words."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Plot:
    """A picture for a report.

    Attributes:
        name: of a file, without ending.
        title: a few words.
        caption: one sentence on how to read it.
        png: the picture.
        width_px: its width.
        height_px: its height.
    """

    name: str
    title: str
    caption: str
    png: bytes
    width_px: int
    height_px: int
