"""The cell of a run that is periodic in both directions: to engine and files a wall without shapes.

Its degrees of freedom, in the columns `XX`, `YY`, `XY` of the arrays of walls, are those of the
velocity gradient L = [[L_xx, L_xy], [0, L_yy]] [1/s]; its place are width, height and tilt [m]. The
cell is spanned by (width, 0) and (tilt, height).
"""

from __future__ import annotations

import numpy as np

from multicor_cli.model.columns import XX, XY, YY, X, Y
from multicor_cli.model.model import Floats, Model
from multicor_cli.model.state import State

CELL = "cell"
"""Name of the wall that is the cell, the only one of its model."""

COMPONENTS = ("xx", "yy", "xy")
"""Names of its degrees of freedom, in the order of the columns."""


COLUMNS = {
    "position": (("width", "height", "tilt"), "m"),
    "velocity": (tuple(f"rate_{name}" for name in COMPONENTS), "1/s"),
    "force": (tuple(f"stress_{name}" for name in COMPONENTS), "N/m"),
}
"""What tables call the columns of its position, velocity and force over its area; and units."""


def over_windows(values: Floats) -> Floats:
    """Means over the windows of a time series of values at their ends, shape ``(s, …)``.

    What a cell has at the ends of windows changes little in them: they are those of both ends.
    """
    before = np.concatenate([values[:1], values[:-1]])
    return np.asarray(0.5 * (before + values))


def cell_area(state: State) -> float:
    """Area of the cell of a state [m²]."""
    return float(state.wall_position[0, XX] * state.wall_position[0, YY])


def mean_flow(position: Floats, gradient: Floats) -> Floats:
    """Velocities of the mean flow L r at points [m/s], shape ``(n, 2)``.

    Points have x and y first [m], shape ``(n, ≥ 2)``; ``gradient`` is (L_xx, L_yy, L_xy) [1/s].
    """
    x, y = position[:, X], position[:, Y]
    return np.column_stack([gradient[XX] * x + gradient[XY] * y, gradient[YY] * y])


def real_velocity(model: Model, state: State) -> Floats:
    """Velocities and spins of the grains [m/s, rad/s], shape ``(n, 3)``.

    The state of a cell holds velocities relative to its mean flow; every other state holds these.
    """
    if not model.is_cell:
        return state.velocity
    velocity = state.velocity.copy()
    velocity[:, :2] += mean_flow(state.position, state.wall_velocity[0])
    return velocity
