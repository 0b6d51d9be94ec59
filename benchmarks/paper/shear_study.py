"""Study 4.3, figures 9 to 13: plane shear in a slow and a fast flow."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from entry import Entry, Panel, Rows, percent, versus
from flow_numbers import BINS, LAYER, LEVELS, Flow, measure

from multicor_cli import open_run
from multicor_cli.plots import plot
from multicor_cli.post import grain_map, profile
from multicor_cli.store import Run

_SCALES = "V, F, H, e, the material, what the walls do to heat, and every scale of figures 11–13."


class _Regime(NamedTuple):
    name: str
    label: str
    run: Run
    flow: Flow


def shear_entries(slow: Path, fast: Path) -> list[Entry]:
    """Figures 9 to 13 from finished runs of ``configs/shear.toml`` and
    ``configs/shear-dynamic.toml``.
    """
    with open_run(slow) as first, open_run(fast) as second:
        regimes = [
            _Regime(name, label, run, measure(run))
            for name, label, run in (("slow", "quasi-static", first), ("fast", "dynamic", second))
        ]
        return [
            make(regimes) for make in (_figure_9, _figure_10, _figure_11, _figure_12, _figure_13)
        ]


def _table(regimes: list[_Regime], lines: list[tuple[str, Callable[[Flow], str]]]) -> Rows:
    return [(label, *(value(regime.flow) for regime in regimes)) for label, value in lines]


def _head(regimes: list[_Regime]) -> tuple[str, ...]:
    return ("", *(regime.label for regime in regimes))


def _maps(regimes: list[_Regime], number: str, of: str) -> list[Panel]:
    return [_map_panel(regime, number, of) for regime in regimes]


def _map_panel(regime: _Regime, number: str, of: str) -> Panel:
    table = grain_map(regime.run, of)
    caption = f"{regime.label}: {table.field.label}, t = {table.time:.3g} s (the last frame)."
    return Panel(f"figure-{number}-{of}-{regime.name}", caption, lambda path: plot(table, path))


def _profiles(
    regimes: list[_Regime],
    number: str,
    of: str,
    *,
    bins: int | None = None,
    is_normalized: bool = False,
) -> list[Panel]:
    return [
        _profile_panel(regime, number, of, bins, is_normalized=is_normalized) for regime in regimes
    ]


def _profile_panel(
    regime: _Regime, number: str, of: str, bins: int | None, *, is_normalized: bool
) -> Panel:
    table: Any = profile(regime.run, of, bins=bins, exclude_walls=0.0)
    table = table.normalized() if is_normalized else table
    caption = (
        f"{regime.label}: {table.field.label}, mean over t = {table.times[0]:.3g} to "
        f"{table.times[1]:.3g} s."
    )
    return Panel(f"figure-{number}-{of}-{regime.name}", caption, lambda path: plot(table, path))


def _figure_9(regimes: list[_Regime]) -> Entry:
    slow, fast = (regime.flow.numbers for regime in regimes)
    rows = _table(
        regimes,
        [
            (
                "inertial number (V/H) √(m/P), P on the upper wall",
                lambda f: f"{f.numbers['inertial']:.2g}",
            ),
            (
                f"with the shear rate of the sheared layer, {LAYER[0]}–{LAYER[1]} H",
                lambda f: f"{f.numbers['layer_inertial']:.2g}",
            ),
            ("strain at the end", lambda f: f"{f.numbers['strain']:.3g}"),
            ("fluctuations there, δv/(γ̇ d)", lambda f: f"{f.numbers['swirl']:.2g}"),
            (
                "correlation of vertical fluctuations there, 2.5 d apart",
                lambda f: _together(f.numbers),
            ),
            (
                "solid fraction, 0.1–0.9 H: at the start",
                lambda f: f"{f.numbers['solid_start']:.3f}",
            ),
            ("later", lambda f: f"{f.numbers['solid']:.3f}"),
        ],
    )
    differs = [
        _vortices(slow, fast),
        (
            f"In the dynamic regime the solid fraction ({fast['solid']:.3f}) is "
            f"{versus(fast['solid_start'], fast['solid'])} than at the start of the shearing "
            f"({fast['solid_start']:.3f}) and {versus(slow['solid'], fast['solid'])} than in the "
            f"slow flow ({slow['solid']:.3f}); the paper has it close to its maximum. A flow "
            "dilates as its inertial number grows."
        ),
    ]
    return Entry(
        "9",
        "Velocities and vortices",
        [
            (
                "Grains of 1, 2, 3 mm, μ = 0.5, periodic, 40 grains long, compacted under "
                "gravity, between rough walls, the upper one moved at V under a load F; a "
                "quasi-static and a dynamic regime."
            ),
            "The velocity field shows vortices.",
            "In the dynamic regime the solid fraction is close to its maximum.",
        ],
        [
            _SCALES
            + (
                " Chosen: 1,600 spheres of the steel of 4.2; 1, 2, 3 mm as diameters in equal "
                "numbers; e = 0; walls at 25 °C."
            )
        ],
        [*_maps(regimes, "09", "fluctuation"), *_maps(regimes, "09", "velocity")],
        _head(regimes),
        rows,
        differs,
    )


def _together(numbers: dict[str, float]) -> str:
    return f"{numbers['together']:.2f} ± {numbers['together_error']:.2f}"


def _vortices(slow: dict[str, float], fast: dict[str, float]) -> str:
    text = (
        "Grains move together over several diameters: the correlation of vertical fluctuations "
        f"2.5 diameters apart is {_together(slow)} in the slow flow and {_together(fast)} in the "
        "fast one. "
    )
    error = np.hypot(slow["together_error"], fast["together_error"])
    if abs(slow["together"] - fast["together"]) < 2.0 * error:
        return text + (
            "In one run of each the two regimes cannot be told apart by it; the pictures show "
            "single frames."
        )
    return text + f"It is {versus(slow['together'], fast['together'])} in the fast flow."


def _figure_10(regimes: list[_Regime]) -> Entry:
    panels = [
        Panel(
            f"figure-10-{when}-{regime.name}",
            f"{regime.label}, {text}: t = {network.time:.3g} s.",
            partial(plot, network),
        )
        for when, text in (("start", "at the start of the shearing"), ("flow", "in the flow"))
        for regime in regimes
        for network in (regime.flow.start if when == "start" else regime.flow.end,)
    ]
    fields: list[tuple[str, str, Callable[[float], str]]] = [
        ("coordination", "contacts per grain", lambda v: f"{v:.2f}"),
        ("rattler_share", "rattlers", percent),
        ("sliding_share", "sliding contacts", percent),
        ("normal_force_mean", "mean normal force", lambda v: f"{v:.3g} N"),
        ("normal_force_max", "largest normal force", lambda v: f"{v:.3g} N"),
    ]
    head = ("", *(f"{regime.label}, {when}" for regime in regimes for when in ("start", "flow")))
    rows: Rows = [
        (
            label,
            *(
                text(network.summary[name])
                for r in regimes
                for network in (r.flow.start, r.flow.end)
            ),
        )
        for name, label, text in fields
    ]
    slow, fast = (regime.flow.end for regime in regimes)
    return Entry(
        "10",
        "Contact forces at the start and in the flow",
        ["The contact forces at the start of the shearing, and in the flow."],
        ["The scale of the forces, and the times."],
        panels,
        head,
        rows,
        [
            (
                f"In the flow the fast regime has {fast.coordination:.1f} contacts per grain and "
                f"the slow one {slow.coordination:.1f}, with {percent(fast.rattler_share)} and "
                f"{percent(slow.rattler_share)} rattlers. In the fast flow the force of a contact "
                "is an impulse over a time step: what the picture shows are the impacts of one "
                "step."
            )
        ],
    )


def _figure_11(regimes: list[_Regime]) -> Entry:
    heights = [regime.flow.heights for regime in regimes]
    rows: Rows = [
        (f"y/H where v/V = {level:g}", *(f"{height[k]:.2f}" for height in heights))
        for k, level in enumerate(LEVELS)
    ]
    parts = [
        (
            f"in the {regime.label} regime the upper {percent(1.0 - height[0])} of the height is "
            f"faster than {LEVELS[0]:g} V"
        )
        for regime, height in zip(regimes, heights, strict=True)
    ]
    return Entry(
        "11",
        "Velocity profile",
        ["The profile of the mean velocity over the height, in both regimes."],
        [_SCALES],
        _profiles(regimes, "11", "velocity", is_normalized=True),
        _head(regimes),
        rows,
        [
            (
                "Without V and H in the paper only the shape can be compared: "
                f"{', and '.join(parts)}. The flow localizes at the upper wall, because gravity "
                "makes the pressure grow downwards."
            )
        ],
    )


def _figure_12(regimes: list[_Regime]) -> Entry:
    sizes = list(regimes[0].flow.rises)
    rows: Rows = [
        (
            f"mean rise of grains of {1e3 * size:g} mm at the end",
            *(_kelvin(regime.flow.rises[size]) for regime in regimes),
        )
        for size in sizes
    ]
    rows += _table(
        regimes,
        [
            (
                "hottest layer, its mean rise at the end",
                lambda f: _kelvin(f.numbers["mean_rise"] - f.temperature.wall_values[0]),
            ),
            (
                "height of the hottest layer (mean over the later half)",
                lambda f: f"{f.peak(f.temperature):.2f} H",
            ),
        ],
    )
    parts = [
        (
            f"{regime.label}, {regime.flow.rises[sizes[0]] / regime.flow.rises[sizes[-1]]:.1f} "
            f"times as much as those of {1e3 * sizes[-1]:g} mm"
        )
        for regime in regimes
    ]
    return Entry(
        "12",
        "Temperatures of the grains",
        ["A map of the temperatures in the sheared cell."],
        [_SCALES],
        _maps(regimes, "12", "temperature"),
        _head(regimes),
        rows,
        [
            (
                f"Small grains are hottest: those of {1e3 * sizes[0]:g} mm have warmed, "
                f"{'; '.join(parts)}. A contact shares its heat equally (one material), and a "
                f"small grain has 1/{(sizes[-1] / sizes[0]) ** 3:.0f} of the heat capacity of a "
                "large one. The map shows single small grains, not a smooth field."
            )
        ],
    )


def _kelvin(rise: float) -> str:
    return f"{1e3 * rise:.2g} mK" if abs(rise) < 0.1 else f"{rise:.2g} K"


def _figure_13(regimes: list[_Regime]) -> Entry:
    rows = _table(
        regimes,
        [
            (
                "heat of friction, of impacts (shearing)",
                lambda f: f"{f.books['heat_friction']:.2g} J, {f.books['heat_impact']:.2g} J",
            ),
            ("of these into the walls", lambda f: percent(f.books["heat_to_walls"] / _heat(f))),
            (
                "paper's heat of friction over the work of friction",
                lambda f: f"{f.books['friction_sliding'] / f.books['friction_loss']:.2f}",
            ),
            (
                "paper's heat (sliding, no impacts) over all that is lost",
                lambda f: f"{_counted(f):.2f}",
            ),
            (
                "largest heat rate, spin, temperature at y/H",
                lambda f: ", ".join(
                    f"{f.peak(table):.2f}" for table in (f.heat, f.spin, f.temperature)
                ),
            ),
            (
                "correlation of heat with γ̇, with −spin",
                lambda f: "{:.2f}, {:.2f}".format(*f.likeness),
            ),
            (f"−spin/γ̇ above 0.7 H (bins of H/{BINS}): least, mean, most", _spin_text),
            ("duration of the shearing", lambda f: f"{f.numbers['duration']:.2g} s"),
            (
                "time for conduction across the cell, h²/(π²D)",
                lambda f: f"{f.numbers['conduction']:.1g} s",
            ),
            ("time for mixing across the cell", lambda f: f"{f.numbers['mixing']:.1g} s"),
        ],
    )
    panels = [
        *_profiles(regimes, "13", "heat"),
        *_profiles(regimes, "13", "spin", bins=BINS, is_normalized=True),
        *_profiles(regimes, "13", "temperature"),
    ]
    return Entry(
        "13",
        "Profiles of heat, spin and temperature",
        [
            "The cell is hottest in the middle.",
            "The profiles of heat and of spin look alike.",
            "A published profile of the granular temperature is quoted as confirmation.",
        ],
        [_SCALES],
        panels,
        _head(regimes),
        rows,
        _differs_13([regime.flow for regime in regimes]),
    )


def _heat(flow: Flow) -> float:
    return flow.books["heat_friction"] + flow.books["heat_impact"]


def _counted(flow: Flow) -> float:
    return flow.books["friction_sliding"] / (
        flow.books["friction_loss"] + flow.books["impact_loss"]
    )


def _spin_text(flow: Flow) -> str:
    ratio = flow.spin_ratio
    return f"{np.nanmin(ratio):.2f}, {np.nanmean(ratio):.2f}, {np.nanmax(ratio):.2f}"


def _differs_13(flows: list[Flow]) -> list[str]:
    slow, fast = flows
    shortest = min(
        min(flow.numbers["conduction"], flow.numbers["mixing"]) / flow.numbers["duration"]
        for flow in flows
    )
    return [
        (
            f"No parabola: the temperature is largest at {slow.peak(slow.temperature):.2f} H in "
            f"the slow flow and at {fast.peak(fast.temperature):.2f} H in the fast one. Neither "
            "conduction nor mixing has carried heat across the cell: the shorter of their times "
            f"is at least {shortest:.0f} times the duration of the shearing. So the temperature "
            "is the source, added up: hottest where the shear is. Hottest in the middle needs "
            "walls that take the heat for hours, or a flow localized in the middle; under gravity "
            "it localizes at the upper wall, where the pressure is least."
        ),
        (
            f"Heat and spin do look alike (correlation {slow.likeness[1]:.2f} and "
            f"{fast.likeness[1]:.2f}), because both follow the shear rate: the source is μ*Pγ̇, "
            "the spin −γ̇/2. That is no evidence for a profile of temperature, and neither is a "
            "granular temperature."
        ),
        (
            "Friction at the end of the step misses "
            f"{percent(1.0 - slow.books['friction_sliding'] / slow.books['friction_loss'])} of "
            "the work of friction in slow flow and "
            f"{percent(1.0 - fast.books['friction_sliding'] / fast.books['friction_loss'])} in "
            "fast flow; friction alone leaves out the impacts, "
            f"{percent(slow.books['heat_impact'] / _heat(slow))} and "
            f"{percent(fast.books['heat_impact'] / _heat(fast))} of the heat. Ours counts both, "
            "to round-off."
        ),
    ]
