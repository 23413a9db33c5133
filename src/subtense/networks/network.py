"""Network: a file that turns arrays into arrays. TFLite files are run by LiteRT, ONNX files by ONNX Runtime.

Both engines come with the extra `networks` and are imported where a file is first run. A stranger's file is bounded in size,
has only the operations that the engines know themselves, and an engine's complaint becomes one line with the file's name.
"""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ..arrays import Array
from ..errors import FileFormatError, MissingExtraError
from .parts import part_of

MOST_BYTES = 512 * 2**20
"""Of a file; the largest detectors have a quarter of that."""
MOST_VALUES = 2**28
"""Of one input or output."""
THREADS = 2
"""Of one run: small networks gain nothing from more, and several pictures may be under way."""


@dataclass(frozen=True)
class Tensor:
    """An input or output.

    Attributes:
        name: as the file has it.
        shape: None where a size is free.
        dtype: NumPy's name of it.
    """

    name: str
    shape: tuple[int | None, ...]
    dtype: str

    def takes(self, shape: Sequence[int]) -> bool:
        """Whether an array of this shape fits."""
        return len(shape) == len(self.shape) and all(
            mine in (None, theirs) for mine, theirs in zip(self.shape, shape, strict=True)
        )

    def __str__(self) -> str:
        return f"{self.name} {self.dtype} ({' x '.join('any' if n is None else str(n) for n in self.shape)})"


class _Engine(Protocol):
    inputs: tuple[Tensor, ...]
    outputs: tuple[Tensor, ...]
    metadata: Mapping[str, str]

    def run(self, arrays: Sequence[Any]) -> list[Any]:
        """Outputs in the order of the file."""


class Network:
    """A network in a file.

    Each thread gets an engine of its own, so that one Network serves all threads.

    Attributes:
        path: the file.
        kind: "tflite" or "onnx", by the file's content.
        between: names of tensors given and of tensors wanted, where only that part of a TFLite network is run.
    """

    def __init__(
        self, path: str | Path, between: tuple[tuple[str, ...], tuple[str, ...]] | None = None, most_bytes: int | None = None
    ) -> None:  # fmt: skip
        """Look at the file; it is opened by an engine when something is asked of it.

        Args:
            path: the file.
            between: see the class.
            most_bytes: larger files are refused; MOST_BYTES where None.

        Raises:
            FileFormatError: no such file, too large, or neither TFLite nor ONNX.
        """
        self.path, self.between = Path(path), between
        self.kind = _kind(self.path, MOST_BYTES if most_bytes is None else most_bytes)
        self._kept = threading.local()

    @property
    def inputs(self) -> tuple[Tensor, ...]:
        """What it takes."""
        return self._engine.inputs

    @property
    def outputs(self) -> tuple[Tensor, ...]:
        """What it gives."""
        return self._engine.outputs

    @property
    def metadata(self) -> Mapping[str, str]:
        """What an ONNX file says of itself, as `names`; empty for TFLite."""
        return self._engine.metadata

    def expect(self, inputs: Sequence[Sequence[int]], outputs: Sequence[Sequence[int]]) -> Network:
        """The network itself, if it takes and gives arrays of these shapes.

        Raises:
            FileFormatError: it has other inputs or outputs.
        """
        for what, wanted, found in (("takes", inputs, self.inputs), ("gives", outputs, self.outputs)):
            if len(wanted) != len(found) or not all(t.takes(shape) for t, shape in zip(found, wanted, strict=True)):
                texts = " and ".join(" x ".join(map(str, shape)) for shape in wanted)
                raise FileFormatError(self.path, f"{what} {', '.join(map(str, found))}, and not {texts}")
        return self

    def run(self, *arrays: Array) -> list[Array]:
        """Outputs for inputs, both in the order of the file.

        Args:
            arrays: one for each input; they are converted to its type.

        Raises:
            FileFormatError: the file can't be run, or takes other arrays than these.
            MissingExtraError: the extra `networks` is not installed.
        """
        engine = self._engine
        if len(arrays) != len(engine.inputs):
            raise FileFormatError(self.path, f"takes {len(engine.inputs)} arrays, not {len(arrays)}")
        for tensor, array in zip(engine.inputs, arrays, strict=True):
            if not tensor.takes(array.shape):
                raise FileFormatError(self.path, f"takes {tensor}, not an array of {' x '.join(map(str, array.shape))}")
        given = [np.ascontiguousarray(a, np.dtype(t.dtype)) for t, a in zip(engine.inputs, arrays, strict=True)]
        with _complaints_of(self.path):
            return [np.asarray(one, float) for one in engine.run(given)]

    @property
    def _engine(self) -> _Engine:
        """Of this thread."""
        kept: _Engine | None = getattr(self._kept, "engine", None)
        if kept is not None:
            return kept
        with _complaints_of(self.path):
            engine: _Engine = _TFLite(self.path, self.between) if self.kind == "tflite" else _Onnx(self.path)
        for tensor in (*engine.inputs, *engine.outputs):
            if np.prod([n or 1 for n in tensor.shape], dtype=float) > MOST_VALUES:
                raise FileFormatError(self.path, f"has {tensor}, which is more than {MOST_VALUES} values")
        self._kept.engine = engine
        return engine


