"""The focus extension: a nominal focal length holds at infinity, and a lens focused close draws larger.

A thin lens focused on an object at classical distance D (= size * f / image size) has it at D + f from its front
principal plane. Lenses with inner focusing may do the opposite, so what is added carries as much u.

Source: E. Hecht, Optics, 5.2 (thin-lens equation); the size of the effect: f / D.
"""

from __future__ import annotations

from .quantity import Note, Quantity

CLOSE_FOCAL_LENGTHS = 50
"""Below so many focal lengths the extension is noted."""


NO_EXTENSION = Quantity.exact(0.0, "1", "the camera is calibrated")
"""Of a camera whose focal length holds its focus extension already: nothing is doubtful about it."""


def thin_lens() -> Quantity:
    """All of the extension is added, and as much again is its u."""
    return Quantity.normal(1.0, 1.0, "1", "assumed: thin lens focused on the object, inner focusing possible")


def classical() -> Quantity:
    """Nothing is added, up to all of the extension is possible: the calculator's headline is the classical value."""
    return Quantity.one_sided(0.0, 1.0, "1", "assumed: between no and all of the thin-lens extension")


def close_focus(focal_m: float | None, depth_m: float, focus: Quantity) -> Note | None:
    """The note `close_focus`, below CLOSE_FOCAL_LENGTHS of a nominal focal length."""
    if not focal_m or depth_m >= CLOSE_FOCAL_LENGTHS * focal_m:
        return None
    added = float(focus.value) * focal_m
    text = f"closer than {CLOSE_FOCAL_LENGTHS} focal lengths a lens focused here draws larger than its nominal focal length says; "
    if added:
        text += f"{added * 1000:.3g} mm of thin-lens extension are added"
    else:
        text += (
            f"a thin lens would put the object at {(depth_m + focal_m) * 1000:.2f} mm from its front principal plane"
        )
    return Note("close_focus", text, "calibrate the camera at this focus")
