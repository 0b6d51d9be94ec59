"""Figures of the page, as SVG in its colors: profiles, energies and the solver over time."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multicor_cli.checks.books import CLOSURE_LIMIT
from multicor_cli.model.model import Floats
from multicor_cli.optional import MissingLibrary
from multicor_cli.plots.over_time import LOOKS
from multicor_cli.plots.profile import draw_profile
from multicor_cli.plots.style import COLORS, count_small_rises, house_style, use_powers
from multicor_cli.post import PostError, Selection, profile
from multicor_cli.post.energy import HEAT, MECHANICAL, BookLine, EnergyTable
from multicor_cli.store import Run

_POINTS = 1200  # of a line; longer series are thinned
_PROFILE_FRAMES = 20
_VISIBLE = 2e-3  # of the height of a figure
# Books that close hold rounding errors only if no entry is so much larger than their imbalance
_ROUNDING = 1e3
_ABSURD = 1e100  # larger numbers come from damaged files, and axes cannot show them
_SHORT = 12  # letters of a label of which three fit side by side
_INK = "#012345"  # stands for the color of text of the page
_SIZE = (3.7, 2.6)  # inch


@dataclass(frozen=True)
class Figure:
    """A figure: what it shows, and the picture, with texts and axes in ``currentColor``."""

    title: str
    svg: str


@dataclass(frozen=True)
class Line:
    """A line over time, values ``(rows,)``; without a color it gets the next one."""

    label: str
    value: Floats
    color: str | None = None


def make_figures(run: Run, books: EnergyTable | None) -> list[Figure] | None:
    """All figures that make sense for a run; None if matplotlib is not installed.

    Raises:
        StoreError: If the run cannot be read.
    """
    try:
        return [*_profiles(run), *([] if books is None else _histories(run, books))]
    except MissingLibrary:
        return None


def make_figure(title: str, size: tuple[float, float], fill: Callable[[Any], None]) -> Figure:
    """A figure, sizes in inch, in the page's colors; raises `MissingLibrary` without matplotlib."""
    with house_style():
        import matplotlib as mpl
        from matplotlib.figure import Figure as Canvas

        ink: Any = ("text.color", "axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color")
        mpl.rcParams.update(dict.fromkeys(ink, _INK))
        canvas = Canvas(figsize=size, layout="constrained", facecolor="none")
        fill(canvas)
        for axes in canvas.axes:
            axes.set_facecolor("none")
        buffer = io.StringIO()
        metadata = dict.fromkeys(("Date", "Creator", "Format", "Type"))
        canvas.savefig(buffer, format="svg", metadata=metadata)
        return Figure(title, _inline(buffer.getvalue()))


