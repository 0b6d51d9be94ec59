"""Figures over the height: profiles, alone and of two runs, and θ against η; and over lags."""

from __future__ import annotations

from typing import Any

import numpy as np

from multicor_cli.plots.style import (
    COLORS,
    COLUMN,
    PAGE,
    Renderer,
    Terminal,
    TextLine,
    axis_label,
    count_small_rises,
    draw_text,
    draw_with_errors,
    explain_errors,
    in_axes,
    name_frame,
    use_powers,
    without_components,
)
from multicor_cli.post import (
    Comparison,
    Diffusion,
    ProfilePair,
    ProfileSet,
    ProfileTable,
    ThetaTable,
)
from multicor_cli.text import unit_sign

# ---- Profiles: the field across, the height upwards, as one looks at the grains


def _fill(figure: Any, profiles: ProfileSet) -> None:
    """Draw profiles as `draw_profile` does, or those of the components of a field in one panel."""
    if not _are_components(profiles):
        panels = figure.subplots(1, len(profiles.tables), squeeze=False, sharey=True)[0]
        for panel, table in zip(panels, profiles.tables, strict=True):
            draw_profile(panel, table)
            panel.label_outer()
        return
    _draw_profiles(figure.add_subplot(), profiles)
    figure.legend(loc="outside upper center", ncols=4, columnspacing=1.2)


def _are_components(profiles: ProfileSet) -> bool:
    """Whether they are several in the same unit, which have one axis."""
    return len(profiles.tables) > 1 and len({table.units for table in profiles.tables}) == 1


def _draw_profiles(axes: Any, profiles: ProfileSet) -> None:
    for color, marker, table in zip(COLORS, "os^D", profiles.tables, strict=False):
        names = (f"${table.field.symbol}$", "", "")
        style: Any = {"names": names, "color": color, "markersize": 2.5, "linewidth": 0.9}
        draw_with_errors(axes, table.value, table.y, table.error, marker, **style)
    explain_errors(axes, [table.error for table in profiles.tables])
    _, upwards = axis_labels(profiles.first)
    what = without_components(profiles.first.field.label) + profiles.first.about_groups
    axes.set_xlabel(f"{what}, compression positive [{unit_sign(profiles.first.units[1])}]")
    axes.set_ylabel(upwards)
    axes.locator_params(axis="x", nbins=5)
    axes.set_ylim(0.0, profiles.first.height)
    use_powers(axes, "both")


def draw_profile(axes: Any, table: ProfileTable) -> None:
    """Draw a profile into matplotlib axes."""
    mean = "mean" if np.isfinite(table.error).any() else "mean, errors not known"
    names = (mean, "standard error", "mean, error not known")
    draw_with_errors(axes, table.value, table.y, table.error, "o", names=names, color=COLORS[0])
    across, upwards = axis_labels(table)
    axes.locator_params(axis="x", nbins=5)
    use_powers(axes, "both")
    axes.set_xlabel(across)
    label = f"{table.field.label}{table.about_groups}"
    count_small_rises(axes.xaxis, label, table.field.symbol, table.units[1], table.value)
    axes.set_ylabel(upwards)
    axes.set_ylim(0.0, 1.0 if table.is_normalized else table.height)
    # Above the panel, where no line runs.
    axes.legend(
        loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, borderaxespad=0.2, columnspacing=1.0
    )


def axis_labels(table: ProfileTable) -> tuple[str, str]:
    """Labels of the axes: quantity, symbol and unit."""
    field, label = table.field, f"{table.field.label}{table.about_groups}"
    if not table.is_normalized:
        return axis_label(label, field.symbol, field.unit), "height $y$ [m]"
    symbol = field.symbol.split("_")[0]
    if field.scaling == "shear":
        scaled = f"{field.symbol} H/(V_1 - V_0)"
    elif table.wall_values[0]:
        scaled = f"({field.symbol} - {symbol}_0)/({symbol}_1 - {symbol}_0)"
    else:
        scaled = f"{field.symbol}/{symbol}_\\mathrm{{wall}}"
    return f"{label} ${scaled}$ [–]", "height $y/H$ [–]"


