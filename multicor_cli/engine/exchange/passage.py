"""Who comes and who goes before a step: a function of the state alone, and nothing more happens if it is asked for twice."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic.sums import total
from multicor_cli.engine.contact.report import PhysicsError
from multicor_cli.engine.exchange.books import book_in, book_out, book_returned, note_presence
from multicor_cli.engine.exchange.room import find_room
from multicor_cli.engine.exchange.rules import ExchangeRules, Outlet, Release
from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Model
from multicor_cli.model.state import Presence, State

NAMED = 5
"""Grains that a message names."""

ROUNDING = 1e-9
"""Part of a grain by which a release may be early: times are sums of steps."""

_GRAINS, _MASS = 0, 1  # columns of State.released and State.outlet_flow


def pass_grains(rules: ExchangeRules, model: Model, state: State, keep: Callable[[], None]) -> NDArray[np.int64] | None:
    """Let grains go, then let grains come.

    Args:
        rules: How.
        model: All grains.
        state: The state of all grains, between two steps. **Modified.**
        keep: Called before the first change, if any grain goes or comes.

    Returns:
        Those that came; None if none went or came.

    Raises:
        PhysicsError: If a grain is lost and that is to end the run; nothing has been changed then.
    """
    before = state.presence.copy()
    _lose(rules, model, state, keep)
    for number, outlet in enumerate(rules.outlets):
        _let_out(rules, number, outlet, model, state, keep)
    stayed = (before == Presence.THERE) & (state.presence == Presence.THERE)
    behind = 0
    for release in rules.releases:
        behind += _let_in(release, model, state, keep)
    note_presence(state, model, behind)
    # A grain may leave and come back at once: it is there all the time, but elsewhere.
    came = np.flatnonzero((state.presence == Presence.THERE) & ~stayed)
    if not came.size and np.array_equal(stayed, before == Presence.THERE):
        return None
    _forget_contacts(state, stayed)
    return came


def _lose(rules: ExchangeRules, model: Model, state: State, keep: Callable[[], None]) -> None:
    if rules.limits is None:
        return
    here = np.flatnonzero(state.presence == Presence.THERE)
    lost = here[~rules.limits.holds(state.position[here])]
    if lost.size and rules.stops:
        raise PhysicsError(state.step, _describe_lost(lost, state))
    if lost.size:
        keep()
        book_out(state, model, lost, "lost")
        state.presence[lost] = Presence.LOST


def _describe_lost(lost: NDArray[np.int64], state: State) -> str:
    places = [f"grain {k} at ({state.position[k, X]:.4g}, {state.position[k, Y]:.4g}) m" for k in lost[:NAMED].tolist()]
    more = f" and {lost.size - NAMED} more" if lost.size > NAMED else ""
    verb = "is" if lost.size == 1 else "are"
    remedy = 'close the walls, add an outlet, or let them go with [domain] lost = "remove"'
    return f"{', '.join(places)}{more} {verb} beyond the domain; {remedy}"


def _let_out(rules: ExchangeRules, number: int, outlet: Outlet, model: Model, state: State, keep: Callable[[], None]) -> None:
    here = np.flatnonzero(state.presence == Presence.THERE)
    leaving = here[outlet.region.holds(state.position[here])]
    if not leaving.size:
        return
    keep()
    book_out(state, model, leaving, "left")
    state.outlet_flow[number] += float(leaving.size), total(model.grains.mass[leaving])
    state.presence[leaving] = Presence.LEFT
    groups = [release.group for release in rules.releases]
    returning = leaving[np.isin(model.grains.group[leaving], groups)] if outlet.returns else leaving[:0]
    if returning.size:
        book_returned(state, model, returning)
        state.presence[returning] = Presence.WAITS


def _let_in(release: Release, model: Model, state: State, keep: Callable[[], None]) -> int:
    """Release the grains of a group that are due; returns how many of them found no room."""
    group = release.group
    allowed, column = release.allowed(state.time), _MASS if release.is_mass else _GRAINS
    queue = np.flatnonzero((state.presence == Presence.WAITS) & (model.grains.group == group)).tolist()
    for number, grain in enumerate(queue):
        unit = float(model.grains.mass[grain]) if release.is_mass else 1.0
        owed = allowed - float(state.released[group, column])
        if owed < -ROUNDING * unit:
            return 0
        place = find_room(release, round(float(state.released[group, _GRAINS])), grain, model, state)
        if place is None:
            return min(int((owed + ROUNDING * unit) / unit) + 1, len(queue) - number)
        keep()
        _put(grain, place, release, model, state)
    return 0


def _put(grain: int, place: tuple[float, float], release: Release, model: Model, state: State) -> None:
    x, y = place
    state.position[grain] = x - model.period if 0.0 < model.period <= x else x, y, 0.0
    state.image[grain] = 0
    state.velocity[grain] = release.velocity
    if state.heat.size:
        state.heat[grain] = 0.0
    state.presence[grain] = Presence.THERE
    state.released[release.group] += (1.0, float(model.grains.mass[grain]))
    book_in(state, model, np.array([grain]))


def _forget_contacts(state: State, stayed: NDArray[np.bool_]) -> None:
    """Drop the contacts of grains that have gone."""
    kept = _among(state.contact_i, state.contact_j, stayed)
    if state.contact_couple.size:
        state.contact_couple = state.contact_couple[kept]
    state.contact_i, state.contact_j = state.contact_i[kept], state.contact_j[kept]
    state.contact_impulse = state.contact_impulse[kept]
    kept = _among(state.mean_i, state.mean_j, stayed)
    state.mean_i, state.mean_j, state.mean_force = state.mean_i[kept], state.mean_j[kept], state.mean_force[kept]


def _among(first: NDArray[np.int32], second: NDArray[np.int32], chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which pairs are of chosen grains, or of one of them and a wall shape."""
    last = chosen.size - 1
    return np.asarray(chosen[first] & ((second > last) | chosen[np.minimum(second, last)]))
