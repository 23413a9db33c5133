"""A limited child process: it alone decodes what strangers send, and searches in it.

It has no network, a bounded address space, processor time and file size, no standard input, and an empty folder of its own,
where alone it may write.
It prints one JSON object a line: {"progress": share, "doing": what}, and at last {"result": ...} or {"error": {...}}.
"""

from __future__ import annotations

import ctypes
import json
import os
import platform
import signal
import struct
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Pixels
from ..errors import InputError, MissingExtraError, SubtenseError

if TYPE_CHECKING:
    from ..photo import Photo

SPARE_BYTES = 64 * 2**20
"""What a decoder needs at the least, beside what this process has when it starts."""


def main() -> None:
    """Limit this process, do what its one argument says, print the outcome."""
    task = json.loads(sys.argv[1])
    most = int(task["limits"]["memory_bytes"])
    if own_bytes() + SPARE_BYTES > most:  # it would die of anything, anywhere
        text = f"{task['name']}: a decoder needs more than {most // 2**20} MiB of memory (memory_bytes)"
        say(error={"type": "FileFormatError", "message": text, "name": "memory_bytes"})
        return
    limit(task["limits"])
    try:
        say(result=TASKS[task["do"]](task))
    except SubtenseError as error:
        say(error=fault(error, task["limits"]))


def fault(error: SubtenseError, limits: dict[str, int]) -> dict[str, Any]:
    """The error, and which limit, field or extra it is about, if one."""
    name, text = None, str(error)
    if isinstance(error, InputError):
        name = error.name.lstrip("-").replace("-", "_")
    elif isinstance(error, MissingExtraError):
        name = error.extra
    elif isinstance(error.__context__, MemoryError):
        name, text = "memory_bytes", f"{text}; {limits['memory_bytes'] // 2**20} MiB are allowed (memory_bytes)"
    elif "million; the limit is" in text:
        name, text = "pixels", f"{text} (pixels)"
    return {"type": type(error).__name__, "message": text, "name": name}


def own_bytes() -> int:
    """Address space of this process before it has done anything; 0 where the system does not tell."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, AttributeError):
        return 0


def say(**words: Any) -> None:
    """One line to the server."""
    sys.stdout.write(json.dumps(words) + "\n")
    sys.stdout.flush()


def limit(limits: dict[str, int]) -> None:
    """Bound this process; what an operating system does not have is left out."""
    try:
        import resource
    except ImportError:  # Windows: the server's own time limit still holds
        return
    for name, most in (
        ("RLIMIT_AS", limits["memory_bytes"]), ("RLIMIT_CPU", limits["cpu_s"]), ("RLIMIT_NOFILE", 64), ("RLIMIT_CORE", 0),
        ("RLIMIT_FSIZE", limits["file_bytes"]),
    ):  # fmt: skip
        kind = getattr(resource, name, None)
        if kind is not None:
            try:
                resource.setrlimit(kind, (most, most))
            except (ValueError, OSError):  # macOS refuses some
                continue
    _end_with_the_server()
    write_only_in(Path())
    deny_network()


_ARCHITECTURES = {
    "x86_64": (0xC000003E, (41, 59, 322, 101, 310, 311, 425, 438)),
    "aarch64": (0xC00000B7, (198, 221, 281, 117, 270, 271, 425, 438)),
}
"""Audit architecture, and the numbers of socket, execve, execveat, ptrace, process_vm_readv, process_vm_writev, io_uring_setup,
pidfd_getfd: the last five are other doors to a socket."""


def deny_network() -> bool:
    """On Linux: a seccomp filter under which sockets and programs can't be had; False where there is none."""
    if sys.platform != "linux" or platform.machine() not in _ARCHITECTURES:
        return False
    architecture, calls = _ARCHITECTURES[platform.machine()]
    load, equal, least, give = 0x20, 0x15, 0x35, 0x06
    allow, refuse = 0x7FFF0000, 0x00050001  # SECCOMP_RET_ALLOW; SECCOMP_RET_ERRNO | EPERM
    end = len(calls) + 5
    steps = [(load, 0, 0, 4), (equal, 0, end - 2, architecture), (load, 0, 0, 0)]
    steps += [(least, end - 4, 0, 0x40000000)]  # the numbers of x86's other calling convention
    steps += [(equal, end - 5 - i, 0, call) for i, call in enumerate(calls)]
    steps += [(give, 0, 0, allow), (give, 0, 0, refuse)]
    code = ctypes.create_string_buffer(b"".join(struct.pack("HBBI", *step) for step in steps))
    program = ctypes.create_string_buffer(struct.pack("HxxxxxxP", len(steps), ctypes.addressof(code)))
    libc = _unprivileged()
    return bool(libc.prctl(22, 2, program, 0, 0) == 0)  # PR_SET_SECCOMP, SECCOMP_MODE_FILTER


