"""Depth by a network that the user brings: an ONNX file, or a name that transformers finds on this machine.

The picture goes in as the network was trained, keeping its proportions; what comes out is brought to the picture's pixels. Metres that
hang on a focal length the network does not know are corrected with the camera of the picture:

| focal | the network's metres hold for | depth |
|---|---|---|
| canonical | a focal length of focal_px in its input | output x f_input / focal_px, by design |
| told | the focal length that it gives beside | output x f_input / told, by design |
| trained | the one that it was trained with | output x f_input / trained, as far as it goes by sizes: what it makes of other cues is in u |
| none | whatever it made of the picture | output |

Point maps that are open to a shift along the axis get the shift at which they are seen where they are seen, by this camera.

Source: the canonical camera: W. Yin et al., Metric3D, ICCV 2023; the shift of point maps: R. Wang et al., MoGe, CVPR 2025.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array
from ..camera import Camera
from ..depth_models import DepthModel
from ..errors import FileFormatError, InputError, MissingExtraError
from ..lenses import LENSES
from ..networks.network import Network, Tensor
from ..networks.own_detector import DEVIATION, MEAN
from ..networks.view import View, whole
from ..photo import Photo
from ..quantity import Note
from ..raw_depth import RawDepth

MOST_BYTES = 4 * 2**30
MOST_SIDE_PX = 4096
GRAY = 117.0
"""Around the picture: the mean of ImageNet's, which these networks take for nothing."""
TOKENS = 1800
"""For networks that ask how closely to look; the middle of what MoGe suggests."""
LEAST_ANSWERED = 0.02
"""Share of the picture that must have a depth."""
LARGE_CORRECTION = 0.02
"""Logarithm of a corrected focal length from which it is noted."""


@dataclass(frozen=True)
class _Given:
    """What a network gave.

    Attributes:
        values: (h, w) of its output.
        to_output: (2, 3) from px of the picture to px of the output.
        factor: that makes the row's kind of numbers of them.
        doubt: relative u that the factor has.
        by_focal: whether the factor is proportional to the camera's focal length.
        notes: doubts about the factor.
    """

    values: Array
    to_output: Array
    factor: float = 1.0
    doubt: float = 0.0
    by_focal: bool = False
    notes: tuple[Note, ...] = ()


def onnx_depth(photo: Photo, row: DepthModel, path: Path, camera: Camera) -> RawDepth:
    """The depth that an ONNX file gives for a photo.

    Args:
        photo: the picture.
        row: what the file takes and gives.
        path: the file.
        camera: of the picture.

    Raises:
        FileFormatError: no ONNX network, or one that takes or gives something else than the row says.
        MissingExtraError: ONNX Runtime is not installed.
    """
    _check_perspective(camera)
    network = Network(path, most_bytes=MOST_BYTES)
    if network.kind != "onnx":
        raise FileFormatError(path, "is a TFLite network; networks of depth are read as ONNX")
    height, width, last = _input_size(network, row, photo)
    seen, to_input = _view(photo, row, width, height)
    outputs = network.run(*_arrays(network, row, seen, to_input, camera, last))
    return _raw(photo, row, _read(path, row, network.outputs, outputs, to_input, (height, width), camera), path.name)


def transformers_depth(photo: Photo, row: DepthModel, camera: Camera) -> RawDepth:
    """The depth that a network of transformers gives for a photo; only what lies on this machine is used.

    Raises:
        MissingExtraError: transformers or PyTorch is not installed.
        InputError: the network is not on this machine.
        FileFormatError: it gives no depth.
    """
    _check_perspective(camera)
    try:  # neither is an extra of this package: they take gigabytes, and most networks are had as ONNX
        torch, transformers = import_module("torch"), import_module("transformers")
    except ImportError:
        cure = f"{row.repository} is run by transformers; pip install transformers torch"
        raise MissingExtraError(row.title, "transformers", cure) from None
    try:
        processor = transformers.AutoImageProcessor.from_pretrained(row.repository, local_files_only=True)
        model = transformers.AutoModelForDepthEstimation.from_pretrained(row.repository, local_files_only=True)
    except Exception as error:  # hubs, formats and versions fail each with exceptions of their own
        said = " ".join(str(error).split())[:120]
        cure = f"it is not on this machine ({said}); fetch it: hf download {row.repository}"
        raise InputError("--prefer", row.repository, cure) from None
    try:
        with torch.no_grad():
            outputs = model(**processor(images=photo.pixels, return_tensors="pt"))
        size = [(photo.height_px, photo.width_px)]
        if "zoe" in row.repository.lower():  # its processor pads the picture, and knows how to take that off
            found = processor.post_process_depth_estimation(outputs, source_sizes=size)[0]["predicted_depth"]
        else:
            found = outputs.predicted_depth
        values = np.asarray(found.squeeze().numpy(), float)
    except Exception as error:
        said = " ".join(str(error).split())[:120]
        raise FileFormatError(row.repository, f"gives no depth: {said or type(error).__name__}") from None
    if values.ndim != 2:
        raise FileFormatError(
            row.repository, f"gives {' x '.join(map(str, values.shape))} numbers, and no map of depth"
        )
    to_output = _stretched(photo, values.shape[1], values.shape[0])
    given = _scaled(row, _Given(_usable(row.repository, values), to_output), photo, camera, math.nan, math.nan)
    return _raw(photo, row, given, row.repository)