def _profiles(run: Run) -> list[Figure]:
    """Profiles over the later half of the last stage that vary between walls that shear or heat."""
    chosen = Selection().indices(run.frames)
    frames = Selection(frames=slice(int(chosen[0]), None, -(-chosen.size // _PROFILE_FRAMES)))
    found = []
    for of in ("velocity", "temperature", "solid-fraction"):
        try:
            table = profile(run, of, frames)
        except PostError:
            continue  # a run without heat has no temperatures
        has_shear = np.isfinite(table.shear_rate) and table.shear_rate != 0.0
        has_shape = np.isfinite(table.value).sum() > 2 and np.ptp(_finite(table.value)) > 0.0
        if not any(table.walls) or not has_shape or (of == "velocity" and not has_shear):
            continue
        title = (
            f"{table.field.label.capitalize()} over the height, mean of t = {table.times[0]:.4g} "
            f"to {table.times[1]:.4g} s"
        )
        found.append(_draw(title, partial(draw_profile, table=table)))
    return found


def _finite(values: Floats) -> Floats:
    return values[np.isfinite(values)]


def _histories(run: Run, books: EnergyTable) -> list[Figure]:
    series = run.series
    if series.row_count < 2:
        return []
    pick = _Thinning(np.asarray(series["time"]))
    found: list[Figure] = []

    def add(title: str, label: str, lines: list[Line], time: Floats, **options: bool) -> None:
        draw = partial(_lines, time=time, lines=lines, label=label, **options)
        found.append(_draw(title, draw))

    closures = [("Energy books", "energy", MECHANICAL, books.closure)]
    if books.heat_closure is not None:
        closures += [("Books of heat", "heat", HEAT, books.heat_closure)]
    for title, label, entries, closure in closures:
        lines = _book_lines(books, entries, pick, closure)
        if lines:
            title += " over time (sums since the start)"
            add(title, f"{label} [J]", lines, pick.time)
    if "heat_stored" in series:
        lines = [
            Line(label, pick.last(series[f"temperature_{name}"])) for name, label in _TEMPERATURES
        ]
        add("Temperature over time", "temperature [K]", lines, pick.time, keep=True)
    worked = pick.most(series["window_steps"]) > 0
    if worked.sum() >= 2:
        time = pick.time[worked]
        residuals = [Line(label, pick.most(series[name])[worked]) for name, label in _RESIDUALS]
        title = "Residuals of the solver, largest of each window"
        add(title, "residual [–]", residuals, time, log=True)
        effort = Line("sweeps per step", pick.most(series["sweeps_mean"])[worked])
        title = "Work of the solver, mean of each window"
        add(title, "sweeps per step [–]", [effort], time, keep=True)
        contacts = Line("loaded contacts", pick.last(series["contacts_mean"])[worked])
        add("Contacts that carry a force", "contacts [–]", [contacts], time, keep=True)
    return found


def _book_lines(
    books: EnergyTable, entries: tuple[BookLine, ...], pick: _Thinning, closure: Floats
) -> list[Line]:
    """Lines of the books that differ from zero in a figure; none if all are rounding errors."""
    sizes = {
        entry: _largest(books.books[entry.name]) for entry in entries if entry.name in books.books
    }
    rest = max((size for entry, size in sizes.items() if "imbalance" in entry.name), default=0.0)
    largest = max(sizes.values(), default=0.0)
    if largest <= _ROUNDING * rest and _largest(closure) <= CLOSURE_LIMIT:
        return []
    return [
        Line(entry.label, pick.last(books.books[entry.name]), LOOKS.get(entry.name, ("", "0.5"))[1])
        for entry, size in sizes.items()
        if size > _VISIBLE * largest
    ]


def _largest(values: Floats) -> float:
    return float(np.abs(_finite(values)).max(initial=0.0))


_TEMPERATURES = (("max", "highest"), ("mean", "mean"), ("min", "lowest"))
_RESIDUALS = (("residual_rms", "rms"), ("residual_max", "maximum"), ("residual_energy", "energy"))


class _Thinning:
    """Blocks of rows that a line has one point for, and the times of these [s]."""

    def __init__(self, time: Floats) -> None:
        step = -(-time.size // _POINTS)
        self._starts = np.arange(0, time.size, step)
        self._ends = np.minimum(self._starts + step, time.size) - 1
        self.time = time[self._ends]

    def last(self, values: NDArray[Any]) -> Floats:
        return np.asarray(values[self._ends], np.float64)

    def most(self, values: NDArray[Any]) -> Floats:
        return np.asarray(np.maximum.reduceat(values, self._starts), np.float64)


def _lines(
    axes: Any, *, time: Floats, lines: list[Line], label: str, log: bool = False, keep: bool = False
) -> None:
    """Draw lines; those that are zero throughout are left out unless all are to be kept."""
    shown = [line for line in lines if keep or np.any(line.value)]
    for number, line in enumerate(shown):
        value = np.where(line.value > 0.0, line.value, np.nan) if log else line.value
        value = np.where(np.abs(value) < _ABSURD, value, np.nan)
        style = "-" if number < len(COLORS) else "--"
        color = line.color or COLORS[number % len(COLORS)]
        axes.plot(time, value, style, color=color, linewidth=1.2, label=line.label)
    if log and any(np.any(line.value > 0.0) for line in shown):
        axes.set_yscale("log")
    elif not log:
        use_powers(axes)
    axes.set_ylabel(label)
    values = np.concatenate([np.zeros(0), *(line.value for line in shown)])
    count_small_rises(axes.yaxis, "temperature", "T", label[label.index("[") + 1 : -1], values)
    axes.set_xlabel("time [s]")
    axes.margins(x=0.0)
    if len(shown) > 1:
        axes.figure.legend(
            *axes.get_legend_handles_labels(),
            loc="outside lower center",
            ncols=3 if max(len(line.label) for line in shown) < _SHORT else 2,
        )


def _draw(title: str, draw: Callable[[Any], None]) -> Figure:
    return make_figure(title, _SIZE, lambda canvas: draw(canvas.add_subplot()))


def _inline(svg: str) -> str:
    """An SVG file as part of a page: no addresses of standards, no fixed size, inks of the page."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'\sxmlns(:\w+)?="[^"]*"', "", svg)
    svg = re.sub(r'<svg([^>]*?)\swidth="[^"]*"', r"<svg\1", svg, count=1)
    svg = re.sub(r'<svg([^>]*?)\sheight="[^"]*"', r"<svg\1", svg, count=1)
    svg = re.sub(
        r'\sid="(figure|axes|matplotlib|xtick|ytick|text|line2d|patch|legend|FillBetween)[^"]*"',
        "",
        svg,
    )
    return svg.replace("xlink:href", "href").replace(_INK, "currentColor")
