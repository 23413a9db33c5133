"""The documentation is run: every command and every Python example in it, and every table against the code.

    ```console          commands are run one after the other; the lines below one are its output, in order, from the
    $ subtense ...      first to the last; a line `...` stands for any number of lines left out. A line that begins
    ```                 with `subtense:` or `Error:` means that the command fails.

    ```python           is executed, one namespace per page; a ```text block right behind it is what it prints.
    ```

Each page runs in a folder of its own, in which `examples/` is the repository's.
"""

from __future__ import annotations

import contextlib
import difflib
import io
import re
import shlex
import sys
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import click
import pytest
from click.testing import CliRunner

import subtense
from subtense.assumptions import LISTED
from subtense.cli import main
from subtense.method import Method, Reason
from subtense.workflow.tables import CAMERA_SOURCES, DETECTORS, METHODS, REPORTS

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))
RUN = [*PAGES, ROOT / "README.md"]
SKIP = "..."


def page(name: str) -> str:
    return (DOCS / name).read_text("utf-8")


# -- reading a page ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, its lines, the number of its first line, and whether it follows another directly."""

    language: str
    lines: tuple[str, ...]
    first: int
    adjoins: bool


def blocks(text: str) -> Iterator[Block]:
    language, lines, first, last_end = None, [], 0, -9
    for number, line in enumerate(text.splitlines(), 1):
        fence = re.fullmatch(r"\s*```(\S*).*", line)
        if language is None and fence:
            language, lines, first = fence.group(1), [], number + 1
        elif language is not None and fence:
            yield Block(language, tuple(lines), first, first - last_end <= 3)
            language, last_end = None, number
        elif language is not None:
            lines.append(line)
    assert language is None, f"a block that begins before line {first} is not closed"


def commands(block: Block) -> Iterator[tuple[str, int, list[str]]]:
    """Each command of a console block, the number of the line below it, and the lines shown there."""
    command, first, shown = "", 0, []
    for number, line in enumerate(block.lines, block.first):
        if command.endswith("\\"):
            command, first = command[:-1] + line.strip(), number + 1
        elif line.startswith("$ "):
            if command:
                yield command, first, shown
            command, first, shown = line[2:], number + 1, []
        else:
            shown.append(line.rstrip())
    yield command, first, shown


def differs(shown: list[str], output: list[str]) -> str:
    """The first shown line that is not there in its turn; empty if all are."""
    place, free = 0, False
    for line in shown:
        if line.strip() == SKIP:
            free = True
            continue
        if free:
            while place < len(output) and output[place] != line:
                place += 1
        if place == len(output) or output[place] != line:
            return line or "(an empty line)"
        place, free = place + 1, False
    return "" if free or place == len(output) else f"(the end; but there follows: {output[place]})"


def trimmed(lines: Iterable[str]) -> list[str]:
    """Without empty lines before and behind."""
    return "\n".join(line.rstrip() for line in lines).strip("\n").splitlines()


# -- running it --------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Shown:
    """What a page shows of one run, the number of its first line, and what the run printed."""

    what: str
    first: int
    lines: list[str]
    printed: list[str]


def run_command(command: str, first: int, shown: list[str]) -> Shown:
    """Run a command; `> FILE` at its end writes the output there."""
    words = shlex.split(command)[1:]
    file = None
    if len(words) > 2 and words[-2] == ">":
        file, words = Path(words[-1]), words[:-2]
    result = CliRunner().invoke(main, words)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    fails = any(line.startswith(("subtense:", "Error:")) for line in shown)
    assert (result.exit_code != 0) == fails, f"line {first}: {command} exits with {result.exit_code}\n{result.output}"
    if file is not None:
        file.write_text(result.output, "utf-8")
    return Shown(command, first, shown, [] if file else trimmed(result.output.splitlines()))


def run_python(block: Block, module: ModuleType, path: Path) -> list[str]:
    printed = io.StringIO()
    # empty lines ahead make a traceback tell the line of the page
    code = compile("\n" * (block.first - 1) + "\n".join(block.lines), str(path), "exec", dont_inherit=True)
    with contextlib.redirect_stdout(printed):
        exec(code, module.__dict__)
    return trimmed(printed.getvalue().splitlines())


