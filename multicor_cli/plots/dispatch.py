"""The figure of a table: tables of ``post/NAME.py`` are drawn by ``plots/NAME.py``, whose ``FIGURES`` says how."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from multicor_cli.plots.style import figure_file

if TYPE_CHECKING:
    from multicor_cli.plots.text_picture import Terminal


class Ways(NamedTuple):
    """How a table is drawn: how large a figure of it is [inch], into a figure of matplotlib, and as text for a terminal."""

    size: Callable[[Any], tuple[float, float]]
    draw: Callable[..., None]
    text: Callable[..., str]


def plot(table: Any, path: Path, **options: Any) -> None:
    """Draw the figure of a table that `post` made.

    Args:
        table: The table.
        path: File to write; its ending (.png, .svg, .pdf) chooses the format.
        options: Further options of the figure of this kind of table.

    Raises:
        MissingLibrary: If matplotlib is not installed.
        PlotError: If the ending is not known.
        StorageError: If the file cannot be written.
    """
    ways = _ways(table)
    with figure_file(path, *ways.size(table)) as figure:
        ways.draw(figure, table, **options)


def show(table: Any, terminal: Terminal, **options: Any) -> str:
    """The figure of a table as text for a terminal; raises `PlotError` if it needs matplotlib and that is not installed."""
    return _ways(table).text(table, terminal, **options)


def _ways(table: Any) -> Ways:
    name = type(table).__module__.rpartition(".")[2]
    figures: dict[type, Ways] = import_module(f"multicor_cli.plots.{name}").FIGURES
    return figures[type(table)]
