"""One look for all figures: a journal column wide, vector-friendly, readable in print and for color-blind eyes."""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from multicor_cli.model.model import Floats
from multicor_cli.optional import library
from multicor_cli.store.atomic import commit_result, make_directory
from multicor_cli.text import unit_sign

COLUMN = 3.35
"""Width of a journal column [inch]."""

PAGE = 7.0
"""Width of a page of two columns [inch]."""

COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
"""Line colors that color-blind readers can tell apart (Okabe and Ito)."""

SUFFIXES = (".png", ".svg", ".pdf")
"""Formats of figures."""

_COMPONENTS = re.compile(r" [xyrt]{2}$")

_RC: Any = {
    "font.size": 8.0,
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "mathtext.fontset": "dejavusans",
    "axes.linewidth": 0.6,
    "axes.labelsize": 8.0,
    "axes.unicode_minus": True,
    "axes.formatter.useoffset": False,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "xtick.minor.visible": True,
    "ytick.minor.visible": True,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.minor.width": 0.4,
    "ytick.minor.width": 0.4,
    "legend.fontsize": 7.0,
    "legend.frameon": False,
    "lines.linewidth": 1.2,
    "lines.markersize": 3.0,
    "savefig.dpi": 300,
    "svg.fonttype": "none",  # text stays text
    "pdf.fonttype": 42,
    "svg.hashsalt": "multicor",  # the same data give the same file
}


def axis_label(label: str, symbol: str, unit: str) -> str:
    """Label of an axis: ``velocity $v_x$ [m/s]``; components, as in ``stress xy``, are left to the symbol."""
    return f"{_COMPONENTS.sub('', label)} ${symbol}$ [{unit_sign(unit)}]"


def draw_with_errors(
    axes: Any, values: Floats, y: Floats, error: Floats, marker: str, *, names: tuple[str, str, str], **style: Any
) -> None:
    """Draw means over the height with a band of standard errors; where one is not known the band ends and the marker is hollow.

    Args:
        axes: Matplotlib axes.
        values: Means, shape ``(b,)``.
        y: Heights, shape ``(b,)``.
        error: Standard errors, nan where they are not known, shape ``(b,)``.
        marker: Marker of the means.
        names: What the legend calls means, errors and means without error; empty: nothing.
        style: Color and widths of the line.
    """
    mean, band, unknown = (name or None for name in names)
    known = np.isfinite(error)
    band = band if known.any() else None
    axes.fill_betweenx(y, values - error, values + error, color=style["color"], alpha=0.25, linewidth=0.0, label=band)
    beside = np.concatenate([[False], known, [False]])
    alone = known & ~beside[:-2] & ~beside[2:]  # a band of one point has no area
    if alone.any():
        axes.errorbar(values[alone], y[alone], xerr=error[alone], fmt="none", ecolor=style["color"], elinewidth=0.7, capsize=1.2)
    axes.plot(values, y, marker + "-", label=mean, **{"markeredgewidth": 0.0, **style})
    if known.any() and not known.all():
        open_: Any = {**style, "markeredgewidth": 0.7, "markerfacecolor": "white", "linestyle": "none"}
        axes.plot(values[~known], y[~known], marker, label=unknown, **open_)


_BALANCE = "RdBu_r"  # matplotlib's nearest to what the page calls balance


def color_map(name: str) -> str:
    """The name that matplotlib has for the colors of a quantity."""
    return _BALANCE if name == "balance" else name


class PlotError(Exception):
    """A figure cannot be made: one message for the user."""

    exit_code = 5


@contextmanager
def house_style() -> Iterator[None]:
    """Apply the style to figures made inside the context.

    Raises:
        MissingLibrary: If matplotlib is not installed.
    """
    with library("matplotlib").rc_context(_RC):
        yield


def show_decades(axis: Any, values: Floats) -> None:
    """Let a logarithmic axis of matplotlib span the whole decades around positive values, with labels at the decades only."""
    axis.set_minor_formatter("")
    if values.size:
        low, high = np.floor(np.log10(values.min())), np.floor(np.log10(values.max())) + 1.0
        axis.axes.set(**{f"{axis.axis_name}lim": (10.0**low, 10.0**high)})


def explain_errors(axes: Any, errors: Iterable[Floats]) -> None:
    """Let the legend say what bands and hollow markers are, as far as there are any."""
    known = np.concatenate([np.isfinite(error) for error in errors])
    if known.any():
        axes.fill_between([], [], color="0.3", alpha=0.2, linewidth=0.0, label="± standard error")
    if known.any() and not known.all():
        hollow: Any = {"color": "0.3", "markerfacecolor": "white", "markeredgewidth": 0.7, "linestyle": "none"}
        axes.plot([], [], "o", label="error not known", **hollow)


def check_suffix(path: Path) -> None:
    """Refuse a file name whose ending is not one of `SUFFIXES`; raises `PlotError`."""
    if path.suffix.lower() not in SUFFIXES:
        raise PlotError(f"{path}: the name of a figure ends in {', '.join(SUFFIXES)}")


@contextmanager
def figure_file(path: Path, width: float, height: float) -> Iterator[Any]:
    """Give a figure of matplotlib in the house style to draw into, and write it when the context is left without an error.

    Args:
        path: File to write; its ending (.png, .svg, .pdf) chooses the format.
        width: Width of the figure [inch].
        height: Height of the figure [inch].

    Raises:
        MissingLibrary: If matplotlib is not installed.
        PlotError: If the ending is not known.
        StorageError: If the file cannot be written.
    """
    check_suffix(path)
    with house_style():
        from matplotlib.figure import Figure

        figure = Figure(figsize=(width, height), layout="constrained")
        yield figure
        save_figure(figure, path)


def save_figure(figure: Any, path: Path) -> None:
    """Write a figure in the format of the file name, whole or not at all, and its directory; the same data give the same bytes.

    Raises:
        PlotError: If the name has no known ending.
        StorageError: If the file cannot be written.
    """
    check_suffix(path)
    ending = path.suffix.lower()
    undated = {".png": {"Software": None}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    drawn = io.BytesIO()
    figure.savefig(drawn, format=ending.removeprefix("."), metadata=undated[ending])
    make_directory(path.parent)
    commit_result(path, "figure", drawn.getvalue())