def profiles_text(profiles: ProfileSet, terminal: Terminal) -> str:
    """Profiles: the fields across, the height upwards."""
    first, has_many = profiles.first, _are_components(profiles)
    if profiles.tables[1:] and not has_many:
        alone = (ProfileSet(table.field.name, (table,)) for table in profiles.tables)
        return "\n\n".join(profiles_text(each, terminal) for each in alone)
    lines = [TextLine(t.field.name if has_many else "", t.value, t.y) for t in profiles.tables]
    label = without_components(first.field.label) if has_many else first.field.label
    return draw_text(
        lines, f"{label} [{unit_sign(first.units[1])}]", f"height y [{first.units[0]}]"
    )


# ---- The profiles of two runs, and beside each the difference over its standard error


def draw_comparison(figure: Any, comparison: Comparison) -> None:
    """Draw two panels for each profile into a matplotlib figure."""
    grid = figure.subplots(
        len(comparison.profiles), 2, squeeze=False, sharey=True, width_ratios=(2.0, 1.0)
    )
    for (left, right), pair in zip(grid, comparison.profiles.values(), strict=True):
        _draw_pair(left, pair, comparison.names)
        _draw_ratio(right, pair)


def _draw_pair(axes: Any, pair: ProfilePair, names: tuple[str, str]) -> None:
    tables = (pair.first, pair.second)
    for color, marker, table, name in zip(COLORS, "os", tables, names, strict=False):
        style: Any = {"names": (name, "", ""), "color": color}
        y = table.y / table.height
        draw_with_errors(axes, table.value, y, table.error, marker, **style)
    axes.locator_params(axis="x", nbins=5)
    axes.set_xlabel(axis_labels(pair.first)[0])
    axes.set_ylabel("height $y/H$ [–]")
    axes.set_ylim(0.0, 1.0)
    use_powers(axes, "x")
    field, values = pair.first.field, np.concatenate([table.value for table in tables])
    count_small_rises(axes.xaxis, field.label, field.symbol, pair.first.units[1], values)
    axes.legend(loc="best")


def _draw_ratio(axes: Any, pair: ProfilePair) -> None:
    known = np.isfinite(pair.ratio)
    axes.axvspan(-2.0, 2.0, color="0.9", linewidth=0.0, zorder=0)
    axes.axvline(0.0, color="0.4", linewidth=0.6)
    axes.plot(
        pair.ratio[known], pair.y[known], "o-", color="0.15", markeredgewidth=0.0, linewidth=0.7
    )
    axes.set_xlabel("difference / standard error [–]")
    if not known.any():
        place: dict[str, Any] = {"ha": "center", "va": "center", "transform": axes.transAxes}
        axes.text(0.5, 0.9, "no standard errors:\ntoo few frames", fontsize=7.0, **place)
    elif not known.all():
        axes.set_title(f"known in {pair.note}", fontsize=7.0)
    limit = max(3.0, 1.1 * float(np.abs(pair.ratio[known]).max(initial=0.0)))
    axes.set_xlim(-limit, limit)


def comparison_text(comparison: Comparison, _terminal: Terminal) -> str:
    """The profiles of two runs, one chart for each field."""
    charts = []
    for pair in comparison.profiles.values():
        tables = zip((pair.first, pair.second), comparison.names, strict=True)
        lines = [TextLine(name, table.value, table.y / table.height) for table, name in tables]
        label = f"{pair.first.field.label} [{unit_sign(pair.first.field.unit)}]"
        charts.append(draw_text(lines, label, "height y/H [–]"))
    return "\n\n".join(charts)


# ---- θ against η: the grains as faint points, the means of the bins with their spread

_NOTHING = 0.005
"""Mean θ that cannot be told from 0 in a figure."""

_WARM = 0.5
"""θ of the coldest grain above which the axis does not begin at 0."""