def run_page(path: Path, folder: Path) -> Iterator[Shown]:
    """Run everything on a page, in a folder of its own."""
    (folder / "examples").symlink_to(ROOT / "examples")
    module = ModuleType(f"page_{path.stem}")
    sys.modules[module.__name__] = module
    printed = None
    try:
        with contextlib.chdir(folder):
            for block in blocks(path.read_text("utf-8")):
                if block.language == "console":
                    for command, first, shown in commands(block):
                        if command.startswith("subtense"):
                            yield run_command(command, first, shown)
                elif block.language == "text" and block.adjoins and printed is not None:
                    yield Shown("python", block.first, list(block.lines), printed)
                printed = run_python(block, module, path) if block.language == "python" else None
    finally:
        del sys.modules[module.__name__]


@pytest.mark.parametrize("path", RUN, ids=lambda path: path.name)
def test_examples(path: Path, tmp_path: Path) -> None:
    wrong = []
    for run in run_page(path, tmp_path):
        missing = differs(trimmed(run.lines), run.printed)
        if missing:
            printed = "\n".join(run.printed)
            wrong.append(f"line {run.first}: {run.what}\nthe page shows: {missing}\nit prints:\n{printed}\n")
    assert not wrong, f"{path.name} (python {Path(__file__).name} brings it up to date):\n" + "\n".join(wrong)


def refreshed(run: Shown) -> list[str]:
    """The shown lines with each one replaced by the printed line that is most like it, in order."""
    place, lines = 0, []
    for line in run.lines:
        rest = run.printed[place:]
        if line.strip() in ("", SKIP) or not rest:
            lines.append(line)
            continue
        likeness = [difflib.SequenceMatcher(None, line, other).ratio() for other in rest]
        best = max(range(len(rest)), key=likeness.__getitem__)
        lines.append(rest[best])
        place += best + 1
    return lines


def refresh(path: Path) -> None:
    """Bring the shown outputs of a page up to date; look at the difference before it is committed."""
    with tempfile.TemporaryDirectory() as folder:
        runs = list(run_page(path, Path(folder)))
    lines = path.read_text("utf-8").splitlines()
    for run in runs:
        lines[run.first - 1 : run.first - 1 + len(run.lines)] = refreshed(run)
    text = "\n".join(lines) + "\n"
    if text != path.read_text("utf-8"):
        path.write_text(text, "utf-8")
        print(f"{path.name} changed")


def test_shown_lines_are_compared_in_order() -> None:
    output = ["a", "b", "c", "d"]
    assert differs(["a", "...", "c", "..."], output) == ""
    assert differs(["...", "d"], output) == ""
    assert differs(["a", "b", "c", "d"], output) == ""
    assert differs(["a", "c", "..."], output) == "c"
    assert differs(["...", "c", "...", "b"], output) == "b"
    assert differs(["a", "b"], output).startswith("(the end")


# -- tables ------------------------------------------------------------------------------------------------


def table(text: str, heading: str) -> list[tuple[str, ...]]:
    """The cells of the first table behind a heading, without its head; code marks around a whole cell are left out."""
    assert f"\n{heading}\n" in text, f"there is no heading {heading!r}"
    rows = []
    for line in text.split(f"\n{heading}\n", 1)[1].splitlines():
        if line.startswith("|"):
            cells = [cell.strip().replace("\\|", "|") for cell in re.split(r"(?<!\\)\|", line.strip())[1:-1]]
            rows.append(tuple(re.sub(r"^`([^`]*)`$", r"\1", cell) for cell in cells))
        elif rows or line.startswith("#"):
            break
    assert len(rows) > 2, f"there is no table behind {heading!r}"
    return rows[2:]


def test_default_uncertainties() -> None:
    assert table(page("conventions.md"), "## Default uncertainties") == list(LISTED)


def test_methods() -> None:
    def row(method: Method) -> tuple[str, ...]:
        needs = " ".join(method.needs.split())
        return f"[`{method.name}`](#{method.name})", needs, "; ".join(method.assumes), method.typical, method.source

    text = page("methods.md")
    assert table(text, "## All methods") == [row(method) for method in METHODS.values()]
    for name in METHODS:
        assert f"\n## {name}\n" in text, f"methods.md has no section on {name}"


