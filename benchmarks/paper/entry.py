"""What the page holds of each figure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from multicor_cli.plots.style import house_style, save_figure

Draw = Callable[[Path], None]
Rows = list[tuple[str, ...]]

FORMATS = (".png", ".pdf")


@dataclass(frozen=True)
class Panel:
    """A picture.

    Attributes:
        name: Name of its files, without ending.
        caption: What it shows.
        draw: Writes it to a path, whose ending chooses the format.
    """

    name: str
    caption: str
    draw: Draw

    def write(self, folder: Path) -> None:
        """Write all formats into a folder."""
        for suffix in FORMATS:
            self.draw(folder / f"{self.name}{suffix}")


@dataclass(frozen=True)
class Entry:
    """A figure of the paper, with our data.

    Attributes:
        number: Number, or numbers, in the paper.
        title: What it shows.
        states: What the paper states.
        open: What it leaves open; empty if nothing matters here.
        panels: Our pictures.
        head: Head of the table of our numbers.
        rows: Its rows.
        differs: Where we differ and why; empty if nowhere.
    """

    number: str
    title: str
    states: list[str]
    open: list[str]
    panels: list[Panel]
    head: tuple[str, ...]
    rows: Rows
    differs: list[str] = field(default_factory=list)


def on_axes(size: tuple[float, float], draw: Callable[[Any], None]) -> Draw:
    """A picture in the house style with one pair of axes of this size [inch], filled by
    ``draw``.
    """

    def write(path: Path) -> None:
        with house_style():
            from matplotlib.figure import Figure

            figure = Figure(figsize=size, layout="constrained")
            draw(figure.add_subplot())
            save_figure(figure, path)

    return write


def percent(share: float) -> str:
    """A share for people."""
    return f"{100.0 * share:.2g} %"


def versus(first: float, second: float) -> str:
    """How the second value compares with the first, in a word."""
    return "lower" if second < first else "higher" if second > first else "the same"
