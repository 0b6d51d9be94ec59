"""Figure of a profile: the field across, the height upwards, as one looks at the grains."""

from __future__ import annotations

from typing import Any

import numpy as np

from multicor_cli.plots.style import (
    COLORS,
    COLUMN,
    Renderer,
    Terminal,
    TextLine,
    axis_label,
    draw_text,
    draw_with_errors,
    explain_errors,
    rise_formatter,
    rise_label,
    rise_reference,
)
from multicor_cli.post import ProfileSet, ProfileTable
from multicor_cli.text import unit_sign


def _fill(figure: Any, profiles: ProfileSet) -> None:
    """Draw one profile as `draw_profile` does, or those of several fields of one unit into one panel."""
    if len(profiles.tables) == 1:
        draw_profile(figure.add_subplot(), profiles.first)
        return
    _draw_profiles(figure.add_subplot(), profiles)
    figure.legend(loc="outside upper center", ncols=4, columnspacing=1.2)


def _draw_profiles(axes: Any, profiles: ProfileSet) -> None:
    for color, marker, table in zip(COLORS, "os^D", profiles.tables, strict=False):
        names = (f"${table.field.symbol}$", "", "")
        draw_with_errors(axes, table.value, table.y, table.error, marker, names=names, color=color, markersize=2.5, linewidth=0.9)
    explain_errors(axes, [table.error for table in profiles.tables])
    _, upwards = axis_labels(profiles.first)
    what = profiles.name.replace("-", " ") + profiles.first.about_groups
    axes.set_xlabel(f"{what}, compression positive [{unit_sign(profiles.first.units[1])}]")
    axes.set_ylabel(upwards)
    axes.locator_params(axis="x", nbins=5)
    axes.set_ylim(0.0, profiles.first.height)
    axes.ticklabel_format(scilimits=(-3, 4), useMathText=True)


def draw_profile(axes: Any, table: ProfileTable) -> None:
    """Draw a profile into matplotlib axes."""
    has_errors = np.isfinite(table.error).any()
    names = ("mean" if has_errors else "mean, errors not known", "standard error", "mean, error not known")
    draw_with_errors(axes, table.value, table.y, table.error, "o", names=names, color=COLORS[0])
    across, upwards = axis_labels(table)
    axes.locator_params(axis="x", nbins=5)
    axes.ticklabel_format(scilimits=(-3, 4), useMathText=True)
    field = table.field
    low, high = float(np.nanmin(table.value, initial=np.inf)), float(np.nanmax(table.value, initial=-np.inf))
    reference = rise_reference(table.units[1], low, high)
    if reference is not None:
        across = rise_label(f"{field.label}{table.about_groups}", field.symbol, reference)
        axes.xaxis.set_major_formatter(rise_formatter(reference))
    axes.set_xlabel(across)
    axes.set_ylabel(upwards)
    axes.set_ylim(0.0, 1.0 if table.is_normalized else table.height)
    # Above the panel, where no line runs.
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, borderaxespad=0.2, columnspacing=1.0)


def axis_labels(table: ProfileTable) -> tuple[str, str]:
    """Labels of the axes: quantity, symbol and unit."""
    field = table.field
    if not table.is_normalized:
        return axis_label(f"{field.label}{table.about_groups}", field.symbol, field.unit), "height $y$ [m]"
    return f"{field.label}{table.about_groups} ${_scaled_symbol(table)}$ [–]", "height $y/H$ [–]"


def _scaled_symbol(table: ProfileTable) -> str:
    field, low = table.field, table.wall_values[0]
    if field.scaling == "shear":
        return f"{field.symbol} H/(V_1 - V_0)"
    symbol = field.symbol.split("_")[0]
    return f"({field.symbol} - {symbol}_0)/({symbol}_1 - {symbol}_0)" if low else f"{field.symbol}/{symbol}_\\mathrm{{wall}}"


def profiles_text(profiles: ProfileSet, _terminal: Terminal) -> str:
    """Profiles: the fields across, the height upwards."""
    first, has_many = profiles.first, len(profiles.tables) > 1
    lines = [TextLine(t.field.name if has_many else "", t.value, t.y) for t in profiles.tables]
    label = profiles.name.replace("-", " ") if has_many else first.field.label
    return draw_text(lines, f"{label} [{unit_sign(first.units[1])}]", f"height y [{first.units[0]}]")


FIGURES = {
    ProfileSet: Renderer(lambda table: (COLUMN, COLUMN if len(table.tables) > 1 else 0.9 * COLUMN), _fill, profiles_text),
    ProfileTable: Renderer(
        lambda _: (COLUMN, 0.9 * COLUMN),
        lambda figure, table: draw_profile(figure.add_subplot(), table),
        lambda table, terminal: profiles_text(ProfileSet(table.field.name, (table,)), terminal),
    ),
}