def _kind(path: Path, most_bytes: int) -> str:
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            head = file.read(8)
    except OSError as error:
        raise FileFormatError(path, f"cannot be read: {error.strerror}") from None
    if size > most_bytes:
        raise FileFormatError(path, f"has {size / 2**20:.0f} MiB; a network of up to {most_bytes // 2**20} MiB is run")
    if head[4:8] == b"TFL3":
        return "tflite"
    if head[:1] == b"\x08" and len(head) == 8:  # protobuf: field 1, the version of ONNX's format
        return "onnx"
    raise FileFormatError(path, "is neither a TFLite nor an ONNX network")


@contextlib.contextmanager
def _complaints_of(path: Path) -> Iterator[None]:
    """What an engine says of a file, as one line; its exceptions have no common class but Exception."""
    try:
        yield
    except (MissingExtraError, FileFormatError, MemoryError):
        raise
    except Exception as error:
        said = " ".join(str(error).split())
        raise FileFormatError(path, f"is no network that can be run: {said[:200] or type(error).__name__}") from None


class _TFLite:
    """LiteRT's interpreter."""

    def __init__(self, path: Path, between: tuple[tuple[str, ...], tuple[str, ...]] | None) -> None:
        try:
            from ai_edge_litert.interpreter import Interpreter
        except ImportError:
            raise MissingExtraError("running TFLite networks", "networks") from None
        with _unsaid():
            given_by = {"model_content": part_of(path.read_bytes(), *between)} if between else {"model_path": str(path)}
            self._interpreter = Interpreter(**given_by, num_threads=THREADS)
            self._interpreter.allocate_tensors()
        given, got = self._interpreter.get_input_details(), self._interpreter.get_output_details()
        self._in, self._out = [one["index"] for one in given], [one["index"] for one in got]
        self.inputs, self.outputs = tuple(map(_tensor, given)), tuple(map(_tensor, got))
        self.metadata: Mapping[str, str] = {}

    def run(self, arrays: Sequence[Any]) -> list[Any]:
        """Outputs are copied: the interpreter writes over its own."""
        for index, array in zip(self._in, arrays, strict=True):
            self._interpreter.set_tensor(index, array)
        self._interpreter.invoke()
        return [self._interpreter.get_tensor(index) for index in self._out]


def _tensor(details: Mapping[str, Any]) -> Tensor:
    shape = details.get("shape_signature", details["shape"])
    sizes = tuple(None if n < 0 else int(n) for n in (shape if len(shape) else details["shape"]))
    return Tensor(str(details["name"]), sizes, np.dtype(details["dtype"]).name)


_STARTED = threading.Lock()


@contextlib.contextmanager
def _unsaid() -> Iterator[None]:
    """LiteRT announces its processor kernels on the error stream, and has no switch for it."""
    with _STARTED:
        try:
            kept = os.dup(2)
        except OSError:  # a process without an error stream
            yield
            return
        nowhere = os.open(os.devnull, os.O_WRONLY)
        try:
            os.dup2(nowhere, 2)
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            os.close(nowhere)


class _Onnx:
    """ONNX Runtime's session."""

    def __init__(self, path: Path) -> None:
        try:
            import onnxruntime
        except ImportError:
            raise MissingExtraError("running ONNX networks", "networks") from None
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads, options.inter_op_num_threads = THREADS, 1
        options.log_severity_level = 4
        self._session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        self.inputs = tuple(map(_onnx_tensor, self._session.get_inputs()))
        self.outputs = tuple(map(_onnx_tensor, self._session.get_outputs()))
        self.metadata: Mapping[str, str] = dict(self._session.get_modelmeta().custom_metadata_map)

    def run(self, arrays: Sequence[Any]) -> list[Any]:
        """Of all outputs."""
        names = [tensor.name for tensor in self.inputs]
        return list(self._session.run(None, dict(zip(names, arrays, strict=True))))


def _onnx_tensor(node: Any) -> Tensor:
    kinds = {"float": "float32", "double": "float64"}
    word = str(node.type).removeprefix("tensor(").removesuffix(")")
    shape = tuple(n if isinstance(n, int) and n > 0 else None for n in node.shape)
    return Tensor(str(node.name), shape, kinds.get(word, word))
