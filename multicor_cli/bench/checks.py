"""Physics that must hold in a scene before any time of it is reported."""

from __future__ import annotations

import numpy as np

from multicor_cli.bench.driving import PreparedScene, Round
from multicor_cli.model import BOOK_NAMES, HEAT_BOOK_NAMES, TALLY_NAMES

CLOSURE = 1e-10
OVERLAP = 1e-3
WEIGHT = 0.01
MISSED = 0.01


def find_faults(prepared: PreparedScene, rounds: list[Round]) -> list[str]:
    """What is wrong after the measured steps; empty if nothing is.

    Energy books closed to `CLOSURE`, heat books too; overlaps below `OVERLAP` of the smaller radius; at most `MISSED` of the steps
    not converged (one in a thousand is not in the fast shear flow: whether it is among those measured is chance); the floor of a
    bed carries its weight to `WEIGHT`; temperatures between those that walls and grains had at the start.
    """
    state, model, faults = prepared.state, prepared.model, []
    closure = state.books[BOOK_NAMES.index("closure")]
    if not closure <= CLOSURE:
        faults.append(f"the energy books are open by {closure:.1e}")
    overlap = state.tallies[TALLY_NAMES.index("max_overlap")]
    if not overlap <= OVERLAP:
        faults.append(f"grains overlap by {overlap:.1e} of their radius")
    missed = sum(not report.converged for round_ in rounds for report in round_.reports)
    if missed > MISSED * sum(len(round_.reports) for round_ in rounds):
        faults.append(f"{missed} steps did not converge")
    if prepared.scene.is_weighed:
        faults += _weigh(prepared)
    if model.thermal is not None:
        faults += _check_heat(prepared)
    return faults


def _weigh(prepared: PreparedScene) -> list[str]:
    """The floor's impulse over the time since the scene began is the weight; the window sums it."""
    state, model = prepared.state, prepared.model
    weight = float(model.grains.mass.sum()) * float(np.hypot(*model.gravity))
    force = -float(state.window_wall_impulse[0, 1]) / (state.stage_step * prepared.stage.dt)
    return [] if abs(force / weight - 1.0) <= WEIGHT else [f"the floor carries {force / weight:.4f} of the weight"]


def _check_heat(prepared: PreparedScene) -> list[str]:
    state, model, faults = prepared.state, prepared.model, []
    assert model.thermal is not None
    closure = state.heat_books[HEAT_BOOK_NAMES.index("closure")]
    if not closure <= CLOSURE:
        faults.append(f"the heat books are open by {closure:.1e}")
    temperature = state.temperature(model.thermal)
    known = np.concatenate([model.thermal.start, state.wall_temperature[np.isfinite(state.wall_temperature)]])
    if not known.min() - 1e-6 <= temperature.min() <= temperature.max() <= known.max() + 1e-6:
        faults.append(f"temperatures from {temperature.min():g} to {temperature.max():g} K")
    if not state.heat_books[HEAT_BOOK_NAMES.index("stored")] > 0.0:
        faults.append("no heat has come in")
    return faults
