"""Charts drawn with letters: they need no library and look the same in every terminal, mail and log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats

WIDTH, HEIGHT = 72, 20
"""Columns and rows of the area of a chart."""

_MARKS = "abcdefghijklmnop"


@dataclass(frozen=True)
class TextLine:
    """A line of a chart.

    Attributes:
        label: What it is; empty if it is the only one.
        x: Where its points are, shape ``(k,)``.
        y: Their heights, shape ``(k,)``; points with nan are left out.
    """

    label: str
    x: Floats
    y: Floats


def draw_text(lines: Sequence[TextLine], x_label: str, y_label: str, *, rows: int = HEIGHT, is_logarithmic: bool = False) -> str:
    """A chart as lines of text; the first line that passes a place is the one that is seen there.

    Args:
        lines: Up to 16 lines; more are left out.
        x_label: Quantity and unit across.
        y_label: Quantity and unit upwards.
        rows: Rows of the area of the chart.
        is_logarithmic: Whether both axes are logarithmic; points that are not positive are left out.
    """
    known = [_known(line, is_logarithmic=is_logarithmic) for line in lines[: len(_MARKS)]]
    points = np.concatenate([np.column_stack([line.x, line.y]) for line in known]) if known else np.zeros((0, 2))
    if not points.size:
        return f"{y_label}: nothing to draw"
    low, high = points.min(axis=0), points.max(axis=0)
    same = low == high
    low, high = np.where(same, low - 0.5 * (np.abs(low) + same), low), np.where(same, high + 0.5 * (np.abs(high) + same), high)
    area = np.full((rows, WIDTH), " ")
    for number in reversed(range(len(known))):
        column, row = _cells(known[number], low, high, rows)
        area[row, column] = _MARKS[number] if len(known) > 1 else "*"
    if is_logarithmic:
        low, high = 10.0**low, 10.0**high
    chart = _frame(area, low, high, x_label, y_label)
    return "\n".join([*chart, *(f"  {_MARKS[k]}  {line.label}" for k, line in enumerate(known) if len(known) > 1)])


def _known(line: TextLine, *, is_logarithmic: bool) -> TextLine:
    """The points that can be drawn, as their logarithms if asked."""
    x, y = np.asarray(line.x, np.float64), np.asarray(line.y, np.float64)
    if is_logarithmic:
        x, y = (np.log10(v, where=v > 0.0, out=np.full_like(v, np.nan)) for v in (x, y))
    kept = np.isfinite(x) & np.isfinite(y)
    return TextLine(line.label, x[kept], y[kept])


def _cells(line: TextLine, low: Floats, high: Floats, rows: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Columns and rows that a line passes, row 0 at the top."""
    part = (np.column_stack([line.x, line.y]) - low) / (high - low)
    if len(part) > 1:  # so many points between that no cell is missed
        between = np.linspace(0.0, 1.0, 2 * (WIDTH + rows))[:, np.newaxis, np.newaxis]
        part = (part[:-1] + between * np.diff(part, axis=0)).reshape(-1, 2)
    column, row = np.rint(part * [WIDTH - 1, rows - 1]).astype(np.int64).T
    return column, rows - 1 - row


def _frame(area: NDArray[np.str_], low: Floats, high: Floats, x_label: str, y_label: str) -> list[str]:
    """The area with numbers at the ends of its axes."""
    ends = [f"{high[1]:.4g}", f"{low[1]:.4g}"]
    margin = max(map(len, ends))
    names = {0: ends[0], len(area) - 1: ends[1]}
    rows = [f"{names.get(k, ''):>{margin}} |{''.join(row).rstrip()}" for k, row in enumerate(area)]
    left, right = f"{low[0]:.4g}", f"{high[0]:.4g}"
    across = f"{left}{x_label:^{WIDTH - len(left) - len(right)}}{right}"
    return [f"{'':{margin}}  {y_label}", *rows, f"{'':{margin}} +{'-' * WIDTH}", f"{'':{margin}}  {across}"]
