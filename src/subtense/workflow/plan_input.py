"""From what a person typed of a planned measurement to set-ups, with what is assumed where nothing was said."""

from __future__ import annotations

import dataclasses
import math
import re
from dataclasses import dataclass

from .. import assumptions, ground
from ..distribution import HALF_WIDTH_95
from ..errors import InputError
from ..planned import Entry, Wanted
from ..presets import find_preset
from ..quantity import Assume, Quantity
from .plan_ways import WAYS, Setup, Way, aim_rad

FOCAL_M, SENSOR_M, WIDTH_PX, PROPORTION = 0.0055, 0.0076, 4000, 0.75
"""A camera of which nothing was said: the main lens of a phone, 26 mm as a 35 mm equivalent, and its 12 megapixels."""
CALIBRATED_FOCAL = 0.002
"""Relative u of the focal length of a calibrated camera."""
MATCHED_PX, RECTIFIED_PX = 0.3, 0.2
"""u of a disparity, and of the difference of two calibrated principal points."""
STEREO_BASELINE = 0.002
"""Relative u of a baseline that was calibrated with the cameras."""
NEAREST_M, FARTHEST_M, FINEST_M = 1e-3, 1e6, 1e-9
"""Distances that can be planned, and the finest accuracy."""


@dataclass(frozen=True)
class PlanTexts:
    """What a person typed; None where nothing was said.

    Attributes:
        distance: "20 m"; in the way `drone` the length on the ground.
        accuracy: "5 cm", "5 cm (1s)", "1 %".
        way: of WAYS; all of them where nothing was said.
        focal: "8 mm", with a sensor; or in pixels, "1500 ± 5 px".
        sensor: its width, or a preset's name.
        width_px: of the picture.
        height_px: of the picture.
        calibrated: whether the camera is calibrated, where its focal length is said without ±.
        size: of the object.
        tilt: of the object.
        baseline: between two cameras.
        height: of the camera above the ground.
        pitch: of the camera; by default it aims at the planned distance.
        pitch_error: its ±.
        roll_error: the ± of its roll.
        slope: of the ground.
        pixel_error: ± of each end, of the foot point, or of the disparity.
        offset_error: ± of the difference of two principal points.
    """

    distance: str
    accuracy: str | None = None
    way: str | None = None
    focal: str | None = None
    sensor: str | None = None
    width_px: str | None = None
    height_px: str | None = None
    calibrated: bool = False
    size: str | None = None
    tilt: str | None = None
    baseline: str | None = None
    height: str | None = None
    pitch: str | None = None
    pitch_error: str | None = None
    roll_error: str | None = None
    slope: str | None = None
    pixel_error: str | None = None
    offset_error: str | None = None


ONLY_OF = {
    "size": ("known_size",), "tilt": ("known_size",), "baseline": ("stereo",), "offset_error": ("stereo",),
    "height": ("ground", "drone"), "pitch": ("ground",), "pitch_error": ("ground", "drone"),
    "roll_error": ("ground", "drone"), "slope": ("ground", "drone"),
}  # fmt: skip
"""Ways that an option has a meaning in; all others have one in every way."""


def ways_of(said: PlanTexts) -> tuple[Way, ...]:
    """The ways that are asked for: the named one; else all in which everything that was said has a meaning.

    Raises:
        InputError: no such way, or options of different ways.
    """
    if said.way is not None and said.way not in WAYS:
        raise InputError("--way", said.way, f"known are {', '.join(WAYS)}")
    left = [said.way] if said.way else list(WAYS)
    for name, ways in ONLY_OF.items():
        text = getattr(said, name)
        if text is None:
            continue
        left = [way for way in left if way in ways]
        if not left:
            option = f"--{name.replace('_', '-')}"
            beside = f"way {said.way}" if said.way else "what else was said"
            raise InputError(option, text, f"it belongs to the way {' or '.join(ways)}, not to {beside}")
    return tuple(WAYS[name] for name in left)


def distance_of(said: PlanTexts) -> float:
    """The planned distance, m.

    Raises:
        InputError: no length with its unit, or beyond what has a meaning.
    """
    return length_with_unit(said.distance, "--distance")