def write_only_in(folder: Path) -> bool:
    """On Linux 5.13 or later: a Landlock rule by which files are made and changed below a folder only, and what is written to
    /dev/null is lost as ever (networks are silenced by it); False where there is none."""
    if sys.platform != "linux":
        return False
    libc = _unprivileged()
    version = libc.syscall(444, None, 0, 1)  # landlock_create_ruleset, for its version
    if version < 1:
        return False
    rights = 1 << 1 | sum(1 << bit for bit in range(4, 13))  # write; remove and make entries of every kind
    rights |= (1 << 13 if version >= 2 else 0) | (1 << 14 if version >= 3 else 0)  # move between folders; truncate
    ruleset = libc.syscall(444, ctypes.create_string_buffer(struct.pack("Q", rights), 8), 8, 0)
    made = ruleset >= 0
    for place, allowed in ((folder, rights), (Path(os.devnull), 1 << 1 | rights & 1 << 14)):
        handle = os.open(place, os.O_PATH)
        rule = ctypes.create_string_buffer(struct.pack("=Qi", allowed, handle), 12)
        made = bool(made and libc.syscall(445, ruleset, 1, rule, 0) == 0)
        os.close(handle)
    made = bool(made and libc.syscall(446, ruleset, 0) == 0)
    if ruleset >= 0:
        os.close(ruleset)
    return made


def _unprivileged() -> Any:
    """The C library, after this process gave up ever getting more rights."""
    libc = ctypes.CDLL(None, use_errno=True)
    libc.prctl(38, 1, 0, 0, 0)  # PR_SET_NO_NEW_PRIVS
    return libc


def _end_with_the_server() -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGKILL, 0, 0, 0)  # PR_SET_PDEATHSIG


# -- what it does ------------------------------------------------------------------------------------


def decode(task: dict[str, Any]) -> dict[str, Any]:
    """Decode the picture `input` into `pixels.bin`: the whole picture, then each half as large, down to one tile."""
    from ..photo import Photo

    made: list[np.memmap[Any, Any]] = []

    def room(height_px: int, width_px: int) -> Pixels:
        made.append(np.memmap("pixels.bin", np.uint8, "w+", shape=(height_px, width_px, 3)))
        return made[0]

    photo = Photo.load(Path("input"), name=task["name"], most_pixels=task["limits"]["pixels"], pixels=room)
    say(progress=0.7)
    sizes = _pyramid(made[0], task["tile_px"])
    made[0].flush()
    return {
        "digest": photo.digest,
        "metadata": photo.metadata.to_json(),
        "notes": [note.to_json() for note in photo.notes],
        "sizes": sizes,
    }


def _pyramid(pixels: Pixels, tile_px: int) -> list[tuple[int, int]]:
    """Append levels of half the size to the file; (width, height) of each, largest first."""
    import cv2

    sizes = [(pixels.shape[1], pixels.shape[0])]
    level = pixels
    with Path("pixels.bin").open("ab") as file:
        while max(sizes[-1]) > tile_px:
            width, height = ((side + 1) // 2 for side in sizes[-1])
            level = cv2.resize(level, (width, height), interpolation=cv2.INTER_AREA)
            file.write(level.data)
            sizes.append((width, height))
    return sizes


def _decoded(task: dict[str, Any]) -> Photo:
    """The picture that was decoded before, whose pixels are in `path`, with the metadata beside them."""
    from ..photo import Metadata, Photo

    width, height = task["size"]
    pixels = np.memmap(task["path"], np.uint8, "r", shape=(height, width, 3))
    tags = Metadata.from_json(json.loads(Path(task["path"]).with_name("metadata.json").read_text("utf-8")))
    return Photo(pixels, tags, Path(task["name"]), "")


def detect(task: dict[str, Any]) -> dict[str, Any]:
    """Search the decoded picture with a row of DETECTORS, or all that look unasked."""
    from ..camera import Camera
    from ..detection import Search, parse_curve, unknown_curve
    from ..targets import find_target
    from ..workflow.detect import detect as detect_in
    from ..workflow.detect import detection_json
    from ..workflow.measure import assumed

    stated = tuple(find_target(name) for name in task["targets"])
    search = Search(
        stated, task["family"], parse_curve(task["curve"]) if task["curve"] else unknown_curve(), task["thorough"],
        camera=Camera.from_json(task["camera"]) if task["camera"] else None,
    )  # fmt: skip
    found = detect_in(
        _decoded(task), task["only"], search, progress=lambda title, share: say(progress=share, doing=title)
    )
    detections = [
        {
            **detection_json(one),
            "detector": by,
            "notes": [note.to_json() for note in (*assumed(one, stated), *one.notes)],
        }
        for one, by in zip(found.detections, found.detectors, strict=True)
    ]
    return {"detections": detections, "notes": [note.to_json() for note in found.notes]}


def outline(task: dict[str, Any]) -> dict[str, Any]:
    """The outline of what is at `place` of the decoded picture."""
    from ..workflow.detect import WAYS
    from ..workflow.outline import outlined

    found, extents, notes = outlined(_decoded(task), np.array(task["place"]), person=task["person"])
    way = WAYS["length"]
    return {
        "contour_px": np.round(found.contour.points_px, 2).tolist(),
        "extents": {name: seen.to_json() for name, seen in extents.items()}, "area_px": found.area_px,
        "u_area_px": found.u_area_px, "notes": [note.to_json() for note in notes], "method": way.method,
        "points_field": way.points, "size_field": way.size,
    }  # fmt: skip


TASKS = {"decode": decode, "detect": detect, "outline": outline}

if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    main()
