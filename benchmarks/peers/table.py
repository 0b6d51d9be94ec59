"""Tables for people."""

from __future__ import annotations

import math
from collections.abc import Sequence

from measure import Estimate


def draw(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table with aligned columns; the first is flush left."""
    table = [list(headings), *(list(row) for row in rows)]
    widths = [max(len(row[k]) for row in table) for k in range(len(headings))]
    lines = [
        "  ".join(
            c.ljust(w) if k == 0 else c.rjust(w)
            for k, (c, w) in enumerate(zip(row, widths, strict=True))
        )
        for row in table
    ]
    lines.insert(1, "  ".join("-" * w for w in widths))
    return "\n".join(line.rstrip() for line in lines)


def estimate(value: Estimate, digits: int) -> str:
    """A mean and its error; the error is left out where it is not known."""
    if math.isnan(value.mean):
        return ""
    text = f"{value.mean:.{digits}f}"
    return text if math.isnan(value.error) else f"{text} ± {value.error:.{digits}f}"


def spread(values: Sequence[float], form: str = ".3g") -> str:
    """The median, and least and largest in brackets."""
    ordered = sorted(values)
    middle = median(ordered)
    return (
        f"{middle:{form}}"
        if len(ordered) < 2
        else f"{middle:{form}} [{ordered[0]:{form}}, {ordered[-1]:{form}}]"
    )


def median(values: Sequence[float]) -> float:
    """The median; nan of nothing."""
    ordered = sorted(values)
    if not ordered:
        return math.nan
    half = len(ordered) // 2
    return ordered[half] if len(ordered) % 2 else 0.5 * (ordered[half - 1] + ordered[half])