def length_with_unit(text: str, option: str) -> float:
    """A length above 0 whose unit was said, m."""
    _needs_unit(text, option, "20 m")
    value = float(Quantity.parse(text, "m", name=option, assume=_exactly).value)
    if not NEAREST_M <= value <= FARTHEST_M:
        raise InputError(option, text, "give a length from 1 mm to 1000 km")
    return value


def _exactly(value: float, _: float) -> Quantity:
    return Quantity.exact(value, "m")


def _needs_unit(text: str, option: str, example: str) -> None:
    if not re.search(r"""[A-Za-zµμ%"'″′]""", text.replace("exact", "")):
        raise InputError(option, text, f"give it with its unit, as in '{example}'")


def wanted_of(text: str | None, distance_m: float) -> Wanted | None:
    """The accuracy as the half-width of a 95 % interval.

    Raises:
        InputError: 0 or below, limits, or no length and no percentage.
    """
    if text is None:
        return None
    bare = re.sub(r"^\s*(±|\+/-|\+-)", "", text).strip()
    _needs_unit(bare, "--accuracy", "5 cm")
    if "limits" in bare.lower():
        raise InputError("--accuracy", text, "give the half-width of a 95 % interval, as '5 cm', or '2.5 cm (1s)'")
    if "±" in bare or "+-" in bare or "+/-" in bare or bare.startswith("-"):
        raise InputError("--accuracy", text, "give one length above 0, as '5 cm', or '1 %'")
    refused = InputError("--accuracy", text, "give one length from 1 nm to 1000 km, as '5 cm', or '1 %'")
    try:
        read = Quantity.parse(f"{distance_m!r} m ± {bare}", "m", name="--accuracy")
    except InputError:
        raise refused from None
    half = HALF_WIDTH_95 * float(read.u)
    if not half > 0:
        raise InputError("--accuracy", text, "nothing is known exactly: give a length above 0, as '5 cm', or '1 %'")
    if not FINEST_M <= half <= FARTHEST_M:
        raise refused
    share = half / distance_m if "%" in bare.split("(")[0] else None
    return Wanted(half, share, text.strip())


# -- one number at a time -----------------------------------------------------------------------------------------------


def _read(text: str | None, option: str, unit: str, default: Quantity, *, bare: str | None = None,
          assume: Assume | None = None, above_0: bool = True) -> tuple[Quantity, bool]:  # fmt: skip
    """A quantity, and whether its doubt goes with its value: where it was said in per cent, or not said at all."""
    if text is None:
        return default, True
    found = Quantity.parse(text, unit, bare=bare, name=option, assume=assume)
    if above_0 and not float(found.value) > 0:
        raise InputError(option, text, "give a number above 0")
    return found, "%" in text.split("(")[0] or found.source.startswith("assumed")


def _doubt(text: str | None, option: str, unit: str, default: Quantity, bare: str | None = None) -> Quantity:
    """A doubt said on its own, as "0.5 deg": a quantity of value 0."""
    if text is None:
        return default
    tail = re.sub(r"^\s*(±|\+/-|\+-)", "", text).strip()
    if "%" in tail.split("(")[0]:
        raise InputError(option, text, f"give it in {bare or unit}")
    try:
        return Quantity.parse(f"0 {bare or unit} ± {tail}", unit, name=option)
    except InputError:
        raise InputError(option, text, f"give one ± of 0 or above, as '0.5 {bare or unit}'") from None


def _count(text: str | None, option: str, default: int) -> int:
    if text is None:
        return default
    number = float(Quantity.parse(text, "px", name=option, assume=assumptions.count).value)
    if not (16 <= number <= 200_000 and number == int(number)):
        raise InputError(option, text, "give a whole number of pixels, 16 to 200000")
    return int(number)


def _sensor(text: str | None) -> Quantity:
    if text is None:
        return Quantity.exact(SENSOR_M, "m", "assumed: a phone's main camera")
    if re.match(r"\s*[\d.]+\s*(mm|cm|µm|um|in|±|$)", text):
        return _read(text, "--sensor", "m", Quantity.exact(0.0, "m"), bare="mm", assume=assumptions.sensor_width)[0]
    return find_preset(text, "--sensor").sensor_width


