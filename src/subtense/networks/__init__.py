"""Networks: where those of this installation lie, how one is run, and the small calculations around them.

`files` knows the packaged ones, `network` runs any of them, `view` cuts the input out of a picture, `boxes` reads detections.
"""

from __future__ import annotations

from .files import model_file, packaged
from .network import Network, Tensor

__all__ = ["Network", "Tensor", "model_file", "packaged"]
