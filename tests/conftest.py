"""Shared fixtures: the example pictures, and the folder of real pictures with truth where it is at hand."""

import json
from pathlib import Path

import pytest
from hypothesis import settings

ROOT = Path(__file__).parent.parent
settings.register_profile("steady", deadline=None, derandomize=True, max_examples=60)
settings.load_profile("steady")


@pytest.fixture(scope="session")
def examples() -> Path:
    return ROOT / "examples"


@pytest.fixture(scope="session")
def truth(examples) -> dict:
    """Truth of the example pictures, by file name."""
    pictures = json.loads((examples / "truth.json").read_text())["pictures"]
    return {picture["file"]: picture for picture in pictures}


@pytest.fixture(scope="session")
def shared_data() -> Path:
    folder = ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the real pictures with truth (../shared/data) are not on this machine")
    return folder