def draw_theta_eta(axes: Any, table: ThetaTable) -> None:
    """Draw θ against η into matplotlib axes."""
    size = 4.0 if table.eta.size < 1000 else 1.5
    point: dict[str, Any] = {"color": "0.65", "markeredgewidth": 0.0}
    if table.frames.size == 1:
        name_frame(axes, table.time, table.frame)
    axes.plot(table.eta, table.theta, ".", markersize=size, rasterized=True, **point)
    axes.plot([], [], ".", markersize=4.0, label="grains", **point)
    known = np.isfinite(table.mean)
    line: dict[str, Any] = {"color": COLORS[0], "markeredgewidth": 0.0, "markersize": 2.5}
    line |= {"linewidth": 0.8, "elinewidth": 0.6, "capsize": 1.2, "capthick": 0.6}
    line["label"] = "mean and standard deviation"
    center, mean, spread = (v[known] for v in (table.center, table.mean, table.spread))
    axes.errorbar(center, mean, yerr=spread, fmt="o-", **line)
    axes.set_xlabel(r"distance from the wall $\eta = y/H$ [–]")
    axes.set_ylabel(r"temperature $\theta = (T - T_0)/(T_\mathrm{wall} - T_0)$ [–]")
    # η up to 1/4 beyond the last bin that differs from θ = 0
    changed = np.flatnonzero(np.abs(np.nan_to_num(table.mean)) > _NOTHING)
    last = 1.25 * float(table.center[changed[-1]]) + 0.02 if changed.size else 1.0
    axes.set_xlim(0.0, min(1.0, last))
    low, high = float(table.theta.min()), float(table.theta.max())
    # From 0 to 1, unless all grains are so warm that there would be nothing to see below them.
    top = max(1.0, high)
    axes.set_ylim(min(0.0, low) if low < _WARM else low - 0.1 * (top - low), top)
    axes.legend(loc="best")


def theta_eta_text(table: ThetaTable, _terminal: Terminal) -> str:
    """Mean θ of the bins against η."""
    return draw_text([TextLine("", table.center, table.mean)], "eta [–]", "theta [–]")


# ---- Mean square displacements over the lag


def draw_diffusion(axes: Any, table: Diffusion) -> None:
    """Draw mean squares over the squared diameter, and straight lines of both diffusivities."""
    square, is_sheared = table.diameter**2, table.shear_rate > 0.0
    lag = table.strain if is_sheared else table.lag
    style: Any = {"markersize": 2.5, "linewidth": 0.9, "is_upright": False}
    for axis, color, marker, diffusivity in zip("xy", COLORS, "os", table.diffusion, strict=False):
        mean, error = (getattr(table, f"{of}_{axis}") / square for of in ("msd", "error"))
        style |= {"names": (f"along ${axis}$", "", ""), "color": color}
        draw_with_errors(axes, mean, lag, error, marker, is_alone=False, **style)
        straight = 2.0 * diffusivity * table.lag / square
        far = table.lag >= table.lag[-1] / 3.0
        straight += (mean - straight)[far].mean()
        axes.plot(lag[far], straight[far], "--", color="0.15", linewidth=0.7, zorder=3)
    axes.plot([], [], "--", color="0.15", linewidth=0.7, label=r"$2 D t$ + const.")
    explain_errors(axes, [table.error_x, table.error_y])
    axes.set_xlabel(r"strain $\dot\gamma t$ in the lag [–]" if is_sheared else "lag $t$ [s]")
    axes.set_ylabel(r"mean square $\langle \Delta^2 \rangle/d^2$ [–]")
    axes.set(xlim=(0.0, None), ylim=(0.0, None))
    axes.legend(loc="upper left")


def diffusion_text(table: Diffusion, _terminal: Terminal) -> str:
    """Mean squares over the lag, on logarithmic scales."""
    lines = [TextLine(name, table.lag, getattr(table, f"msd_{name}")) for name in "xy"]
    return draw_text(lines, "lag [s]", "mean square [m²]", is_logarithmic=True)


FIGURES = {
    Diffusion: Renderer((COLUMN, 0.85 * COLUMN), in_axes(draw_diffusion), diffusion_text),
    ProfileSet: Renderer(
        lambda table: (
            (COLUMN, COLUMN)
            if _are_components(table)
            else (PAGE if table.tables[1:] else COLUMN, 0.9 * COLUMN)
        ),
        _fill,
        profiles_text,
    ),
    ProfileTable: Renderer(
        (COLUMN, 0.9 * COLUMN),
        in_axes(draw_profile),
        lambda table, terminal: profiles_text(ProfileSet(table.field.name, (table,)), terminal),
    ),
    Comparison: Renderer(
        lambda table: (PAGE, 0.85 * COLUMN * len(table.profiles)), draw_comparison, comparison_text
    ),
    ThetaTable: Renderer((COLUMN, 0.8 * COLUMN), in_axes(draw_theta_eta), theta_eta_text),
}
