"""The fastest motion with which a run starts: what the automatic time step has to follow, whatever it comes from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli.model import Model, State
from multicor_cli.model.columns import SPIN, X, Y
from multicor_cli.model.model import Floats
from multicor_cli.scenario import Scenario


def start_speed(scenario: Scenario, model: Model, state: State) -> float:
    """The largest speed of a grain, of the surface of a grain (a |ω|), and of a wall at the start [m/s].

    Between walls that shear a periodic domain, grains count relative to the linear profile between these walls, and the walls
    themselves do not count: neighbors pass each other no faster than the rate of shear says.
    """
    here, radius = state.here, model.grains.radius
    spans = np.array([wall.geometry.spans_period(scenario.domain) for wall in scenario.walls], bool)
    velocity = state.velocity[here]
    along = velocity[:, X] - _imposed(scenario, model, state, spans, state.position[here, Y])
    of_walls = np.where(spans, 0.0, state.wall_velocity[:, X])
    speeds = _length(along, velocity[:, Y]), radius[here] * np.abs(velocity[:, SPIN]), _length(of_walls, state.wall_velocity[:, Y])
    return max(float(values.max(initial=0.0)) for values in speeds)


def _length(x: Floats, y: Floats) -> Floats:
    return np.sqrt(x * x + y * y)


def _imposed(scenario: Scenario, model: Model, state: State, spans: NDArray[np.bool_], height: Floats) -> Floats:
    """Velocity in x of the linear profile between the lowest and the highest wall that spans the period, at heights [m/s]."""
    walls = np.flatnonzero(spans)
    at = state.wall_position[walls, Y]
    if walls.size < 2 or at.min() == at.max():
        return np.zeros_like(height)
    drives = scenario.drives(model.walls.names)[0].walls
    speed = []
    for wall in (walls[at.argmin()], walls[at.argmax()]):
        prescribed = drives[wall].x.velocity
        speed.append(float(state.wall_velocity[wall, X]) if prescribed is None else prescribed.value(0.0))
    return np.asarray(speed[0] + (speed[1] - speed[0]) * ((height - at.min()) / (at.max() - at.min())))
