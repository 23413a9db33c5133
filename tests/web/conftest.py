"""One server with the usual limits for each process of the tests."""

from collections.abc import Iterator

import pytest
from browsing import ARGUMENTS, CHROMIUM, Visit, visiting
from running import Server, serving


@pytest.fixture(scope="session")
def server(tmp_path_factory) -> Iterator[Server]:
    with serving(tmp_path_factory.mktemp("server")) as found:
        yield found


@pytest.fixture(scope="session")
def browser_type_launch_args() -> dict:
    """Debian's Chromium, with no way out of this machine."""
    return {"executable_path": CHROMIUM, "args": ARGUMENTS}


@pytest.fixture
def visit(browser, server) -> Iterator[Visit]:
    """A desktop visit in the light theme."""
    found = visiting(browser, server)
    yield found
    found.context.close()
    assert found.unexpected() == []
