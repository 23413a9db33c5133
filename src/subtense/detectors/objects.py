"""People, vehicles and household things by their usual height.

A network sees boxes. What a box spans is a thing's height whatever way it faces, so that is what is measured (of a laptop, whose
lid may stand at any angle, the width). Of a person it is the body's height only if the person stands and is seen from head to
feet, which the joints tell; head and sole are then the upper and lower end of the pixels that are the person's. Who sits, leans,
or is hidden or cut is shown, but has no size. The upper and lower end of a vehicle are not at one distance: what is
closest to the camera decides, so the distance is that of its near end.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ..arrays import Array
from ..detection import Detection, Search
from ..networks.body import AROUND, Body, body_in
from ..networks.kinds import KINDS, PERSON, RIDDEN, Kind, kind_of
from ..networks.own_detector import own_detector
from ..networks.stance import LEAST_SCORE, cut_by_border, disagreement, doubtful, hidden, posture
from ..networks.things import PACKAGED, Eye, Thing, one_label, refined, things
from ..observation import Observation
from ..photo import Photo
from ..quantity import Note
from ..targets import KnownTarget

HEAD_SIGMA, SOLE_SIGMA = 0.012, 0.015
"""Of the ends of a person's pixels, shares of the height: 0.006 and 0.007 of most, more of a few (benchmarks/boxes.py)."""
AHEAD, AHEAD_SIGMA = 0.012, 0.012
"""How much the lowest pixel lies below the sole under the body's middle, share of the height: it is the toe of a foot that is
d nearer, so d / Z h / H for a camera h above the ground; 0.15 ± 0.1 m, 1.5 m of 1.7 m, 5 to 20 m away."""
EDGE_SIGMA = 0.05
"""Of the upper and lower edge of a box, share of its height (benchmarks/boxes.py)."""
PIXEL_SIGMA = 0.5
"""Of any end, pixels of the network or of the picture, whichever is larger."""
LEAST_PX = 12.0
"""Smaller things are not shown: what a network makes of them is a guess."""
SURE = 0.45
"""Score from which a person who is not measured is shown; the joints of one who is measured have said that it is one."""
MOST_BODIES, MOST_REFINED = 24, 12
"""Things that are looked at again, the best first; time is bounded."""
SAME_BODY = 0.15
"""Of the height: bodies whose joints lie nearer to each other are one."""
COVERED = 0.12
"""Share of a box that a nearer thing may cover before its lower edge is no longer trusted."""
NEAR_BORDER = 0.03
"""Of its height: a box that ends nearer to the border of the picture may be cut by it."""

LEVEL = Note(
    "level_view_assumed",
    "taken to be seen from about its own height; from farther above its top is seen too, and it is farther away than this says",
    "mark a length that you know at its near end with --line and --size",
)

Taken = Mapping[str, tuple[KnownTarget, ...]]


def objects(photo: Photo, search: Search | None = None) -> tuple[Detection, ...]:
    """People, vehicles and household things, each with the ends of its height; the largest first.

    Args:
        photo: the picture.
        search: `targets` to look for these only, `model` for a detector of one's own (ONNX), `thorough` for smaller tiles.

    Raises:
        MissingExtraError: the networks, or what runs them, are not installed.
        FileFormatError: `search.model` is no detector of a known family.
    """
    search = search or Search()
    taken = {kind.name: kind.taken_as(search.targets) for kind in KINDS}
    if search.targets and not any(taken.values()):
        return ()
    eye = PACKAGED if search.model is None else own_detector(search.model).eye
    found = things(photo.pixels, eye, thorough=search.thorough, progress=lambda share: search.progress(0.7 * share))
    seen = one_label(found)
    unasked = not search.targets
    detections = _people(photo, seen, taken[PERSON.name]) if unasked or taken[PERSON.name] else []
    search.progress(0.85)
    detections += _others(photo, seen, taken, eye, unasked)
    return tuple(sorted(detections, key=lambda one: -float(np.ptp(one.seen.points_px, axis=0).max())))


# -- people ------------------------------------------------------------------------------------------


def _people(photo: Photo, seen: Sequence[Thing], taken: tuple[KnownTarget, ...]) -> list[Detection]:
    """A detection for each person: the height of those who stand, without a size for all others."""
    people = [one for one in seen if kind_of(one.label) is PERSON and one.score >= PERSON.least]
    ridden = [one for one in seen if one.label.lower() in RIDDEN]
    bodies: list[Body] = []
    found = []
    for one in people[:MOST_BODIES]:
        body = body_in(photo.pixels, one.box_px)
        if body is None or body.score < LEAST_SCORE:
            if one.score >= SURE:
                found.append(_unsized(photo, PERSON, one, _not_standing("no whole body can be made out in its box")))
            continue
        if body.height_px < LEAST_PX or any(_same(body, other) for other in bodies):
            continue
        bodies.append(body)
        person = _person(photo, one, body, ridden, taken)
        if person.target is not None or one.score >= SURE:
            found.append(person)
    return found


def _person(
    photo: Photo, thing: Thing, body: Body, ridden: Sequence[Thing], taken: tuple[KnownTarget, ...]
) -> Detection:
    if cut_by_border(body, photo.width_px, photo.height_px):
        note = _cut("reaches to the border of the picture")
    elif why := posture(body) or _rides(thing, ridden):
        note = _not_standing(why)
    elif why := hidden(body) or doubtful(body, again := body_in(photo.pixels, thing.box_px, AROUND[1])):
        note = _cut(why)
    else:
        assert again is not None
        return _standing(photo, thing, body, again, taken)
    box = np.array([body.left_px, body.top_px, body.right_px, body.bottom_px])
    return _unsized(photo, PERSON, Thing(thing.label, thing.score, box), note)


