"""The figures: temperatures in time, differences against Bi, and a map of the temperature inside
the discs.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from arrangement import ROWS, WATCHED, Floats, find_contacts, place_rows, start_values, to_celsius
from constriction import effective_share
from disc_mesh import MeshChoice
from finite_elements import Disc, couple, march
from numpy.typing import NDArray
from report import Results
from study import Comparison, disc_of, lumped_lattice, solve_lattice

from multicor_cli.plots.style import COLORS, COLUMN, house_style, save_figure

_CURVE_BIOTS = (0.1, 1.0)
_MAP_BIOT, _MAP_TIME = 1.0, 1.0
_MAP_STEPS = 100


def draw_all(results: Results, folder: Path) -> list[Path]:
    """Write all figures as PNG into a folder, which is made if it is missing; returns their paths.

    Raises:
        PlotError: If matplotlib is not installed.
        OSError: If a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    with house_style():
        from matplotlib.figure import Figure

        biots = (results.case.biot, *_CURVE_BIOTS)
        figure = Figure(figsize=(2.0 * COLUMN, 0.8 * COLUMN), layout="constrained")
        for biot, axes in zip(biots, figure.subplots(1, len(biots), sharey=True), strict=True):
            _draw_curves(axes, biot, is_first=biot == biots[0])
        written.append(_save(figure, folder / "temperatures.png"))
        figure = Figure(figsize=(COLUMN, 0.9 * COLUMN), layout="constrained")
        _draw_differences(figure.subplots(), results.sweep)
        written.append(_save(figure, folder / "differences.png"))
        figure = Figure(figsize=(COLUMN, 0.85 * COLUMN), layout="constrained")
        _draw_map(figure, figure.subplots())
        written.append(_save(figure, folder / "map.png"))
    return written


def _save(figure: Any, path: Path) -> Path:
    save_figure(figure, path)
    return path


def _draw_curves(axes: Any, biot: float, *, is_first: bool) -> None:
    history = solve_lattice(biot)
    times = history.times
    share = effective_share(biot, MeshChoice().half_width)
    lumped, effective = lumped_lattice(times), lumped_lattice(share * times)
    for grain, color in zip(WATCHED, COLORS, strict=False):
        label = f"grain {grain + 1}"
        axes.plot(times, to_celsius(history.mean[:, grain]), color=color, label=label)
        axes.plot(times, to_celsius(lumped[:, grain]), "--", color=color, linewidth=0.8)
        axes.plot(times, to_celsius(effective[:, grain]), ":", color="black", linewidth=0.9)
    axes.set_xlim(0.0, 5.0)
    axes.set_xlabel("time $t\\,H/C$ [–]")
    axes.set_title(f"Bi = {biot:.3g}", fontsize=8)
    if is_first:
        axes.plot([], [], "-", color="gray", label="finite elements")
        axes.plot([], [], "--", color="gray", linewidth=0.8, label="one temperature, $H$")
        axes.plot(
            [], [], ":", color="black", linewidth=0.9, label="one temperature, $H_\\mathrm{eff}$"
        )
        axes.set_ylabel("temperature [°C]")
        axes.legend(loc="upper right", fontsize=6)


def _draw_differences(axes: Any, sweep: list[Comparison]) -> None:
    biot = [row.biot for row in sweep]
    for (name, label), color, marker in zip(
        {
            "interface": "same $H$",
            "effective": "$H_\\mathrm{eff}$: own resistances of contacts",
            "network": "own and mutual resistances",
            "deviation": "rms unevenness inside grain 1",
        }.items(),
        COLORS,
        "osd^",
        strict=False,
    ):
        axes.loglog(
            biot,
            [100.0 * getattr(row, name) for row in sweep],
            marker + "-",
            color=color,
            label=label,
        )
    axes.axhline(1.0, color="gray", linewidth=0.6, linestyle=":")
    axes.set_xlabel("$\\mathrm{Bi} = H/(\\lambda h)$ [–]")
    axes.set_ylabel("largest difference [% of 80 K]")
    axes.set_ylim(1e-3, 3e2)
    axes.legend(loc="upper left", fontsize=6)


def _draw_map(figure: Any, axes: Any) -> None:
    """Temperatures inside the discs at one time, each disc with its own triangles."""
    disc, centers = disc_of(MeshChoice()), place_rows()
    fields = to_celsius(_fields_at(_MAP_TIME)).reshape(len(centers), disc.size)
    low, high = fields.min(), fields.max()
    for center, field in zip(centers, fields, strict=True):
        x, y = disc.nodes + center[:, None]
        shading = axes.tripcolor(
            x,
            y,
            _halved_triangles(disc),
            field,
            shading="gouraud",
            cmap="inferno",
            vmin=low,
            vmax=high,
            rasterized=True,
        )
        axes.add_patch(_circle(center))
    for grain in WATCHED:
        label = {"boxstyle": "circle,pad=0.2", "facecolor": "white", "edgecolor": "none"}
        axes.annotate(
            str(grain + 1), centers[grain], ha="center", va="center", fontsize=6, bbox=label
        )
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_title(f"Bi = {_MAP_BIOT:g}, $t\\,H/C$ = {_MAP_TIME:g}", fontsize=8)
    figure.colorbar(shading, ax=axes, label="temperature [°C]", shrink=0.8)


def _halved_triangles(disc: Disc) -> NDArray[np.int64]:
    """Triangles between the corners and the midpoints of edges of the quadratic elements, shape
    ``(4·elements, 3)``.
    """
    a, b, c, ab, bc, ac = disc.basis.element_dofs
    parts = [(a, ab, ac), (ab, b, bc), (ac, bc, c), (ab, bc, ac)]
    return np.concatenate([np.stack(part, axis=1) for part in parts])


def _circle(center: Floats) -> Any:
    from matplotlib.patches import Circle

    return Circle((center[0], center[1]), 1.0, fill=False, edgecolor="gray", linewidth=0.4)


def _fields_at(time: float) -> Floats:
    """θ of all discs at s = ``time`` and Bi = 1, shape ``(14·n,)``."""
    disc = disc_of(MeshChoice())
    mass, conduction = couple(disc, find_contacts(place_rows()), sum(ROWS), _MAP_BIOT)
    start = np.repeat(start_values(sum(ROWS)), disc.size)
    *_, last = march(mass, conduction, start, np.pi / _MAP_BIOT, [(time / _MAP_STEPS, _MAP_STEPS)])
    return last
