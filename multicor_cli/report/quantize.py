"""Floating-point numbers as small integers whose resolution is known, and as few bytes as deflate can make of them."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats

Spacing = Literal["even", "square", "signed"]
"""``even``: all steps are equal. ``square``: steps grow from the low end on, ``signed``: from the middle on, to both sides, for
quantities of which most values are small."""

_LEVEL = 6  # of deflate: 9 takes three times as long for 1 % less


@dataclass(frozen=True)
class Code:
    """How numbers of one quantity become integers; the largest integer of the type stands for "not known".

    Attributes:
        low: Number that becomes 0.
        high: Number that becomes the largest code in use.
        width: Bytes of a code: 1, 2 or 4.
        spacing: How the numbers between are spaced.
    """

    low: float
    high: float
    width: int
    spacing: Spacing = "even"

    @property
    def largest(self) -> int:
        """The largest code in use."""
        return int(256**self.width - 2)

    @property
    def resolution(self) -> float:
        """Largest distance of neighboring numbers, over their range."""
        return (1.0 if self.spacing == "even" else 2.0) / self.largest

    def encode(self, values: NDArray[Any]) -> NDArray[Any]:
        """Codes of numbers; those outside of the range get the code of its end, nan the one for "not known"."""
        values = np.asarray(values, np.float64)
        width = self.high - self.low
        share = np.clip((values - self.low) / width, 0.0, 1.0) if width > 0.0 else np.where(np.isnan(values), np.nan, 0.0)
        if self.spacing == "square":
            share = np.sqrt(share)
        elif self.spacing == "signed":
            share = 0.5 + 0.5 * np.sign(share - 0.5) * np.sqrt(np.abs(2.0 * share - 1.0))
        unknown = np.isnan(share)
        codes = np.rint(np.where(unknown, 0.0, share) * self.largest).astype(f"<u{self.width}")
        codes[unknown] = self.largest + 1
        return np.asarray(codes)

    def decode(self, codes: NDArray[Any]) -> Floats:
        """Numbers of codes, as the page computes them."""
        share = codes.astype(np.float64) / self.largest
        if self.spacing == "square":
            share *= share
        elif self.spacing == "signed":
            share = 0.5 + 0.5 * (2.0 * share - 1.0) * np.abs(2.0 * share - 1.0)
        return np.where(codes > self.largest, np.nan, self.low + (self.high - self.low) * share)


def compress(arrays: list[NDArray[Any]]) -> bytes:
    """Arrays of unsigned integers one after the other, each as its lowest bytes, then the next ones …; deflated (zlib format)."""
    planes = [np.ascontiguousarray(array.view(np.uint8).reshape(array.size, -1).T).tobytes() for array in arrays if array.size]
    return zlib.compress(b"".join(planes), _LEVEL)
