"""A detector of one's own as ONNX: which of the known families it is, told by the shapes it gives, and its boxes.

| family | gives | boxes | scores |
|---|---|---|---|
| YOLO v5, v7 | (1, N, 5 + C) | centre and size, px of the input | of a thing, times of each class |
| YOLO v8 to v12 | (1, 4 + C, N) | centre and size, px of the input | of each class |
| YOLO end to end | (1, N, 6) | corners, px of the input; score; class | |
| DETR | (1, Q, C + 1) and (1, Q, 4) | centre and size, shares of the input | softmax with "nothing" last |
| RT-DETR, RF-DETR | (1, Q, C) and (1, Q, 4) | centre and size, shares of the input | sigmoid |

Source: the formats of J. Redmon et al., You Only Look Once, CVPR 2016, and its successors' ONNX exports; N. Carion et al.,
End-to-End Object Detection with Transformers, ECCV 2020.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..arrays import Array
from ..errors import FileFormatError
from .boxes import sigmoid
from .network import Network, Tensor
from .things import LEAST_SCORE, Eye, Thing
from .view import View

SIZE_PX = 640
"""Where the file leaves its input's size free."""
GRAY = 114.0
"""Around the picture, as these families are trained with."""
MOST_SIZE_PX = 4096
MOST_BOXES = 300
"""Of one view; the best."""
END_TO_END = 1000
"""(1, N, 6) of more rows than this is a YOLO v5 of one class."""
KNOWN = (
    "known are (1, N, 5 + C) of YOLO v5 and v7, (1, 4 + C, N) of YOLO v8 to v12, (1, N, 6) end to end, and (1, Q, C) with "
    "(1, Q, 4) of the DETR family"
)
COCO_80 = [
    "person", "bicycle", "car", "motorcycle", "airplane", "bus", "train", "truck", "boat", "traffic light",
    "fire hydrant", "stop sign", "parking meter", "bench", "bird", "cat", "dog", "horse", "sheep", "cow", "elephant",
    "bear", "zebra", "giraffe", "backpack", "umbrella", "handbag", "tie", "suitcase", "frisbee", "skis", "snowboard",
    "sports ball", "kite", "baseball bat", "baseball glove", "skateboard", "surfboard", "tennis racket", "bottle",
    "wine glass", "cup", "fork", "knife", "spoon", "bowl", "banana", "apple", "sandwich", "orange", "broccoli",
    "carrot", "hot dog", "pizza", "donut", "cake", "chair", "couch", "potted plant", "bed", "dining table", "toilet",
    "tv", "laptop", "mouse", "remote", "keyboard", "cell phone", "microwave", "oven", "toaster", "sink",
    "refrigerator", "book", "clock", "vase", "scissors", "teddy bear", "hair drier", "toothbrush",
]  # fmt: skip
GAPS_OF_91 = (0, 12, 26, 29, 30, 45, 66, 68, 69, 71, 83)
"""Numbers of COCO's 91 that have no class."""
MEAN, DEVIATION = np.array([0.485, 0.456, 0.406]), np.array([0.229, 0.224, 0.225])
"""Of ImageNet's pictures, by which DETR and RF-DETR normalise theirs."""

Read = Callable[[Sequence[Array], int], tuple[Array, Array, Array]]
"""From outputs and the input's size to boxes (K, 4) in px of it, their scores (K,) and classes (K,)."""