@pytest.mark.parametrize("name", METHODS)
def test_outputs_of_methods(name: str) -> None:
    section = page("methods.md").split(f"\n## {name}\n", 1)[1].split("\n## ", 1)[0]
    wanted = [(o.name, o.what, o.unit, o.title) for o in METHODS[name].outputs]
    assert table(f"\n## {name}\n{section}", f"## {name}") == wanted


def test_camera_sources() -> None:
    rows = table(page("camera.md"), "## Sources")
    assert [row[0] for row in rows][-len(CAMERA_SOURCES) :] == list(CAMERA_SOURCES)


def note_codes() -> set[str]:
    source = "\n".join(path.read_text("utf-8") for path in sorted((ROOT / "src").rglob("*.py")))
    codes = re.findall(r"\bNote\(\s*\"(\w+)\"", source)
    calls = re.findall(r"\bNote\((?!code|\*\*)", source)  # `Note(**data)` brings back one that was made elsewhere
    assert len(codes) == len(calls) > 10, "a Note whose code is not a plain text can't be listed"
    return set(codes)


def test_note_codes() -> None:
    listed = [row[0] for row in table(page("notes.md"), "## Notes")]
    assert len(listed) == len(set(listed))
    assert set(listed) == note_codes()


def test_reasons() -> None:
    wanted = [(str(r.value), r.name.lower(), r.text) for r in Reason if r is not Reason.OK]
    assert [row[:3] for row in table(page("notes.md"), "## Reasons")] == wanted


def test_errors() -> None:
    from subtense import errors

    wanted = {n: c.exit_code for n, c in vars(errors).items() if isinstance(c, type) and n != "SubtenseError"}
    wanted = {n: str(code) for n, code in wanted.items() if n.endswith("Error")}
    assert {row[0]: row[1] for row in table(page("notes.md"), "## Errors")} == wanted


def test_public_names() -> None:
    text = page("python.md")
    assert [row[0] for row in table(text, "## Names")] == subtense.__all__
    documented = set(re.findall(r"^::: (\S+)$", text, re.MULTILINE))
    for name in subtense.__all__:
        module = subtense._HOME[name]
        assert {f"subtense.{module}", f"subtense.{module}.{name}"} & documented, f"python.md does not render {name}"


def test_ways_are_named_where_one_adds_to_them() -> None:
    text = page("adding.md")
    for name in (*METHODS, *DETECTORS, *REPORTS, *CAMERA_SOURCES):
        assert f"`{name}`" in text, f"adding.md does not name {name}"


def test_every_command_and_option_is_on_a_page() -> None:
    text = "\n".join(path.read_text("utf-8") for path in PAGES)
    context = click.Context(main)
    for name in main.list_commands(context):
        command = main.get_command(context, name)
        assert f"subtense {name}" in text, f"no page shows subtense {name}"
        for option in (o for o in command.params if isinstance(o, click.Option)):
            said = [word for word in option.opts if re.search(rf"{word}(?![\w-])", text)]
            assert said, f"no page names {option.opts[0]} of subtense {name}"


# -- the site ----------------------------------------------------------------------------------------------


def test_every_page_is_in_the_navigation() -> None:
    listed = re.findall(r"^\s+- [^:\n]+: (\S+\.md)$", (ROOT / "mkdocs.yml").read_text("utf-8"), re.MULTILINE)
    assert sorted(listed) == [path.name for path in PAGES]


@pytest.mark.parametrize("path", [*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"], ids=lambda path: path.name)
def test_links_lead_somewhere(path: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", path.read_text("utf-8")):
        if "://" in target:
            continue
        name, _, anchor = target.partition("#")
        there = path.parent / name if name else path
        assert there.exists(), f"{path.name} links to {name}, which is not there"
        if anchor:
            headings = re.findall(r"^#+ (.+)$", there.read_text("utf-8"), re.MULTILINE)
            slugs = {re.sub(r"[^\w -]", "", heading).strip().lower().replace(" ", "-") for heading in headings}
            assert anchor in slugs, f"{path.name} links to {target}, which has no such heading"


if __name__ == "__main__":
    for one in RUN:
        if one.read_text("utf-8").strip():
            refresh(one)
