"""The pure parts of the page, by Vitest."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.skipif(not (ROOT / "page" / "node_modules").is_dir(), reason="the page's packages are not installed here")
def test_vitest_passes():
    done = subprocess.run(
        [sys.executable, ROOT / "tools" / "page.py", "test"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
