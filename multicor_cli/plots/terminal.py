"""Lines drawn with letters, for `--plot term`: needs no library and looks the same in every terminal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from multicor_cli.post.energy import EnergyTable
from multicor_cli.post.profile import ProfileTable
from multicor_cli.post.theta_eta import ThetaTable
from multicor_cli.state.model import Floats

WIDTH, HEIGHT = 72, 20
"""Columns and rows of the area of a chart."""

_VISIBLE = 0.02  # lines that stay below this part of the largest one are left out of charts of many lines
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


def profile_text(table: ProfileTable) -> str:
    """A profile: the field across, the height upwards."""
    names = (f"{table.field.label} [{table.units[1]}]", f"height y [{table.units[0]}]")
    return draw_text([TextLine("", table.value, table.y)], *names)


def theta_text(table: ThetaTable) -> str:
    """Mean θ of the bins against η."""
    return draw_text([TextLine("", table.center, table.mean)], "eta [1]", "theta [1]")


def energy_text(table: EnergyTable) -> str:
    """The energy books over time, mechanical ones and those of heat in one chart."""
    lines = [TextLine(f"{entry.label} [J]", table.time, table.books[entry.name]) for entry in table.entries]
    largest = max((float(np.abs(line.y).max()) for line in lines), default=0.0)
    return draw_text([line for line in lines if np.abs(line.y).max() > _VISIBLE * largest], "time [s]", "energy [J]")


def draw_text(lines: Sequence[TextLine], x_label: str, y_label: str) -> str:
    """A chart as lines of text; the first line that passes a place is the one that is seen there.

    Args:
        lines: Up to 16 lines; more are left out.
        x_label: Quantity and unit across.
        y_label: Quantity and unit upwards.
    """
    known = [_known(line) for line in lines[: len(_MARKS)]]
    points = np.concatenate([np.column_stack([line.x, line.y]) for line in known]) if known else np.zeros((0, 2))
    if not points.size:
        return f"{y_label}: nothing to draw"
    low, high = points.min(axis=0), points.max(axis=0)
    same = low == high
    low, high = np.where(same, low - 0.5 * (np.abs(low) + same), low), np.where(same, high + 0.5 * (np.abs(high) + same), high)
    area = np.full((HEIGHT, WIDTH), " ")
    for number in reversed(range(len(known))):
        column, row = _cells(known[number], low, high)
        area[row, column] = _MARKS[number] if len(known) > 1 else "*"
    chart = _frame(area, low, high, x_label, y_label)
    return "\n".join([*chart, *(f"  {_MARKS[k]}  {line.label}" for k, line in enumerate(known) if len(known) > 1)])


def _known(line: TextLine) -> TextLine:
    kept = np.isfinite(line.x) & np.isfinite(line.y)
    return TextLine(line.label, np.asarray(line.x, np.float64)[kept], np.asarray(line.y, np.float64)[kept])


def _cells(line: TextLine, low: Floats, high: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Columns and rows that a line passes, row 0 at the top."""
    part = (np.column_stack([line.x, line.y]) - low) / (high - low)
    if len(part) > 1:  # so many points between that no cell is missed
        between = np.linspace(0.0, 1.0, 2 * (WIDTH + HEIGHT))[:, np.newaxis, np.newaxis]
        part = (part[:-1] + between * np.diff(part, axis=0)).reshape(-1, 2)
    column, row = np.rint(part * [WIDTH - 1, HEIGHT - 1]).astype(np.int64).T
    return column, HEIGHT - 1 - row


def _frame(area: NDArray[np.str_], low: Floats, high: Floats, x_label: str, y_label: str) -> list[str]:
    """The area with numbers at the ends of its axes."""
    ends = [f"{high[1]:.4g}", f"{low[1]:.4g}"]
    margin = max(map(len, ends))
    names = {0: ends[0], HEIGHT - 1: ends[1]}
    rows = [f"{names.get(k, ''):>{margin}} |{''.join(row).rstrip()}" for k, row in enumerate(area)]
    left, right = f"{low[0]:.4g}", f"{high[0]:.4g}"
    across = f"{left}{x_label:^{WIDTH - len(left) - len(right)}}{right}"
    return [f"{'':{margin}}  {y_label}", *rows, f"{'':{margin}} +{'-' * WIDTH}", f"{'':{margin}}  {across}"]