def _standing(photo: Photo, thing: Thing, body: Body, again: Body, taken: tuple[KnownTarget, ...]) -> Detection:
    """Head and sole: the means of two looks; what they differ by is in their sigma."""
    middle, height = (body.left_px + body.right_px) / 2, body.height_px
    top, bottom = (body.top_px + again.top_px) / 2, (body.bottom_px + again.bottom_px) / 2 - AHEAD * height
    ends = np.array([[middle, top], [middle, bottom]])
    floor = PIXEL_SIGMA * max(body.pixel, 1.0)
    apart = np.array(disagreement(body, again))
    share = np.array([HEAD_SIGMA, math.hypot(SOLE_SIGMA, AHEAD_SIGMA)])
    sigma = np.sqrt((share * height) ** 2 + floor**2 + (apart / 2) ** 2)
    observation = Observation(_inside(ends, photo), sigma, label=PERSON.name, score=thing.score, source="objects")
    return Detection(observation, "length", taken[0], taken[1:])


def _same(body: Body, other: Body) -> bool:
    apart = np.hypot(*(body.joints_px - other.joints_px).T).mean()
    return bool(apart < SAME_BODY * max(body.height_px, other.height_px))


def _rides(person: Thing, ridden: Sequence[Thing]) -> str:
    rides = any(person.covered_by(one) > 0.2 for one in ridden)
    return "there is a bicycle where the legs are" if rides else ""


def _not_standing(why: str) -> Note:
    return Note("person_not_standing", f"not measured by the height of a standing person: {why}",
                "mark a length that you know with --line and --size")  # fmt: skip


def _cut(why: str) -> Note:
    return Note("person_cut", f"not measured by the height of a person, who is not seen from head to feet: {why}",
                "take a picture that shows all of the person")  # fmt: skip


# -- vehicles and things -----------------------------------------------------------------------------


def _others(photo: Photo, seen: Sequence[Thing], taken: Taken, eye: Eye, unasked: bool) -> list[Detection]:
    """A detection for each thing that is no person; of labels that nobody knows the size of, only by a detector of one's own."""
    wanted = []
    for one in seen:
        kind = kind_of(one.label)
        if kind is PERSON or one.score < (kind.least if kind else SURE):
            continue
        if (kind is not None and taken[kind.name]) or (kind is None and unasked and eye is not PACKAGED):
            wanted.append((kind or Kind(one.label, (one.label,)), one))
    found = []
    for number, (kind, one) in enumerate(wanted):
        box = refined(photo.pixels, one, eye) if number < MOST_REFINED else one
        if max(box.width_px, box.height_px) >= LEAST_PX:
            found.append(_thing(photo, kind, box, seen, taken.get(kind.name, ())))
    return found


def _thing(photo: Photo, kind: Kind, thing: Thing, seen: Sequence[Thing], taken: tuple[KnownTarget, ...]) -> Detection:
    why = _partial(photo, kind, thing, seen)
    if why or not taken:
        text = f"not measured by its usual height: {why}"
        note = Note("object_cut", text, "take a picture that shows all of it") if why else None
        return _unsized(photo, kind, thing, note)
    return Detection(_ends(photo, kind, thing), "length", taken[0], taken[1:], notes=(LEVEL,) if kind.deep else ())


def _partial(photo: Photo, kind: Kind, thing: Thing, seen: Sequence[Thing]) -> str:
    """Why the box may show a part only, in words; empty for a whole thing."""
    near = max(NEAR_BORDER * thing.height_px, 1.0)
    left, top, right, bottom = thing.box_px + 0.5
    if left < near or top < near or right > photo.width_px - near or bottom > photo.height_px - near:
        return "it reaches to the border of the picture"
    lowest = thing.box_px[3] + 0.02 * thing.height_px
    nearer = [one for one in seen if one.box_px[3] > lowest and one.score >= PERSON.least and kind_of(one.label)]
    if any(thing.covered_by(one) > COVERED for one in nearer):
        return "something nearer hides a part of it"
    aspect = thing.width_px / max(thing.height_px, 1e-9)
    return (
        "" if kind.aspect[0] <= aspect <= kind.aspect[1] else f"its box is not shaped like that of a whole {kind.name}"
    )


def _unsized(photo: Photo, kind: Kind, thing: Thing, note: Note | None) -> Detection:
    """A thing without a size, drawn by its height."""
    return Detection(_ends(photo, kind, thing), "length", notes=(note,) if note else ())


def _ends(photo: Photo, kind: Kind, thing: Thing) -> Observation:
    """The middles of a box's upper and lower side, or of its left and right one."""
    left, top, right, bottom = thing.box_px
    middle = (thing.box_px[:2] + thing.box_px[2:]) / 2
    ends = np.array([[left, middle[1]], [right, middle[1]]] if kind.across else [[middle[0], top], [middle[0], bottom]])
    sigma = math.hypot(EDGE_SIGMA * (thing.width_px if kind.across else thing.height_px), PIXEL_SIGMA)
    return Observation(_inside(ends, photo), sigma, label=kind.name, score=thing.score, source="objects")


def _inside(points: Array, photo: Photo) -> Array:
    """Points moved into the picture."""
    return np.clip(points, -0.5, [photo.width_px - 0.5, photo.height_px - 0.5])