def _focal(said: PlanTexts, sensor: Quantity, *, calibrated: bool) -> tuple[Quantity, bool]:
    """The focal length in m or px, its doubt with that of the sensor's width, and whether it goes with its value."""

    def calibrated_to(value: float, unit: str) -> Quantity:
        text = f"assumed: calibrated, {100 * CALIBRATED_FOCAL:g} % (1s)"
        return Quantity.normal(value, CALIBRATED_FOCAL * value, unit, text)

    def assume(value: float, half_digit: float) -> Quantity:
        return calibrated_to(value, "m") if calibrated else assumptions.focal_length(value, half_digit)

    if said.focal is not None and re.search(r"\bpx\b|pixel", said.focal):
        found, scaled = _read(said.focal, "--focal", "px", sensor, assume=lambda value, _: calibrated_to(value, "px"))
        return found, scaled
    if said.focal is not None and said.sensor is None:
        raise InputError(
            "--sensor",
            None,
            "a focal length in mm needs the sensor's width, as --sensor '6.4 mm'; or give --focal in px",
        )
    if said.focal is None:
        value = FOCAL_M * float(sensor.value) / SENSOR_M
        found, scaled = assume(value, 0.0), True
        found = dataclasses.replace(found, source=f"assumed: a phone's main lens; {found.source[9:]}")
    else:
        found, scaled = _read(said.focal, "--focal", "m", sensor, bare="mm", assume=assume)
    relative = float(sensor.u) / float(sensor.value)
    if (calibrated and scaled) or not relative:  # a calibration tells focal length over sensor width
        return found, scaled
    u = math.hypot(float(found.u), relative * float(found.value))
    source = f"{found.source}, with the doubt of the sensor's width"
    return Quantity.normal(float(found.value), u, "m", source), scaled


def setup_of(way: Way, said: PlanTexts, distance_m: float) -> Setup:
    """The set-up of a way, all its numbers as said or assumed.

    Raises:
        InputError: a text that can't be used.
    """
    calibrated = said.calibrated or way.name == "stereo"
    width = _count(said.width_px, "--width-px", WIDTH_PX)
    height = _count(said.height_px, "--height-px", max(round(width * PROPORTION), 1))
    sensor = _sensor(said.sensor)
    focal, scaled = _focal(said, sensor, calibrated=calibrated)
    calibrated = calibrated or focal.unit == "px"
    source = "a count" if said.width_px else "assumed: 12 megapixels"
    value = float(focal.value)
    entries = [
        Entry("focal", "focal length", focal, scaled, value / 20, value * 100, "focal-error", "± of the focal length"),
        Entry("width-px", "picture width", Quantity.exact(float(width), "px", source), False, 320.0, 40_000.0),
    ]
    if focal.unit == "m":
        entries.insert(1, Entry("sensor", "sensor width", sensor))
    for key in way.keys:
        entries.append(_OTHERS[key](said, way))
    entries.append(_pixel(said, way))
    made = Setup({e.key: e for e in entries}, distance_m, calibrated, height / width, width, said.pitch is None)
    if "pitch" not in made.entries or said.pitch is not None:
        return made
    aimed = -math.pi / 2 if way.name == "drone" else aim_rad(made)
    return made.with_entry(made.entries["pitch"].moved(aimed))


def _size(said: PlanTexts, _: Way) -> Entry:
    default = Quantity.normal(1.0, assumptions.REAL_SIZE, "m", "assumed: 1 m, 0.5 %")
    found, scaled = _read(said.size, "--size", "m", default, bare="mm", assume=assumptions.size)
    return Entry("size", "size of the object", found, scaled, 1e-3, 100.0, "size-error", "± of the size")


def _tilt(said: PlanTexts, _: Way) -> Entry:
    default = assumptions.unknown_tilt()
    found, _scaled = _read(said.tilt, "--tilt", "rad", default, bare="deg", assume=assumptions.angle, above_0=False)
    if not abs(float(found.value)) < math.pi / 2:
        raise InputError("--tilt", said.tilt, "give an angle between -90° and 90°")
    return Entry("tilt", "tilt of the object", found, False, None, None, "tilt-error", "± of the tilt")


def _baseline(said: PlanTexts, _: Way) -> Entry:
    text = f"assumed: calibrated, {100 * STEREO_BASELINE:g} % (1s)"

    def assume(value: float, _half: float) -> Quantity:
        return Quantity.normal(value, STEREO_BASELINE * value, "m", text)

    if said.baseline is not None:
        _needs_unit(said.baseline, "--baseline", "120 ± 0.5 mm")
    default = dataclasses.replace(assume(0.12, 0.0), source=f"assumed: 120 mm, {text[9:]}")
    found, scaled = _read(said.baseline, "--baseline", "m", default, assume=assume)
    return Entry("baseline", "baseline", found, scaled, 1e-3, 1000.0, "baseline-error", "± of the baseline")


