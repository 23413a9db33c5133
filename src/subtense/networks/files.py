"""The networks that come with this installation; a build puts them and their licence into the folder `files`."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from ..errors import MissingExtraError
from .network import Network

FOLDER = Path(__file__).parent / "files"
HOW_TO_HAVE = (
    "it is not in this installation (made with SUBTENSE_WITHOUT_NETWORKS=1, or from sources without it); install subtense again, "
    "with npm in reach and without that variable"
)


def model_file(name: str) -> Path:
    """Where a packaged file lies.

    Args:
        name: of the file, as "face_landmark.tflite".

    Raises:
        MissingExtraError: the installation was made without networks.
    """
    path = FOLDER / name
    if not path.is_file():
        raise MissingExtraError(f"the network {name}", "networks", HOW_TO_HAVE)
    return path


@cache
def packaged(name: str) -> Network:
    """A packaged network, read once.

    Raises:
        MissingExtraError: the installation was made without networks, or without what runs them.
    """
    return Network(model_file(name))
