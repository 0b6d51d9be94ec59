"""The contacts of a step, or of a state at rest, as the heat sees them: forces, spots and conductances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multicor_cli.arithmetic import expm1
from multicor_cli.engine.contact.detection import StepContacts, warm_rows
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.heat.conduction import contact_spots
from multicor_cli.engine.heat.laws import HeatLaws
from multicor_cli.engine.heat.pairs import look_up
from multicor_cli.engine.heat.settings import HeatSettings
from multicor_cli.model.columns import GAP, NORMAL
from multicor_cli.model.model import Floats, Ints
from multicor_cli.model.state import State

TOUCHING = 1e-4
"""Largest gap, over the smaller radius, of pairs that touch when no step has said which contacts carry a force."""


@dataclass(frozen=True)
class Spots:
    """Contacts that conduct; ``c`` of them, sorted by (i, j).

    Attributes:
        i: Grain, shape ``(c,)``.
        j: Grain or wall shape, shape ``(c,)``.
        radius: Radius of the contact a_c [m]; 0 where none, shape ``(c,)``.
        conductance: H_c [W/K], shape ``(c,)``.
    """

    i: Ints
    j: Ints
    radius: Floats
    conductance: Floats


def forces_of_step(state: State, contacts: StepContacts, settings: HeatSettings, dt: float) -> Floats:
    """Normal forces of the Hertz radii [N], shape ``(c,)``; keeps the running averages of ``state`` where they are used.

    An average counts the time without force, and ends when the pair leaves the reach of the contact solver. It is divided by
    1 − exp(−age/τ), the weight of the time that it knows. What is apart conducts nothing, whatever its average.
    """
    carried = contacts.impulse[:, NORMAL]
    if settings.force.kind == "prescribed":
        return np.where(carried > 0.0, settings.force.value, 0.0)
    if settings.force.kind == "step":
        return np.asarray(carried / dt)
    before = _averages(state, contacts.i, contacts.j)
    mean: Floats = before + (carried / dt - before) * -expm1(-dt / settings.force.value)
    kept = mean != 0.0  # nan stays, to be noticed
    state.mean_i, state.mean_j, state.mean_force = contacts.i[kept], contacts.j[kept], mean[kept]
    state.mean_age += dt
    touches = (carried > 0.0) | (contacts.frame[:, GAP] <= 0.0)
    return np.where(touches, mean / _known_weight(state, settings), 0.0)


def _averages(state: State, i: Ints, j: Ints) -> Floats:
    """Running averages of the forces of some pairs [N]; 0 for pairs without."""
    found = np.empty(i.size)
    look_up(warm_rows(len(state.position), state.mean_i), state.mean_j, state.mean_force, i, j, found)
    return found


def _known_weight(state: State, settings: HeatSettings) -> float:
    """Weight of the time since the start of the averages: 1 − exp(−age/τ)."""
    return -expm1(-state.mean_age / settings.force.value)


def loaded_pairs(state: State, settings: HeatSettings) -> tuple[Ints, Ints, Floats]:
    """Contacts that carried a force in the last step: i, j and normal force [N] (averaged, where averages are kept)."""
    force, i, j = settings.force, state.contact_i, state.contact_j
    if force.kind == "average" and state.mean_age > 0.0:
        return i, j, _averages(state, i, j) / _known_weight(state, settings)
    carried: Floats = state.contact_impulse[:, NORMAL] / state.last_dt
    return i, j, np.full(carried.size, force.value) if force.kind == "prescribed" else carried


def pairs_at_rest(near: tuple[Ints, Ints, Floats], settings: HeatSettings) -> tuple[Ints, Ints, Floats]:
    """Pairs that touch in a state in which no step has been taken, under the prescribed force; without one it is 0."""
    i, j, _ = near
    return i, j, np.full(i.size, settings.force.value if settings.force.kind == "prescribed" else 0.0)


def conducting_spots(scene: Scene, i: Ints, j: Ints, force: Floats, laws: HeatLaws, settings: HeatSettings) -> Spots:
    """Radii and conductances of contacts under given normal forces [N]."""
    radius, conductance = np.empty(i.size), np.empty(i.size)
    contact_spots(scene, i, j, force, laws, settings.conduction == "rough", radius, conductance)
    if settings.conduction == "none":
        conductance[:] = 0.0
    return Spots(i, j, radius, conductance)
