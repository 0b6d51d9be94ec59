"""Temperatures that differ by a few millikelvin: axes show how far they are above a round temperature."""

from __future__ import annotations

import math
from typing import Any

_NARROW = 3e-4
"""Range over the largest value below which numbers on an axis need so many digits that nobody reads them."""

_LITTLE = 0.1
"""Part of the range by which the round temperature may lie above the lowest."""

_COARSEST = 2
"""Least number of decimals of the round temperature: 0 °C is 273.15 K."""


def rise_reference(unit: str, low: float, high: float) -> float | None:
    """The round temperature from which an axis should count [K]; None if it can show temperatures as they are.

    It lies just below ``low``, or a little above: of grains that started at 298.15 K one may have cooled by a millionth.

    Args:
        unit: Unit of the values; only kelvin have an arbitrary zero.
        low: Smallest value on the axis.
        high: Largest value on the axis.
    """
    width = high - low
    if unit != "K" or not 0.0 < width < _NARROW * abs(high):
        return None
    finest = max(_COARSEST, math.ceil(-math.log10(width)))
    for decimals in range(_COARSEST, finest + 1):
        nearest = round(low, decimals)
        if low <= nearest <= low + _LITTLE * width:
            return nearest
        below = math.floor(low * 10.0**decimals + 1e-6) / 10.0**decimals
        if low - below <= width:  # a rounder one farther below would leave the axis empty
            return below
    return below


def rise_label(label: str, symbol: str, reference: float) -> str:
    """Label of an axis that counts from ``reference`` [K]."""
    return f"{label} ${symbol}$ − {reference:.12g} K [mK]"


def rise_formatter(reference: float) -> Any:
    """Formatter of matplotlib that prints temperatures [K] as millikelvin above ``reference`` [K]."""
    from matplotlib.ticker import FuncFormatter

    return FuncFormatter(lambda value, _position: f"{round(1e3 * (value - reference), 6) + 0.0:g}".replace("-", "−"))
