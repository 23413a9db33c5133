"""One server with the usual limits for each process of the tests."""

from collections.abc import Iterator

import pytest
from running import Server, serving


@pytest.fixture(scope="session")
def server(tmp_path_factory) -> Iterator[Server]:
    with serving(tmp_path_factory.mktemp("server")) as found:
        yield found