def _check_perspective(camera: Camera) -> None:
    if not LENSES[camera.lens].perspective:
        raise InputError("camera", camera.lens, "networks of depth need a perspective picture")


# -- in ----------------------------------------------------------------------------------------------------


def _input_size(network: Network, row: DepthModel, photo: Photo) -> tuple[int, int, bool]:
    """Height and width of the input, and whether its channels come last."""
    first = network.inputs[0]
    shape = first.shape
    if len(shape) != 4 or shape[0] not in (None, 1) or (shape[1] not in (None, 3) and shape[-1] != 3):
        raise FileFormatError(
            network.path, f"takes {first}; a network of depth takes one picture (1 x 3 x height x width)"
        )
    last = shape[-1] == 3 and shape[1] != 3
    free = shape[1:3] if last else shape[2:]
    height, width = _wanted(row, photo)
    sides = (free[0] or height, free[1] or width)
    if not all(14 <= side <= MOST_SIDE_PX for side in sides):
        raise FileFormatError(
            network.path, f"takes a picture of {sides[1]} x {sides[0]} px; 14 to {MOST_SIDE_PX} px are supported"
        )
    return sides[0], sides[1], last


def _wanted(row: DepthModel, photo: Photo) -> tuple[int, int]:
    """Height and width where the file leaves them free: the picture's proportions, rounded up to whole patches."""
    if row.size_px:
        return int(row.size_px[0]), int(row.size_px[1])
    scale = row.side_px / min(photo.width_px, photo.height_px)
    scale = min(scale, MOST_SIDE_PX / 2 / max(photo.width_px, photo.height_px))
    height, width = (
        max(math.ceil(side * scale / row.multiple_px), 1) * row.multiple_px
        for side in (photo.height_px, photo.width_px)
    )
    return height, width


def _view(photo: Photo, row: DepthModel, width: int, height: int) -> tuple[View, Array]:
    """What the network looks at, and (2, 3) from px of the picture to px of its input."""
    if not row.stretch:
        seen = whole(photo.pixels, width, height, GRAY)
        turn = np.linalg.inv(seen.to_picture[:, :2])
        return seen, np.concatenate([turn, (-turn @ seen.to_picture[:, 2])[:, None]], -1)
    import cv2

    small = width < photo.width_px or height < photo.height_px
    pixels = cv2.resize(photo.pixels, (width, height), interpolation=cv2.INTER_AREA if small else cv2.INTER_LINEAR)
    to_input = _stretched(photo, width, height)
    back = np.linalg.inv(to_input[:, :2])
    return View(np.asarray(pixels, float), np.concatenate([back, (-back @ to_input[:, 2])[:, None]], -1)), to_input


def _stretched(photo: Photo, width: int, height: int) -> Array:
    """(2, 3) from px of the picture to px of a map that spans all of it."""
    sx, sy = width / photo.width_px, height / photo.height_px
    return np.array([[sx, 0.0, 0.5 * sx - 0.5], [0.0, sy, 0.5 * sy - 0.5]])


def _arrays(network: Network, row: DepthModel, seen: View, to_input: Array, camera: Camera, last: bool) -> list[Array]:
    """The inputs: the picture, and what else is asked for: the camera's matrix, its rays, or a number of tokens."""
    values = seen.input(0.0, 255.0 if row.takes == "imagenet_inside" else 1.0)
    if row.takes == "imagenet":
        values = (values - MEAN) / DEVIATION
    elif row.takes == "half":
        values = values * 2 - 1
    found = [values if last else np.moveaxis(values, -1, 1)]
    height, width = seen.pixels.shape[:2]
    for one in network.inputs[1:]:
        if one.shape in ((), (1,), (None,)) and one.dtype.startswith("int"):
            found.append(np.full([n or 1 for n in one.shape], TOKENS))
        elif one.shape[-2:] == (3, 3):
            found.append(np.reshape(_matrix(camera, to_input), [n or 1 for n in one.shape]))
        elif len(one.shape) == 4 and one.shape[1] == 3:
            found.append(_rays(camera, seen, height, width))
        else:
            raise FileFormatError(
                network.path, f"takes {one} beside the picture, which is no camera matrix, rays, or number of tokens"
            )
    return found


