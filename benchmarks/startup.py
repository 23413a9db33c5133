"""How long a whole process takes from start to answer, against the imports that nobody can avoid."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from comparison import Comparison, compare, table

CALC = ("calc", "--focal", "35", "--sensor-width", "14.1", "--image-width", "4096", "--size", "200", "--extent", "150")


def comparisons(turns: int = 21) -> list[Comparison]:
    """The calculator and the help text."""
    command = str(Path(sys.executable).with_name("subtense"))
    return [
        compare("subtense calc, whole process", _process(command, *CALC), 'python -c "import numpy"',
                _process(sys.executable, "-c", "import numpy"), turns=turns, target=2),
        compare("subtense --help, whole process", _process(command, "--help"), 'python -c "import click"',
                _process(sys.executable, "-c", "import click"), turns=turns, target=1.5),
    ]  # fmt: skip


def _process(*words: str) -> Callable[[], object]:
    return lambda: subprocess.run(words, stdout=subprocess.DEVNULL, check=True)


if __name__ == "__main__":
    print(table(comparisons()))
