"""Transfer curves: from light to the encoded values of a picture and back, 0 to 1.

One family from linear (exponent 1) over sRGB (2.2, which is what its straight toe and power of 2.4 come to) and beyond:
light = ((v + a) / (1 + a))^p above v0 and straight below, with p - 1, a and v0 in proportion to exponent - 1.

Source: IEC 61966-2-1 (sRGB).
"""

from __future__ import annotations

import numpy as np

from .arrays import Array

SRGB = 2.2
"""The exponent that stands for sRGB."""
_STEEPEST = 1e-6


def _shape(exponent: float) -> tuple[float, float, float, float]:
    """Power, offset, end of the straight part in encoded values, and light there."""
    share = (exponent - 1.0) / (SRGB - 1.0)
    if share <= 0:
        return exponent, 0.0, 0.0, 0.0
    power, offset, end = 1 + 1.4 * share, 0.055 * share, 0.04045 * share
    return power, offset, end, ((end + offset) / (1 + offset)) ** power


def light_of(encoded: Array, exponent: float) -> Array:
    """Light of encoded values."""
    power, offset, end, light = _shape(exponent)
    v = np.maximum(np.asarray(encoded, float), 0.0)
    curved = ((v + offset) / (1 + offset)) ** power
    return np.asarray(curved if end == 0 else np.where(v > end, curved, v * (light / end)))


def encoded_of(light: Array, exponent: float) -> Array:
    """Encoded values of light."""
    power, offset, end, least = _shape(exponent)
    x = np.maximum(np.asarray(light, float), 0.0)
    curved = (1 + offset) * x ** (1 / power) - offset
    return np.asarray(curved if end == 0 else np.where(x > least, curved, x * (end / least)))


def slope_of(encoded: Array, exponent: float) -> Array:
    """Derivative of light by the encoded value."""
    power, offset, end, light = _shape(exponent)
    v = np.maximum(np.asarray(encoded, float), 0.0)
    curved = power * ((v + offset) / (1 + offset)) ** (power - 1) / (1 + offset)
    return np.maximum(curved if end == 0 else np.where(v > end, curved, light / end), _STEEPEST)