@dataclass(frozen=True)
class OwnDetector:
    """A detector in a file.

    Attributes:
        network: the file.
        size_px: width and height of its input.
        family: in words.
        read: its outputs.
        names: of the classes.
        whitened: whether its input is normalised by ImageNet's mean and deviation.
    """

    network: Network
    size_px: int
    family: str
    read: Read
    names: Sequence[str]
    whitened: bool = False

    @property
    def eye(self) -> Eye:
        """At work."""
        return Eye(self.look, self.size_px, GRAY)

    def look(self, view: View) -> list[Thing]:
        """The things in a view of size_px x size_px, boxes in px of the view.

        Raises:
            FileFormatError: what it gives is not what its shapes promised.
        """
        outputs = self.network.run(*self._inputs(view))
        if not all(np.isfinite(one).all() for one in outputs):
            raise FileFormatError(self.network.path, "gives numbers that are not finite for this picture")
        boxes, scores, classes = self.read(outputs, self.size_px)
        best = np.argsort(-scores, kind="stable")[:MOST_BOXES]
        best = best[scores[best] >= LEAST_SCORE]
        return [Thing(self._name(int(classes[i])), float(min(scores[i], 1.0)), boxes[i] - 0.5) for i in best]

    def _name(self, number: int) -> str:
        return self.names[number] if 0 <= number < len(self.names) else f"class {number}"

    def _inputs(self, view: View) -> list[Array]:
        """The picture in the file's own layout; a mask without holes, or the picture's size, where it takes one."""
        first, *more = self.network.inputs
        values = view.input(0.0, 255.0 if first.dtype == "uint8" else 1.0)
        if self.whitened:
            values = (values - MEAN) / DEVIATION
        if first.shape[-1] != 3:
            values = np.moveaxis(values, -1, 1)
        side = self.size_px
        return [values, *(np.ones((1, side, side)) if len(one.shape) == 3 else np.full((1, 2), side) for one in more)]


def own_detector(path: Path) -> OwnDetector:
    """The detector in a file.

    Raises:
        FileFormatError: no network, or one of no known family.
        MissingExtraError: nothing is installed that runs it.
    """
    network = Network(path)
    size_px, names = _size(network), _names(network)
    given = network.outputs
    if any(not _settled(one) for one in given):  # free sizes are known only after a run
        blank = View(np.full((size_px, size_px, 3), GRAY), np.eye(2, 3))
        probe = OwnDetector(network, size_px, "", _nothing, ())
        shapes = [one.shape for one in network.run(*probe._inputs(blank))]
        given = tuple(Tensor(t.name, tuple(s), t.dtype) for t, s in zip(given, shapes, strict=True))
    family = _family([tuple(n or 0 for n in one.shape) for one in given], None if names is None else len(names))
    if family is None:
        raise FileFormatError(path, f"gives {', '.join(map(str, given))}, of no known detector; {KNOWN}")
    title, read, count, whitened = family
    return OwnDetector(network, size_px, title, read, names or _usual(count), whitened)


def _settled(one: Tensor) -> bool:
    return all(n is not None for n in one.shape)


def _nothing(_outputs: Sequence[Array], _size_px: int) -> tuple[Array, Array, Array]:
    return np.zeros((0, 4)), np.zeros(0), np.zeros(0)


def _size(network: Network) -> int:
    """Width and height of the input, px."""
    first, *more = network.inputs
    free = len(first.shape) == 4 and first.shape[0] in (None, 1)
    sides = set(first.shape[1:3] if first.shape[-1] == 3 else first.shape[2:]) if free else set()
    channels = first.shape[-1] if first.shape[-1] == 3 else first.shape[1] if free else 0
    sides.discard(None)
    extras = all(len(one.shape) in (2, 3) and one.dtype.startswith(("int", "bool", "float")) for one in more)
    if not free or channels not in (3, None) or len(sides) > 1 or not extras:
        texts = ", ".join(map(str, network.inputs))
        raise FileFormatError(network.path, f"takes {texts}; a detector takes one square picture (1 x 3 x size x size)")
    size = sides.pop() if sides else SIZE_PX
    if not 32 <= int(size or 0) <= MOST_SIZE_PX:
        raise FileFormatError(network.path, f"takes a picture of {size} px; 32 to {MOST_SIZE_PX} px are supported")
    return int(size or SIZE_PX)


def _names(network: Network) -> list[str] | None:
    """Class names from the file's metadata: `names`, a dictionary or list as Python or JSON writes it."""
    text = network.metadata.get("names", "")
    if not text or len(text) > 2**18:
        return None
    try:
        said = ast.literal_eval(text)
    except (ValueError, SyntaxError, MemoryError, RecursionError, TypeError):
        return None
    if isinstance(said, dict):
        numbers = {int(key): str(name) for key, name in said.items() if str(key).isdigit() and int(key) < 10_000}
        return [numbers.get(number, f"class {number}") for number in range(max(numbers, default=-1) + 1)] or None
    return [str(name) for name in said] or None if isinstance(said, (list, tuple)) else None


