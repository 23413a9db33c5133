"""The build hook: when it builds the page and fetches the networks, and what it says where npm can't be reached."""

import json
import shutil
from pathlib import Path

import pytest
from hatch_build import NETWORKS, NODE, BuildHook, Networks, Page, taken_from

ROOT = Path(__file__).parent.parent
FILES = {name for names in NETWORKS.values() for name in names}


def hook(root: Path) -> BuildHook:
    return BuildHook(str(root), {}, None, None, str(root), "wheel")


@pytest.fixture
def page_project(tmp_path) -> Path:
    """The page's sources alone, nothing built and nothing installed."""
    shutil.copytree(ROOT / "page", tmp_path / "page", ignore=shutil.ignore_patterns("node_modules"))
    return tmp_path


@pytest.fixture
def networks_project(tmp_path) -> Path:
    """What says which networks there are, and nothing fetched."""
    shutil.copytree(ROOT / "networks", tmp_path / "networks")
    shutil.copy(ROOT / "LICENSE", tmp_path)
    return tmp_path


def no_npm(monkeypatch, project):
    monkeypatch.setenv("npm_config_registry", "http://127.0.0.1:9/")
    monkeypatch.setenv("npm_config_cache", str(project / "cache"))
    monkeypatch.setenv("npm_config_fetch_retries", "0")


def test_node_is_wanted_only_where_there_is_a_page_to_build(page_project, monkeypatch):
    assert hook(page_project).dependencies() == [NODE]
    static = page_project / "src" / "subtense" / "web" / "static"
    static.mkdir(parents=True)
    (static / ".built-from").write_text(Page(page_project).digest())
    assert hook(page_project).dependencies() == []
    with (page_project / "page" / "src" / "page.css").open("a") as file:
        file.write("/* changed */")
    assert hook(page_project).dependencies() == [NODE]
    monkeypatch.setenv("SUBTENSE_WITHOUT_PAGE", "1")
    assert hook(page_project).dependencies() == []


def test_node_is_wanted_only_where_there_are_networks_to_fetch(networks_project, monkeypatch):
    assert hook(networks_project).dependencies() == [NODE]
    files = networks_project / "src" / "subtense" / "networks" / "files"
    files.mkdir(parents=True)
    (files / ".built-from").write_text(Networks(networks_project).digest())
    assert hook(networks_project).dependencies() == []
    (files / ".built-from").write_text("of other packages")
    assert hook(networks_project).dependencies() == [NODE]
    monkeypatch.setenv("SUBTENSE_WITHOUT_NETWORKS", "1")
    assert hook(networks_project).dependencies() == []


def test_a_source_archive_without_either_needs_nothing(tmp_path):
    hook(tmp_path).initialize("standard", {})
    assert hook(tmp_path).dependencies() == []


def test_without_npm_the_error_says_what_to_do(page_project, monkeypatch):
    no_npm(monkeypatch, page_project)
    with pytest.raises(SystemExit, match=r"npm can't get what the page is built with(.|\n)*SUBTENSE_WITHOUT_PAGE=1"):
        hook(page_project).initialize("standard", {})
    assert not (page_project / "src").exists()


def test_networks_without_npm_the_same(networks_project, monkeypatch):
    no_npm(monkeypatch, networks_project)
    with pytest.raises(SystemExit, match=r"npm can't get the networks(.|\n)*SUBTENSE_WITHOUT_NETWORKS=1"):
        hook(networks_project).initialize("standard", {})
    assert not (networks_project / "src").exists()


def test_a_clean_build_has_every_network_with_its_licence(networks_project, monkeypatch):
    monkeypatch.setenv("SUBTENSE_WITHOUT_PAGE", "1")
    hook(networks_project).initialize("editable", {})
    files = networks_project / "src" / "subtense" / "networks" / "files"
    assert {file.name for file in files.iterdir()} == {*FILES, "NOTICE", "LICENSE", ".built-from"}
    for file in files.glob("*.tflite"):
        assert file.read_bytes()[4:8] == b"TFL3", file.name
    notice = (files / "NOTICE").read_text()
    assert all(package in notice for package in NETWORKS) and all(name in notice for name in FILES)
    assert "Apache License" in (files / "LICENSE").read_text()
    assert sum(file.stat().st_size for file in files.iterdir()) < 40e6
    assert not (networks_project / "networks" / "node_modules").exists()
    assert hook(networks_project).dependencies() == []


def test_this_installation_has_the_networks_of_its_sources():
    files = ROOT / "src" / "subtense" / "networks" / "files"
    assert (files / ".built-from").read_text() == Networks(ROOT).digest()


def test_a_file_is_taken_out_of_packed_assets(tmp_path):
    (tmp_path / "face_packed_assets.data").write_bytes(b"onetwothree")
    table = {
        "files": [{"filename": "/a/one.txt", "start": 0, "end": 3}, {"filename": "/b/two.txt", "start": 3, "end": 6}]
    }
    loader = "var x = 1; loadPackage(" + json.dumps(table) + ");"
    (tmp_path / "face_packed_assets_loader.js").write_text(loader)
    assert taken_from(tmp_path, "two.txt") == b"two"
    with pytest.raises(SystemExit, match=r"has no three\.txt"):
        taken_from(tmp_path, "three.txt")


@pytest.mark.parametrize("folder", ["page", "networks"])
def test_the_lock_file_names_no_address_and_every_digest(folder):
    text = (ROOT / folder / "package-lock.json").read_text()
    assert '"resolved"' not in text
    rows = {name: row for name, row in json.loads(text)["packages"].items() if name}
    assert all(row["integrity"].startswith("sha512-") for row in rows.values())