def _height(said: PlanTexts, way: Way) -> Entry:
    if way.name == "drone":
        default = Quantity.normal(50.0, 3.0, "m", "assumed: a drone's own height above its take-off, 3 m (1s)")
    else:
        default = Quantity.normal(1.6, 0.02, "m", "assumed: held at eye level, 2 cm (1s)")
    found, scaled = _read(said.height, "--height", "m", default, bare="m", assume=assumptions.size)
    scaled = said.height is not None and scaled  # what is assumed of a height is so many metres
    return Entry("height", "height above ground", found, scaled, 0.05, 5000.0, "height-error", "± of the height")


def _pitch(said: PlanTexts, way: Way) -> Entry:
    usual = 0.5 if way.name == "drone" else 1.0
    by = "a drone's own sensor" if way.name == "drone" else "a phone's own sensor"
    default = Quantity.normal(0.0, math.radians(usual), "rad", f"assumed: {by}, {usual:g}° (1s)")
    if said.pitch is None:
        found = _doubt(said.pitch_error, "--pitch-error", "rad", default, "deg")
    else:
        alone = said.pitch_error is not None

        def assume(value: float, _half: float) -> Quantity:
            doubt = _doubt(said.pitch_error, "--pitch-error", "rad", default, "deg")
            return dataclasses.replace(doubt, value=value)

        found = Quantity.parse(said.pitch, "rad", bare="deg", name="--pitch", assume=assume)
        if alone and ("±" in said.pitch or "+-" in said.pitch or "+/-" in said.pitch):
            raise InputError("--pitch-error", said.pitch_error, "--pitch has its ± already; give one of both")
        if not abs(float(found.value)) <= math.pi / 2:
            raise InputError("--pitch", said.pitch, "give an angle from -90° to 90°")
    return Entry("pitch", "pitch", found, False, None, None, "pitch-error", "± of the pitch")


def _roll(said: PlanTexts, way: Way) -> Entry:
    default = ground.level_roll()
    if way.name == "drone":
        default = Quantity.normal(0.0, math.radians(0.5), "rad", "assumed: a drone's own sensor, 0.5° (1s)")
    found = _doubt(said.roll_error, "--roll-error", "rad", default, "deg")
    return Entry("roll", "roll", found, False, None, None, "roll-error", "± of the roll")


def _slope(said: PlanTexts, _: Way) -> Entry:
    found = ground.level_ground()
    if said.slope is not None:
        found = Quantity.parse(said.slope, "rad", bare="deg", name="--slope")
        if float(found.value):
            raise InputError("--slope", said.slope, "planning is for level ground: give '0 ± 0.2 deg'")
    return Entry("slope", "slope of the ground", found, False, None, None, "slope-error", "± of the slope")


def _offset(said: PlanTexts, _: Way) -> Entry:
    text = f"assumed: calibrated, {RECTIFIED_PX:g} px (1s)"
    found = _doubt(said.offset_error, "--offset-error", "px", Quantity.normal(0.0, RECTIFIED_PX, "px", text))
    title = "principal point difference"
    return Entry("offset", title, found, False, None, None, "offset-error", f"± of the {title}")


def _pixel(said: PlanTexts, way: Way) -> Entry:
    if way.name == "stereo":
        title, u, text = "disparity", MATCHED_PX, f"assumed: matched to {MATCHED_PX:g} px (1s)"
    else:
        u = assumptions.CLICK_SIGMA_PX
        title, text = "pixel positions", f"assumed: clicked to {u:g} px (1s)"
    found = _doubt(said.pixel_error, "--pixel-error", "px", Quantity.normal(0.0, u, "px", text))
    return Entry("pixel", title, found, False, None, None, "pixel-error", f"± of the {title}")


_OTHERS = {
    "size": _size, "tilt": _tilt, "baseline": _baseline, "height": _height, "pitch": _pitch, "roll": _roll, "slope": _slope,
    "offset": _offset,
}  # fmt: skip
