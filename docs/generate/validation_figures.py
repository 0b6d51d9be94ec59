"""Figures of the page about validation, from the numbers that the tests have kept (see
`validation.py`).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from multicor_cli.plots.style import COLORS, PAGE, house_style, save_figure

Numbers = Mapping[str, list[dict[str, Any]]]
"""What the tests have kept, by the names of their functions."""

SOFT_DISCS = (
    (0.001, 0.003, 0.01, 0.03, 0.1, 0.2),
    (0.258, 0.269, 0.279, 0.308, 0.389, 0.482),
    (0.8131, 0.8130, 0.8101, 0.8039, 0.7836, 0.7519),
)
"""I, μ* and ν of soft discs with μ = 0.4: the table of theory §15.4."""

_POINTS: dict[str, Any] = {"linestyle": "none", "markeredgewidth": 0.0, "markersize": 3.5}
_OPEN: dict[str, Any] = {
    "linestyle": "none",
    "markerfacecolor": "none",
    "color": "0.2",
    "markersize": 5.0,
    "markeredgewidth": 0.8,
}


def draw_figures(numbers: Numbers, folder: Path) -> None:
    """Write the figures of all kinds."""
    for name, (count, draw) in FIGURES.items():
        with house_style():
            figure = Figure(figsize=(PAGE, 2.5 if count == 3 else 2.8), layout="constrained")
            FigureCanvasAgg(figure)
            draw(figure.subplots(1, count), numbers)
            save_figure(figure, folder / f"{name}.svg")


def _closed_forms(panels: Any, numbers: Numbers) -> None:
    orders, bed, layer = panels
    heat = numbers["test_two_bodies_to_the_order_of_the_integrator"]
    wall = numbers["test_loaded_wall_reaches_its_terminal_velocity"][0]
    names = "heat, Euler", "heat, SSPRK", "heat, TR-BDF2", "loaded wall"
    for color, name, found in zip(COLORS, names, (*heat, wall), strict=False):
        steps, error = np.array(found["steps"]), np.array(found["error"])
        orders.loglog(
            steps, error, "o", color=color, label=f"{name}: order {found['order']}", **_POINTS
        )
        orders.loglog(
            steps, error[-1] * (steps[-1] / steps) ** found["order"], color=color, linewidth=0.7
        )
    orders.set_xlabel("number of time steps")
    orders.set_ylabel("relative error [–]")
    orders.set_ylim(top=100.0)
    orders.legend(loc="upper right")
    for color, name, found in zip(COLORS, ("vacuum", "air"), numbers["test_profile"], strict=False):
        bed.plot(
            found["eta"], found["theta"], color=color, linewidth=0.9, label=f"computed, {name}"
        )
        bed.plot(
            found["exact_eta"],
            found["exact_theta"],
            "s",
            label="exact" if name == "air" else None,
            **_OPEN,
        )
    bed.set_xlim(0.0, 0.2)
    bed.set_ylim(0.0, 1.0)
    bed.set_xlabel(r"height $\eta = y/H$ [–]")
    bed.set_ylabel(r"temperature $\theta$ [–]")
    bed.legend()
    for color, found in zip(COLORS, numbers["test_isothermal_walls"], strict=False):
        scale = max(found["expected"])
        label = rf"flow, $\lambda = {found['conductivity']:.0f}$"
        layer.plot(
            np.array(found["rise"]) / scale,
            found["height"],
            "o",
            color=color,
            label=label,
            **_POINTS,
        )
        layer.plot(np.array(found["expected"]) / scale, found["height"], color=color, linewidth=0.8)
    layer.plot([], [], color="0.4", linewidth=0.8, label="conduction at rest")
    layer.set_xlim(0.0, 1.1)
    layer.set_ylim(0.0, 1.0)
    layer.set_xlabel("rise over the largest [–]")
    layer.set_ylabel("height $y/H$ [–]")
    layer.legend(loc="center left")


def _shear(panels: Any, numbers: Numbers) -> None:
    flows, biaxial = numbers["test_rheology"], numbers["test_stresses_and_the_critical_state"][0]
    columns = (
        ("friction", r"friction $\mu^*$ [–]", 1),
        ("solid_fraction", r"solid fraction $\nu$ [–]", 2),
    )
    curve = np.geomspace(8e-4, 0.25, 100)
    fits = {"friction": 0.2567 + 0.775 * curve**0.768, "solid_fraction": 0.8135 - 0.307 * curve}
    for panel, (name, label, row) in zip(panels, columns, strict=True):
        panel.semilogx(
            curve, fits[name], color="0.6", linewidth=0.8, label="fit through the soft discs"
        )
        panel.semilogx(
            SOFT_DISCS[0], SOFT_DISCS[row], "s", label="soft discs, another program", **_OPEN
        )
        for k, flow in enumerate(flows):
            style = {
                **_POINTS,
                "color": COLORS[0],
                "label": "plane shear, seed by seed" if k == 0 else None,
            }
            panel.errorbar(
                flow["inertial_number"],
                flow[name],
                yerr=flow[f"{name}_error"],
                fmt="o",
                elinewidth=0.7,
                **style,
            )
        error = biaxial[f"{name}_error"]
        style = {**_POINTS, "color": COLORS[1], "label": "biaxial test, four seeds"}
        panel.errorbar(
            [biaxial["inertial_number"]],
            [biaxial[name]],
            yerr=error,
            fmt="D",
            elinewidth=0.7,
            **style,
        )
        panel.set_xlabel("inertial number $I$ [–]")
        panel.set_ylabel(label)
    panels[0].legend(loc="upper left")


def _cookbook(panels: Any, numbers: Numbers) -> None:
    chute, opening, silo = panels
    for color, angle, found in zip(COLORS, (24, 20), numbers["test_steady_flow"], strict=False):
        chute.plot(
            found["velocity"],
            1e3 * np.array(found["height"]),
            "o",
            color=color,
            label=f"{angle}°",
            **_POINTS,
        )
        chute.plot(found["bagnold"], 1e3 * np.array(found["height"]), color=color, linewidth=0.8)
    chute.plot([], [], color="0.4", linewidth=0.8, label="Bagnold")
    chute.set_xlabel("velocity down the chute [m/s]")
    chute.set_ylabel("height [mm]")
    chute.legend()
    flow = numbers["test_the_flow_rate_follows_beverloo"][0]
    size, rate = np.array(flow["opening"]), np.array(flow["rate"])
    for seed, rates in enumerate(rate):
        opening.plot(
            size, rates ** (2.0 / 3.0), "o", color=COLORS[seed], label=f"seed {seed + 1}", **_POINTS
        )
    line = np.array([2.0, 13.0])
    opening.plot(
        line, flow["start"] + flow["slope"] * line, color="0.4", linewidth=0.8, label="Beverloo"
    )
    opening.set_xlabel("opening over diameter $D/d$ [–]")
    opening.set_ylabel("(grains per second)$^{2/3}$")
    opening.set_xlim(0.0, 13.0)
    opening.set_ylim(bottom=0.0)
    opening.legend(loc="upper left")
    stress = numbers["test_the_stress_saturates_as_janssen_says"][0]
    silo.plot(stress["depth"], stress["stress"], "o", color=COLORS[0], label="computed", **_POINTS)
    silo.plot(stress["depth"], stress["janssen"], color="0.4", linewidth=0.8, label="Janssen")
    silo.plot(
        stress["depth"],
        stress["weight"],
        color="0.4",
        linewidth=0.8,
        linestyle="--",
        label="all weight above",
    )
    silo.set_xlabel("depth over width [–]")
    silo.set_ylabel(r"stress $\sigma_{yy}$ [N/m]")
    silo.set_ylim(0.0, 1.5 * max(stress["stress"]))
    silo.legend(loc="lower right")


FIGURES = {
    "validation-closed-forms": (3, _closed_forms),
    "validation-shear": (2, _shear),
    "validation-cookbook": (3, _cookbook),
}
"""Number of panels and what draws them, by the names of the files."""
