"""One look for all figures, on paper and in the terminal; and which figure a table has."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model.model import Floats
from multicor_cli.optional import library
from multicor_cli.post.grain_map import GrainScene
from multicor_cli.post.table import Table
from multicor_cli.store.atomic import commit_result, make_directory
from multicor_cli.text import unit_sign

# ---- A journal column wide, vector-friendly, readable in print and for color-blind eyes

COLUMN = 3.35
"""Width of a journal column [inch]."""

PAGE = 7.0
"""Width of a page of two columns [inch]."""

TITLE = 0.3
"""Room above the axes for the time and frame of a picture [inch]."""

COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
"""Line colors that color-blind readers can tell apart (Okabe and Ito)."""

HOLLOW: Any = {"markeredgewidth": 0.7, "markerfacecolor": "white", "linestyle": "none"}
"""Marker of a value whose error is not known."""

SUFFIXES = (".png", ".svg", ".pdf")
"""Formats of figures."""

_COMPONENTS = re.compile(r" [xyrt]{2}$")

_TICKS: Any = {"direction": "in", "minor.visible": True, "labelsize": 7.0}
_TICKS |= {"major.width": 0.6, "minor.width": 0.4}
_RC: Any = {
    "font.size": 8.0,
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "mathtext.fontset": "dejavusans",
    "axes.linewidth": 0.6,
    "axes.labelsize": 8.0,
    "axes.unicode_minus": True,
    "axes.formatter.useoffset": False,
    **{f"{axis}tick.{name}": value for axis in "xy" for name, value in _TICKS.items()},
    "xtick.top": True,
    "ytick.right": True,
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
    """As ``velocity $v_x$ [m/s]``; components, as in ``stress xy``, are left to the symbol."""
    return f"{without_components(label)} ${symbol}$ [{unit_sign(unit)}]"


def without_components(label: str) -> str:
    """``contact stress`` of ``contact stress xy``."""
    return _COMPONENTS.sub("", label)


def draw_with_errors(
    axes: Any,
    values: Floats,
    at: Floats,
    error: Floats,
    marker: str,
    *,
    names: tuple[str, str, str] = ("", "", ""),
    is_upright: bool = True,
    is_alone: bool = True,
    **style: Any,
) -> None:
    """Draw means over the height, or from left to right, shaded as far as their standard errors.

    The shade is a band, or a box about each value if some errors are not known: a band would fall
    into islands. Markers of those are hollow, and all of a series of which no error is known beside
    others, where it is not ``is_alone``. ``names`` are what the legend calls means, errors and
    means without error; empty: nothing.
    """
    mean, shaded, unknown = (name or None for name in names)
    color, known = style["color"], np.isfinite(error)
    x, y = (values, at) if is_upright else (at, values)
    shade: dict[str, Any] = {"color": color, "alpha": 0.25, "linewidth": 0.0}
    shade["label"] = shaded if known.any() else None
    if known.all() and known.size > 1:
        fill = axes.fill_betweenx if is_upright else axes.fill_between
        fill(at, values - error, values + error, **shade)
    else:
        ends = np.concatenate([at[:1], 0.5 * (at[1:] + at[:-1]), at[-1:]])
        ends[[0, -1]] = 2.0 * at[[0, -1]] - ends[[1, -2]] if at.size > 1 else (0.0, 2.0 * at[0])
        box = ends[:-1][known], 2.0 * error[known], np.diff(ends)[known], (values - error)[known]
        (axes.barh if is_upright else axes.bar)(*box, align="edge", **shade)
        axes.use_sticky_edges = False  # boxes have room around them as bands do
    axes.plot(x, y, marker + "-", label=mean, **{"markeredgewidth": 0.0, **style})
    if not known.all() and (known.any() or not is_alone):
        axes.plot(x[~known], y[~known], marker, label=unknown, **{**style, **HOLLOW})


def name_frame(axes: Any, time: float, frame: int | None) -> None:
    """Say above the axes when it was [s], and in which frame if that is known."""
    number = "" if frame is None else f", frame {frame}"
    axes.set_title(f"$t$ = {time:.6g} s{number}", loc="left", fontsize=8.0, pad=4.0)


def legend_above(panel: Any, columns: int, *handles: Any, **more: Any) -> None:
    """A legend over the right end of a panel, where no line runs."""
    place: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0)}
    panel.legend(*handles, ncols=columns, borderaxespad=0.1, columnspacing=1.0, **place, **more)


def use_powers(axes: Any, axis: str = "y") -> None:
    """Let labels of ticks below 10⁻³ or above 10⁴ share a power of ten."""
    axes.ticklabel_format(axis=axis, scilimits=(-3, 4), useMathText=True)


def color_map(name: str) -> str:
    """The name that matplotlib has for the colors of a quantity."""
    return "RdBu_r" if name == "balance" else name  # the nearest to what the page calls balance


def beyond(values: Floats, low: float, high: float) -> str:
    """Which ends of a color bar stand for more than their value."""
    is_below, is_above = bool(values.min() < low), bool(values.max() > high)
    if is_below and is_above:
        return "both"
    return "min" if is_below else "max" if is_above else "neither"


_FEW_DECADES = 110.0
"""Ends of a logarithmic axis over each other up to which there is room for labels at 1, 2, 5 …"""


_FEW_TIMES = 5.0
"""The same up to which labels stand at even distances."""


class PlotError(Exception):
    """A figure cannot be made: one message for the user."""

    exit_code = 5


@contextmanager
def house_style() -> Iterator[None]:
    """Apply the style to figures made inside; raises `MissingLibrary` without matplotlib."""
    with library("matplotlib").rc_context(_RC):
        yield


def show_decades(axis: Any, values: Floats) -> None:
    """Let a logarithmic axis span whole decades around positive values, labeled at decades only."""
    axis.set_minor_formatter("")
    if values.size:
        low, high = np.floor(np.log10(values.min())), np.floor(np.log10(values.max())) + 1.0
        axis.axes.set(**{f"{axis.axis_name}lim": (10.0**low, 10.0**high)})


def label_sparsely(axis: Any) -> None:
    """Label a logarithmic axis by plain numbers: at 1, 2, 5 … over a decade or two, else at decades
    only, so that none lies over the next.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator

    low, high = getattr(axis.axes, f"get_{axis.axis_name}lim")()
    axis.set_minor_formatter("")
    if high <= _FEW_DECADES * low:
        is_narrow = high <= _FEW_TIMES * low  # in which 1, 2, 5 … may be one, or none
        axis.set_major_locator(MaxNLocator(4) if is_narrow else LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def explain_errors(axes: Any, errors: Iterable[Floats]) -> None:
    """Let the legend say what shades and hollow markers are, as far as there are any."""
    known = np.concatenate([np.isfinite(error) for error in errors])
    if known.any():
        axes.fill_between([], [], color="0.3", alpha=0.2, linewidth=0.0, label="± standard error")
    if known.any() and not known.all():
        axes.plot([], [], "o", color="0.3", label="error not known", **HOLLOW)


def check_suffix(path: Path) -> None:
    """Refuse a file name whose ending is not one of `SUFFIXES`; raises `PlotError`."""
    if path.suffix.lower() not in SUFFIXES:
        raise PlotError(f"{path}: the name of a figure ends in {', '.join(SUFFIXES)}")


@contextmanager
def figure_file(path: Path, width: float, height: float) -> Iterator[Any]:
    """A figure, sizes in inch, in the house style, written if the context is left without an error.

    Raises as `house_style` and `save_figure` do.
    """
    check_suffix(path)
    with house_style():
        from matplotlib.figure import Figure

        figure = Figure(figsize=(width, height), layout="constrained")
        yield figure
        # Once more than when saving: panels that change their size may have longer labels of ticks
        layout: Any = figure.get_layout_engine()
        layout.execute(figure)
        save_figure(figure, path)


def save_figure(figure: Any, path: Path) -> None:
    """Write a figure and its directory, whole or not at all; the same data give the same bytes.

    Raises `PlotError` if the name has no known ending, `StorageError` if it cannot be written.
    """
    check_suffix(path)
    ending = path.suffix.lower()
    undated = {".png": {"Software": None}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    drawn = io.BytesIO()
    figure.savefig(drawn, format=ending.removeprefix("."), metadata=undated[ending])
    make_directory(path.parent)
    commit_result(path, "figure", drawn.getvalue())


# ---- Temperatures that differ by millikelvins: axes count from a round temperature

_NARROW = 3e-4
"""Range over the largest value below which numbers need so many digits that nobody reads them."""

_ROUNDING = 1e-12
"""The same range where the numbers are one, but for rounding."""

_LITTLE = 0.1
"""Part of the range by which the round temperature may lie above the lowest."""

_COARSEST = 2
"""Least number of decimals of the round temperature: 0 °C is 273.15 K."""


def rise_reference(unit: str, low: float, high: float) -> float | None:
    """The round temperature from which an axis from ``low`` to ``high`` should count, or None.

    Only kelvin have an arbitrary zero. It lies just below ``low``, or a little above: of grains
    that started at 298.15 K one may have cooled by a millionth.
    """
    width = high - low
    if unit != "K" or not _ROUNDING * abs(high) < width < _NARROW * abs(high):
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


def count_small_rises(axis: Any, label: str, symbol: str, unit: str, values: Floats) -> bool:
    """Let an axis of temperatures that hardly differ count from a round one; whether it does."""
    known = values[np.isfinite(values)]
    reference = rise_reference(unit, float(known.min()), float(known.max())) if known.size else None
    if reference is not None:
        axis.set_major_formatter(rise_formatter(reference))
        axis.set_label_text(rise_label(label, symbol, reference))
    return reference is not None


def rise_formatter(reference: float) -> Any:
    """Formatter of matplotlib: temperatures [K] as millikelvin above ``reference`` [K]."""
    from matplotlib.ticker import FuncFormatter

    return FuncFormatter(
        lambda value, _position: f"{round(1e3 * (value - reference), 6) + 0.0:g}".replace("-", "−")
    )


# ---- Grains in a terminal: what matplotlib draws, as cells of two colors or as letters

_DPI = 72.0  # a pixel is a point: lines are at least a pixel wide
_RAMP = " .:-=+*#%@"  # from white to black


@dataclass(frozen=True)
class Terminal:
    """Letters in a line, lines, and the color system as rich names it, None without colors."""

    columns: int = 80
    rows: int = 40
    colors: str | None = None


def draw_picture(scene: GrainScene, draw: Callable[[Any], Any], terminal: Terminal) -> str:
    """A scene as lines of text that fit into a terminal; a letter is two pixels high and one wide.

    Raises `MissingLibrary` without matplotlib.
    """
    across, upwards = (scene.box[1] - scene.box[0]).tolist()
    most = min(terminal.columns, 2.0 * terminal.rows * across / upwards)
    width, lines = max(int(most), 4), max(round(0.5 * most * upwards / across), 2)
    pixels = _render(draw, width, 2 * lines)
    if terminal.colors is not None:
        return _in_colors(pixels, terminal.colors)
    light = pixels.reshape(lines, 2, -1, 3).mean(axis=(1, 3)) / 255.0
    rank = np.rint((1.0 - light) * (len(_RAMP) - 1)).astype(int)
    return "\n".join("".join(_RAMP[k] for k in row).rstrip() for row in rank)


def _render(draw: Callable[[Any], Any], width: int, height: int) -> NDArray[np.uint8]:
    """What ``draw`` draws as pixels, shape ``(height, width, 3)``."""
    with house_style():
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI)
        canvas: Any = FigureCanvasAgg(figure)
        axes: Any = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        draw(axes)
        axes.set_axis_off()
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[:, :, :3]


def _in_colors(pixels: NDArray[np.uint8], colors: str) -> str:
    """Half blocks: the upper pixel is the color of the letter, the lower one of its background."""
    from rich.color import Color
    from rich.console import Console
    from rich.segment import Segment, Segments
    from rich.style import Style

    lines: list[Segment] = []
    for upper, lower in zip(pixels[::2].tolist(), pixels[1::2].tolist(), strict=True):
        cells = zip(upper, lower, strict=True)
        styles = (Style(color=Color.from_rgb(*a), bgcolor=Color.from_rgb(*b)) for a, b in cells)
        lines += [Segment("▀", style) for style in styles]
        lines.append(Segment.line())
    text = io.StringIO()
    console: Any = Console  # its types know color systems only as literals
    console(file=text, force_terminal=True, color_system=colors, width=pixels.shape[1] + 1).print(
        Segments(lines), end=""
    )
    return text.getvalue().rstrip("\n")


# ---- Charts drawn with letters: they need no library and look the same everywhere

WIDTH, HEIGHT = 72, 20
"""Columns and rows of the area of a chart."""

_MARKS = "abcdefghijklmnop"


class TextLine(NamedTuple):
    """A line of a chart; points with nan are left out. An only line has an empty label."""

    label: str
    x: Floats
    y: Floats


def draw_text(
    lines: Sequence[TextLine],
    x_label: str,
    y_label: str,
    *,
    rows: int = HEIGHT,
    is_logarithmic: bool = False,
) -> str:
    """A chart as lines of text; the first line that passes a place is the one that is seen there.

    Lines beyond 16 are left out, and on logarithmic axes points that are not positive.
    """
    known = [_known(line, is_logarithmic=is_logarithmic) for line in lines[: len(_MARKS)]]
    points = np.concatenate([np.zeros((0, 2)), *known])
    if not points.size:
        return f"{y_label}: nothing to draw"
    low, high = points.min(axis=0), points.max(axis=0)
    same = low == high
    room = np.where(same, 0.5 * (np.abs(low) + same), 0.0)
    low, high = low - room, high + room
    area = np.full((rows, WIDTH), " ")
    for number in reversed(range(len(known))):
        column, row = _cells(known[number], low, high, rows)
        area[row, column] = _MARKS[number] if len(known) > 1 else "*"
    if is_logarithmic:
        low, high = 10.0**low, 10.0**high
    names = [f"  {mark}  {line.label}" for mark, line in zip(_MARKS, lines, strict=False)]
    chart = _frame(area, low, high, x_label, y_label)
    return "\n".join([*chart, *(names if len(known) > 1 else ())])


def _known(line: TextLine, *, is_logarithmic: bool) -> Floats:
    """The points that can be drawn, ``(n, 2)``, as their logarithms if asked."""
    points = np.column_stack([line.x, line.y]).astype(np.float64)
    if is_logarithmic:
        points = np.log10(points, where=points > 0.0, out=np.full_like(points, np.nan))
    return np.asarray(points[np.isfinite(points).all(axis=1)])


def _cells(
    points: Floats, low: Floats, high: Floats, rows: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Columns and rows that the line through points passes, row 0 at the top."""
    part = (points - low) / (high - low)
    if len(part) > 1:  # so many points between that no cell is missed
        between = np.linspace(0.0, 1.0, 2 * (WIDTH + rows))[:, np.newaxis, np.newaxis]
        part = (part[:-1] + between * np.diff(part, axis=0)).reshape(-1, 2)
    column, row = np.rint(part * [WIDTH - 1, rows - 1]).astype(np.int64).T
    return column, rows - 1 - row


def _frame(
    area: NDArray[np.str_], low: Floats, high: Floats, x_label: str, y_label: str
) -> list[str]:
    """The area with numbers at the ends of its axes."""
    ends = [f"{high[1]:.4g}", f"{low[1]:.4g}"]
    margin = max(map(len, ends))
    names = {0: ends[0], len(area) - 1: ends[1]}
    rows = [f"{names.get(k, ''):>{margin}} |{''.join(row).rstrip()}" for k, row in enumerate(area)]
    left, right = f"{low[0]:.4g}", f"{high[0]:.4g}"
    across = f"{left}{x_label:^{WIDTH - len(left) - len(right)}}{right}"
    space = " " * margin
    return [f"{space}  {y_label}", *rows, f"{space} +{'-' * WIDTH}", f"{space}  {across}"]


# ---- The figure of a table: `FIGURES` of `plots/NAME.py` draw tables of `post/NAME.py`

_OVER_TIME = (
    "conductivity", "energy", "fabric", "layer_conductivity", "region", "rheology", "wall_heat",
)  # fmt: skip
_DRAWN_IN = {
    **dict.fromkeys(_OVER_TIME, "over_time"),
    **dict.fromkeys(("compare", "diffusion", "theta_eta"), "profile"),
    **dict.fromkeys(("avalanches", "crossings", "mixing"), "events"),
    **dict.fromkeys(("chains", "lifetimes"), "texture"),
    **dict.fromkeys(("correlation", "voronoi"), "structure"),
    "mobilization": "forces",
}
"""Modules that draw tables of several others."""


class Renderer(NamedTuple):
    """How a table is drawn: size [inch], or what tells it of the table; into a figure of
    matplotlib; as text for a terminal.
    """

    size: tuple[float, float] | Callable[[Any], tuple[float, float]]
    draw: Callable[..., None]
    text: Callable[..., str]


def in_axes(draw: Callable[[Any, Any], None]) -> Callable[[Any, Any], None]:
    """What draws a table into axes, for the only ones of a figure."""
    return lambda figure, table: draw(figure.add_subplot(), table)


def plot(table: Any, path: str | Path, **options: Any) -> None:
    """Draw the figure of a table that `post` made.

    Args:
        table: The table.
        path: File to write, in place of one that is there; its ending (.png, .svg, .pdf) chooses
            the format.
        options: Further options of the figure of this kind of table.

    Raises:
        MissingLibrary: If matplotlib is not installed.
        PlotError: If the ending is not known.
        StorageError: If the file cannot be written.
        TypeError: If it is no table of `multicor_cli.post`.
    """
    renderer = _renderer(table)
    size = renderer.size(table) if callable(renderer.size) else renderer.size
    with figure_file(Path(path), *size) as figure:
        renderer.draw(figure, table, **options)


def show(table: Any, terminal: Terminal, **options: Any) -> str:
    """The figure of a table as text; raises `PlotError` if it needs matplotlib and has none."""
    return _renderer(table).text(table, terminal, **options)


def _renderer(table: Any) -> Renderer:
    if not isinstance(table, Table):
        raise TypeError(f"figures are drawn of tables of multicor_cli.post, not of {table!r}")
    name = type(table).__module__.rpartition(".")[2]
    module: Any = import_module(f"multicor_cli.plots.{_DRAWN_IN.get(name, name)}")
    found: Renderer = module.FIGURES[type(table)]
    return found
