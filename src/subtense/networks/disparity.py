"""A stereo network of one's own as ONNX: two pictures in, the left one's disparity out.

Inputs are (1, 3, H, W) or (1, H, W, 3), red, green, blue from 0 to 255; what takes gray has 1 in place of 3. The output has H x W numbers,
px to the left; networks that give the flow to the right picture, which is negative, are read too. Sizes that the file leaves free are
rounded up to whole 32; for one of fixed size the pictures are resized. The way back is had by mirroring the pair.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..arrays import Array, Pixels
from ..disparity import Disparity, of_map
from ..errors import FileFormatError
from .network import Network, Tensor

WHOLE_PX = 32
"""Most networks halve their input five times."""


def network_disparity(path: Path, left: Pixels, right: Pixels) -> Disparity:
    """Disparity by a network, judged like any other.

    Args:
        path: the ONNX file.
        left: (height, width, 3) uint8, rectified.
        right: likewise.

    Raises:
        FileFormatError: no network of two pictures and one disparity.
        MissingExtraError: the extra `networks` is not installed.
    """
    import cv2

    network = Network(path)
    if network.kind != "onnx" or len(network.inputs) != 2:
        raise FileFormatError(
            path, f"is no ONNX network that takes two pictures: it takes {', '.join(map(str, network.inputs))}"
        )
    there = _run(network, left, right)
    back = _run(network, right[:, ::-1], left[:, ::-1])[:, ::-1]
    grays = [np.asarray(cv2.cvtColor(one, cv2.COLOR_RGB2GRAY)) for one in (left, right)]
    return of_map(grays[0], grays[1], there, back)


def _run(network: Network, left: Pixels, right: Pixels) -> Array:
    import cv2

    height, width = left.shape[:2]
    first, channels, wanted = _layout(network, network.inputs[0])
    size = tuple(side or -(-mine // WHOLE_PX) * WHOLE_PX for side, mine in zip(wanted, (height, width), strict=True))
    fixed = all(wanted)
    pair = []
    for picture in (left, right):
        one = picture if channels == 3 else cv2.cvtColor(np.ascontiguousarray(picture), cv2.COLOR_RGB2GRAY)[..., None]
        one = np.ascontiguousarray(one)
        if fixed:
            one = cv2.resize(one, size[::-1], interpolation=cv2.INTER_AREA).reshape(*size, channels)
        else:
            one = np.pad(one, ((0, size[0] - height), (0, size[1] - width), (0, 0)), mode="edge")
        pair.append((np.moveaxis(one, -1, 0) if first else one)[None].astype(float))
    outputs = [one.squeeze() for one in network.run(*pair)]
    found = [one for one in outputs if one.shape == size]
    if not found:
        raise FileFormatError(
            network.path, f"gives {', '.join(map(str, network.outputs))}, and no disparity of {size[1]} x {size[0]} px"
        )
    disparity = found[-1]  # the last of several is the finest
    if not np.all(np.isfinite(disparity)):
        disparity = np.nan_to_num(disparity, posinf=0.0, neginf=0.0)
    disparity = -disparity if np.median(disparity) < 0 else disparity
    if fixed:
        return np.asarray(cv2.resize(disparity, (width, height), interpolation=cv2.INTER_NEAREST) * (width / size[1]))
    return np.asarray(disparity[:height, :width])


def _layout(network: Network, tensor: Tensor) -> tuple[bool, int, tuple[int | None, int | None]]:
    """Whether channels come first, how many there are, and height and width, None where free."""
    shape = tensor.shape
    if len(shape) == 4 and shape[1] in (1, 3):
        return True, shape[1], (shape[2], shape[3])
    if len(shape) == 4 and shape[3] in (1, 3):
        return False, shape[3], (shape[1], shape[2])
    raise FileFormatError(network.path, f"takes {tensor}, and not a picture of 1 x 3 x height x width")