def _usual(count: int) -> list[str]:
    """COCO's names where their number fits; none for any other number."""
    if count == 80:
        return COCO_80
    if count not in (90, 91):
        return []
    left = iter(COCO_80)
    return ["nothing" if number in GAPS_OF_91 else next(left) for number in range(91)]


def _family(shapes: list[tuple[int, ...]], names: int | None) -> tuple[str, Read, int, bool] | None:
    """Name, reader, number of classes (0: only the outputs tell) and normalisation of the family with these outputs."""
    if len(shapes) == 1 and len(shapes[0]) == 3:
        return _yolo(shapes[0], names)
    flat = {len(shape): shape for shape in shapes}
    boxes = [place for place, shape in enumerate(shapes) if len(shape) == 3 and shape[2] == 4]
    others = [place for place, shape in enumerate(shapes) if len(shape) == 3 and shape[2] != 4]
    if len(boxes) != 1 or len(others) != 1 or shapes[boxes[0]][:2] != shapes[others[0]][:2] or len(flat) != 1:
        return None
    count = shapes[others[0]][2]
    if count == 92 or (names is not None and count == names + 1 and count != 91):
        return "DETR", _detr(others[0], boxes[0], softmax=True), count - 1, True
    return "RT-DETR", _detr(others[0], boxes[0], softmax=False), count, count in (90, 91)


def _yolo(shape: tuple[int, ...], names: int | None) -> tuple[str, Read, int, bool] | None:
    _, rows, columns = shape
    if columns == 6 and rows <= END_TO_END and names != 1 and rows > 6:
        return "YOLO end to end", _end_to_end, 80 if names is None else names, False
    if 5 <= rows < columns:
        return "YOLO v8", _class_scores, rows - 4, False
    if 6 <= columns < rows:
        return "YOLO v5", _objectness, columns - 5, False
    return None


def _objectness(outputs: Sequence[Array], size_px: int) -> tuple[Array, Array, Array]:
    table = outputs[0][0]
    scores = table[:, 4:5] * table[:, 5:]
    return _corners(table[:, :4], size_px), scores.max(axis=-1), scores.argmax(axis=-1)


def _class_scores(outputs: Sequence[Array], size_px: int) -> tuple[Array, Array, Array]:
    table = outputs[0][0].T
    return _corners(table[:, :4], size_px), table[:, 4:].max(axis=-1), table[:, 4:].argmax(axis=-1)


def _end_to_end(outputs: Sequence[Array], size_px: int) -> tuple[Array, Array, Array]:
    table = outputs[0][0]
    return table[:, :4] * _unit(table[:, :4], size_px), table[:, 4], table[:, 5]


def _detr(logits: int, boxes: int, *, softmax: bool) -> Read:
    def read(outputs: Sequence[Array], size_px: int) -> tuple[Array, Array, Array]:
        values = outputs[logits][0]
        if softmax:
            shares = np.exp(values - values.max(axis=-1, keepdims=True))
            scores = (shares / shares.sum(axis=-1, keepdims=True))[:, :-1]
        else:
            scores = sigmoid(values)
        return _corners(outputs[boxes][0] * size_px, size_px), scores.max(axis=-1), scores.argmax(axis=-1)

    return read


def _corners(table: Array, size_px: int) -> Array:
    """Centre and size to left, top, right, bottom, px of the input."""
    scale = _unit(table, size_px)
    half = np.abs(table[:, 2:]) / 2
    return np.asarray(np.concatenate([table[:, :2] - half, table[:, :2] + half], -1) * scale)


def _unit(table: Array, size_px: int) -> float:
    """What to multiply with: some exports give shares of the input in place of px."""
    return float(size_px) if len(table) and 0 < np.abs(table).max() <= 2.0 else 1.0