def _matrix(camera: Camera, to_input: Array) -> Array:
    """(3, 3) camera matrix of the input."""
    lift = np.concatenate([to_input, [[0.0, 0.0, 1.0]]])
    return np.asarray(lift @ camera.matrix)


def _rays(camera: Camera, seen: View, height: int, width: int) -> Array:
    """(1, 3, height, width) unit viewing directions of the input's pixels."""
    x, y = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    rays = camera.rays(seen.in_picture(np.stack([x, y], -1)))
    return np.asarray(np.nan_to_num(np.moveaxis(rays, -1, 0)[None]))


# -- out ---------------------------------------------------------------------------------------------------


def _read(
    path: Path, row: DepthModel, tensors: Sequence[Tensor], outputs: Sequence[Array], to_input: Array, size: tuple[int, int],
    camera: Camera,
) -> _Given:  # fmt: skip
    """The map among the outputs, as the row says what it is."""
    if row.gives == "points":
        values, scale = _points(path, tensors, outputs, to_input, size, camera)
        return _Given(_usable(path, values), _to_output(to_input, size, values.shape), scale)
    name, values = _map(path, tensors, outputs)
    numbers = [o for t, o in zip(tensors, outputs, strict=True) if "focal" in t.name.lower() and o.size == 1]
    told = float(numbers[0].ravel()[0]) if numbers else math.nan
    if row.focal == "told" and not (math.isfinite(told) and told > 0):
        given = ", ".join(map(str, tensors))
        raise FileFormatError(
            path, f"gives {given}, and no focal length beside {name}, by which its metres are corrected"
        )
    found = _Given(_usable(path, values), _to_output(to_input, size, values.shape))
    return _scaled(row, found, None, camera, told, float(to_input[0, 0]))


def _map(path: Path, tensors: Sequence[Tensor], outputs: Sequence[Array]) -> tuple[str, Array]:
    """Name and (h, w) of the depth: named so, or the only map there is; of points the third coordinate."""
    maps = [(t.name, _flat(o)) for t, o in zip(tensors, outputs, strict=True)]
    found = [(name, o) for name, o in maps if o is not None and min(o.shape) > 1]
    named = [one for one in found if "depth" in one[0].lower() or "disp" in one[0].lower()]
    if len(found) == 1 or named:
        return (named or found)[0]
    triple = [
        (t.name, o) for t, o in zip(tensors, outputs, strict=True) if "pts" in t.name.lower() and _triple(o) is not None
    ]
    if triple:
        return triple[0][0], np.asarray(_triple(triple[0][1]))[..., 2]
    raise FileFormatError(
        path, f"gives {', '.join(map(str, tensors))}, and no single map of depth (1 x height x width)"
    )


def _flat(output: Array) -> Array | None:
    """(h, w) of an output of one number a pixel; None for any other."""
    sides = [n for n in output.shape if n != 1]
    return output.reshape(sides) if len(sides) == 2 and (output.ndim < 2 or output.size) else None


def _triple(output: Array) -> Array | None:
    """(h, w, 3) of an output of three numbers a pixel; None for any other."""
    inner = output[0] if output.ndim == 4 and output.shape[0] == 1 else output
    if inner.ndim != 3:
        return None
    if inner.shape[-1] == 3:
        return inner
    return np.moveaxis(inner, 0, -1) if inner.shape[0] == 3 else None


def _points(
    path: Path,
    tensors: Sequence[Tensor],
    outputs: Sequence[Array],
    to_input: Array,
    size: tuple[int, int],
    camera: Camera,
) -> tuple[Array, float]:
    """(h, w) depths of a map of points that is open to a shift along the axis, and its factor to metres."""
    by_name = {t.name.lower(): o for t, o in zip(tensors, outputs, strict=True)}
    places = next((_triple(o) for n, o in by_name.items() if "point" in n), None)
    scale = next((float(o.ravel()[0]) for n, o in by_name.items() if "scale" in n and o.size == 1), math.nan)
    if places is None or not (math.isfinite(scale) and scale > 0):
        raise FileFormatError(
            path, f"gives {', '.join(map(str, tensors))}, and not points (1 x height x width x 3) with metric_scale"
        )
    mask = next((_flat(o) for n, o in by_name.items() if n == "mask"), None)
    height, width = places.shape[:2]
    back = np.linalg.inv(np.concatenate([_to_output(to_input, size, (height, width)), [[0.0, 0.0, 1.0]]]))
    x, y = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    across, down = camera.slopes(np.stack([x, y], -1) @ back[:2, :2].T + back[:2, 2])
    inside = np.isfinite(places).all(-1) & np.isfinite(across) & (True if mask is None else mask > 0.5)
    if np.count_nonzero(inside) < 16:
        raise FileFormatError(path, "gives hardly a point for this picture")
    depth = places[..., 2] + _shift(places[inside], across[inside], down[inside])
    return np.where(inside, depth, np.nan), scale


