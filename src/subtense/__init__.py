"""Distances from images, each with the uncertainty it deserves."""

__version__ = "0.1.0"
