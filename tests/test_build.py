"""The build hook: when it builds the page, what it asks for, and what it says where npm can't be reached."""

import shutil
from pathlib import Path

import pytest
from hatch_build import NODE, PageHook

ROOT = Path(__file__).parent.parent


def hook(root: Path) -> PageHook:
    return PageHook(str(root), {}, None, None, str(root), "wheel")


@pytest.fixture
def project(tmp_path) -> Path:
    """The page's sources alone, nothing built and nothing installed."""
    shutil.copytree(ROOT / "page", tmp_path / "page", ignore=shutil.ignore_patterns("node_modules"))
    return tmp_path


def test_node_is_wanted_only_where_there_is_a_page_to_build(project, monkeypatch):
    assert hook(project).dependencies() == [NODE]
    static = project / "src" / "subtense" / "web" / "static"
    static.mkdir(parents=True)
    (static / ".built-from").write_text(hook(project).digest())
    assert hook(project).dependencies() == []
    with (project / "page" / "src" / "page.css").open("a") as file:
        file.write("/* changed */")
    assert hook(project).dependencies() == [NODE]
    monkeypatch.setenv("SUBTENSE_WITHOUT_PAGE", "1")
    assert hook(project).dependencies() == []


def test_a_source_archive_without_the_page_needs_nothing(tmp_path):
    hook(tmp_path).initialize("standard", {})
    assert hook(tmp_path).dependencies() == []


def test_without_npm_the_error_says_what_to_do(project, monkeypatch):
    monkeypatch.setenv("npm_config_registry", "http://127.0.0.1:9/")
    monkeypatch.setenv("npm_config_cache", str(project / "cache"))
    monkeypatch.setenv("npm_config_fetch_retries", "0")
    with pytest.raises(SystemExit, match=r"npm can't get what the page is built with(.|\n)*SUBTENSE_WITHOUT_PAGE=1"):
        hook(project).initialize("standard", {})
    assert not (project / "src").exists()


def test_the_lock_file_names_no_address():
    text = (ROOT / "page" / "package-lock.json").read_text()
    assert "http" not in "".join(line for line in text.splitlines() if "resolved" in line)
    assert '"resolved"' not in text