def _shift(places: Array, across: Array, down: Array) -> float:
    """The shift t along the axis at which (x, y) / (z + t) are the slopes under which the points are seen, by least squares in
    the picture, reweighted as the points become placed.
    """
    x, y, z = places.T
    shift = 0.0
    for _ in range(20):
        weight = 1 / np.maximum(z + shift, 0.02 * np.ptp(z) + 1e-9) ** 2
        cost = np.sum(weight * (across**2 + down**2))
        new = float(np.sum(weight * (across * (x - across * z) + down * (y - down * z))) / max(cost, 1e-12))
        if abs(new - shift) < 1e-6 * (abs(new) + 1e-9):
            break
        shift = new
    return shift


def _to_output(to_input: Array, size: tuple[int, int], shape: tuple[int, ...]) -> Array:
    """(2, 3) from px of the picture to px of an output that spans the input."""
    ratio = np.array([shape[1] / size[1], shape[0] / size[0]])
    found = ratio[:, None] * to_input
    found[:, 2] += 0.5 * ratio - 0.5  # centres of pixels
    return np.asarray(found)


def _usable(source: object, values: Array) -> Array:
    """The map, refused where it says nothing."""
    answered = values[np.isfinite(values)]
    if answered.size < max(LEAST_ANSWERED * values.size, 1):
        raise FileFormatError(source, "gives hardly a number that is finite for this picture")
    if answered.size > 1 and np.ptp(answered) <= 1e-9 * float(np.max(np.abs(answered))):
        raise FileFormatError(source, f"gives {answered[0]:.4g} everywhere for this picture, which is no map of depth")
    return values


def _scaled(row: DepthModel, given: _Given, photo: Photo | None, camera: Camera, told: float, scale: float) -> _Given:
    """What makes metres of the map by the camera's focal length, and the doubt of it."""
    if row.gives != "metric" or row.focal == "none":
        return given
    f_px = float(camera.f_px)
    if row.focal == "trained":
        ratio = f_px / (float(row.focal_per_side or 1.0) * min(camera.width_px, camera.height_px))
        doubt = abs(math.log(ratio)) / math.sqrt(3)  # anything between no correction and all of it, seen from all of it
        return replace(given, factor=ratio, doubt=doubt, by_focal=True, notes=_corrected(ratio))
    if not math.isfinite(scale):  # a processor of transformers brings the picture to the row's size itself
        assert photo is not None
        scale = min(given.values.shape) / min(photo.width_px, photo.height_px)
    held = told if row.focal == "told" else float(row.focal_px or 1.0)
    return replace(given, factor=f_px * scale / held, by_focal=True)


def _corrected(ratio: float) -> tuple[Note, ...]:
    """The note `focal_corrected`."""
    if abs(math.log(ratio)) <= LARGE_CORRECTION:
        return ()
    text = (
        f"the network was trained with one focal length, which is {1 / ratio:.2f} times this camera's; its depths are taken "
        f"{ratio:.2f} times as long, and as much of that as it may know by itself is in u"
    )
    return (Note("focal_corrected", text, "anchor the map, or use a network that is told the focal length"),)


def _raw(photo: Photo, row: DepthModel, given: _Given, name: str) -> RawDepth:
    """The map in the picture's pixels."""
    import cv2

    size = (photo.width_px, photo.height_px)
    if max(size) > 32_000:
        raise InputError("photo", f"{size[0]} x {size[1]} px", "resize it to at most 32 000 px a side")
    scaled: Any = np.asarray(given.values * given.factor, np.float32)
    # warpAffine takes the way back: from px of the picture to px of the map
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    values = cv2.warpAffine(scaled, given.to_output, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
    kind = "metric" if row.gives == "points" else row.gives
    values = np.where(values > 0, values, np.nan) if kind in ("metric", "scaled") else values
    if not np.isfinite(values).any():
        raise FileFormatError(name, "gives no depth above 0 for this picture")
    cell = 1 / math.sqrt(abs(float(np.linalg.det(given.to_output[:, :2]))))
    return RawDepth(
        values, kind, f"{row.title} ({name})", math.hypot(row.u_factor, given.doubt), row.u_local, doubt=row.doubt,
        cell_px=max(cell, 1.0), focal=given.by_focal, notes=given.notes,
    )  # fmt: skip
