"""The curve that the tests compare with: finite-element temperatures of the shipped scenario."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from arrangement import WATCHED, Floats, to_celsius
from case import Case, read_case
from disc_mesh import MeshChoice
from scipy.interpolate import CubicSpline
from study import solve_lattice

PATH = Path(__file__).with_name("finite_elements.csv")
INTERVAL = 2.0
"""Time between rows [s]: that of the frames of the scenario."""

_MESH = MeshChoice(halvings=1)  # four times as many triangles as in the sweep


def stored_curve(mesh: MeshChoice = _MESH) -> tuple[Case, Floats]:
    """Columns t [s] and mean temperatures of grains 1, 5 and 14 [°C] of the shipped scenario, shape
    ``(rows, 4)``.
    """
    case = read_case()
    history = solve_lattice(case.biot, mesh)
    times = np.arange(round(case.duration / INTERVAL) + 1) * INTERVAL
    means = CubicSpline(history.times, history.mean[:, WATCHED])(times / case.time_unit)
    return case, np.column_stack([times, to_celsius(means)])


def write_curve(path: Path = PATH) -> None:
    """Compute the curve and write it as CSV, with what it holds for in its head.

    Raises:
        OSError: If the file cannot be written.
    """
    case, rows = stored_curve()
    head = [
        (
            "# Mean temperatures of grains 1, 5 and 14 of configs/lattice14.toml with the heat "
            "conduction inside the discs resolved by"
        ),
        "# finite elements: python benchmarks/lattice14 --store",
        f"# conductance of the interface of each contact [W/K]: {case.conductance:.9e}",
        f"# heat capacity of a grain [J/K]: {case.capacity:.9e}",
        f"# Bi = H/(lambda h): {case.biot:.9e}",
        f"# half-width of the contact arcs over the radius: {_MESH.half_width:.9f}",
        "time [s],T1 [C],T5 [C],T14 [C]",
    ]
    lines = [f"{row[0]:g}," + ",".join(f"{value:.5f}" for value in row[1:]) for row in rows]
    path.write_text("\n".join([*head, *lines]) + "\n", encoding="utf-8")
