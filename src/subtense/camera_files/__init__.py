"""Calibration files of other tools and our own: text to a Camera and back; `formats.FORMATS` lists them."""
