"""Every exception of subtense.

    SubtenseError
    ├── InputError(ValueError)          a value cannot be used: which, what it was, what is allowed
    ├── UnknownCameraError              no intrinsics: each source tried, why it failed, what to give
    ├── NothingFoundError               a detector found too little: how many, how many are needed
    ├── GeometryError                   valid inputs, but this view has no finite answer
    ├── FileFormatError(ValueError)     a file cannot be read: path, place, reason
    └── MissingExtraError(ImportError)  says what to install

Every message is one line that names the value and the cure. `exit_code` is what the command line returns.
"""

from __future__ import annotations

from typing import ClassVar


class SubtenseError(Exception):
    """The root: catch this to catch everything subtense raises on purpose."""

    exit_code: ClassVar[int] = 2


class InputError(SubtenseError, ValueError):
    """A value cannot be used.

    Attributes:
        name: which value, as the user knows it ("--size", "f_px").
        given: what it was; None where it is missing.
        allowed: what is allowed instead.
    """

    def __init__(self, name: str, given: object, allowed: str) -> None:
        self.name, self.given, self.allowed = name, given, allowed
        shown = "missing" if given is None else f"{given!r}" if isinstance(given, str) else f"{given}"
        if len(shown) > 80:
            shown = shown[:77] + "..."
        super().__init__(f"{name} is {shown}; {allowed}")


class UnknownCameraError(SubtenseError):
    """No intrinsics could be had.

    Attributes:
        tried: (source, why it failed) for each camera source.
        code: of the note that says so: "no_focal_length", "panorama", "perspective_edited", or "unknown_camera".
    """

    def __init__(self, message: str, tried: tuple[tuple[str, str], ...] = (), *, code: str = "unknown_camera") -> None:
        self.tried, self.code = tried, code
        super().__init__(message)


class NothingFoundError(SubtenseError):
    """A detector found too little.

    Attributes:
        found: how many things were found.
        needed: how many are needed.
    """

    exit_code = 3

    def __init__(self, message: str, *, found: int = 0, needed: int = 1) -> None:
        self.found, self.needed = found, needed
        super().__init__(message)


class GeometryError(SubtenseError):
    """The inputs are valid, but this view has no finite answer.

    Attributes:
        code: the machine-readable reason, as in notes and batch rows.
    """

    exit_code = 3

    def __init__(self, message: str, *, code: str) -> None:
        self.code = code
        super().__init__(message)


class FileFormatError(SubtenseError, ValueError):
    """A file cannot be read.

    Attributes:
        path: the file.
        reason: what is wrong with it, and where.
        code: machine-readable, where there is one: "partial_file" for a picture that is cut or damaged.
    """

    def __init__(self, path: object, reason: str, *, code: str | None = None) -> None:
        self.path, self.reason, self.code = str(path), reason, code
        super().__init__(f"{path}: {reason}")


class MissingExtraError(SubtenseError, ImportError):
    """An optional part is not installed.

    Attributes:
        extra: the name to install, as in `pip install "subtense[extra]"`.
    """

    def __init__(self, what: str, extra: str, cure: str | None = None) -> None:
        self.extra = extra
        super().__init__(
            f"{what}: {cure}"
            if cure
            else f'{what} needs an extra that is not installed; pip install "subtense[{extra}]"'
        )
