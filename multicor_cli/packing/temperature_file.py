"""Initial temperatures from a text file: one number per line.

The file comes from elsewhere and is not trusted: its size is checked before memory is taken, and what is wrong is named with its
line. Empty lines and what follows a ``#`` are left out.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.packing.errors import LINE_LIMIT, NAMED, PackingError, reading_input, text_lines
from multicor_cli.packing.values import find_fault
from multicor_cli.scenario.checks.grains import MAX_GRAINS

MAX_BYTES = 2**31
"""Largest file: more than 40 characters for each of the most grains there can be."""

_KEY = ("temperature", "file")


def read_temperatures(path: Path) -> Floats:
    """The temperatures in a file [K], in the order of its lines.

    Args:
        path: The file, text in UTF-8.

    Raises:
        PackingError: The file is missing, unreadable, too large, or holds something else; lines are named.
    """
    values: list[float] = []
    faults: list[str] = []
    with reading_input(path, "text in UTF-8, one temperature per line", _KEY):
        for number, text in _lines(path):
            value, fault = _parse(text)
            if fault:
                faults.append(f"line {number}: {fault}")
            values.append(value)
            if len(faults) > NAMED or len(values) > MAX_GRAINS:
                break
    if faults:
        more = "; and more" if len(faults) > NAMED else ""
        raise PackingError(f"'{path}': {'; '.join(faults[:NAMED])}{more}", "give one temperature in kelvin per line", _KEY)
    if len(values) > MAX_GRAINS:
        raise PackingError(f"'{path}' holds more than {MAX_GRAINS} temperatures", "give one per grain", _KEY)
    return np.array(values, float)


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Number and text of each line that holds something; a line too long for a number is cut and ends with "…"."""
    number, is_rest = 0, False
    for line in text_lines(path, MAX_BYTES):
        is_cut = len(line) == LINE_LIMIT and not line.endswith("\n")
        if not is_rest:
            number += 1
            text = line.split("#", 1)[0].strip()
            if text:
                yield number, f"{text[:40]}…" if is_cut else text
        is_rest = is_cut


def _parse(text: str) -> tuple[float, str]:
    """The temperature [K], and what is wrong with it; empty if nothing is."""
    try:
        value = float(text)
    except ValueError:
        return 0.0, f"{text[:40]!r} is not a number"
    return value, find_fault("temperature", value)
