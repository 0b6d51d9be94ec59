"""The energy books, and what contacts add to them in a step: losses, and impulses on walls."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from multicor_cli.arithmetic.sums import column_totals, total
from multicor_cli.engine.contact.contacts import (
    Contacts,
    contact_after,
    couples_of,
    rolling_loss,
)
from multicor_cli.engine.contact.solve import Outcome
from multicor_cli.engine.geometry.radii import surface_turning
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.jit.chunks import CHUNK, chunks_for
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.engine.motion.separation import Correction
from multicor_cli.engine.motion.walls import WallMotion
from multicor_cli.model.books import BOOK_NAMES, EXCHANGE_NAMES, TALLY_NAMES, WINDOW_NAMES
from multicor_cli.model.columns import NORMAL, SPIN, TANGENTIAL, X, Y
from multicor_cli.model.model import Floats, Ints, Model
from multicor_cli.model.state import State

# ---- The contacts of one step

FRICTION, IMPACT, SLIDING, NEGATIVE, VIRIAL, LARGEST, LOADED = 0, 1, 2, 3, 4, 8, 9
"""Columns of the sums: losses [J], virial (four columns, xx xy yx yy) [J s], largest p_n [N s],
number of loaded contacts."""

SUMS = 10
_ALONG = 3  # column of the impulses of walls, after x, y and spin


class ContactSums(NamedTuple):
    """Result of `account_contacts`.

    Attributes:
        total: Sums over the contacts, shape ``(SUMS,)``.
        wall_impulse: Impulse and angular impulse on the walls, shape ``(w, 3)``.
        belt_impulse: What the surface of each wall takes up along it, conjugate to its speed
            `BELT`: −Σ (p_t + κ C) with the curvature κ of the surface and the couple C on the grain
            [N s], shape ``(w,)``.
    """

    total: Floats
    wall_impulse: Floats
    belt_impulse: Floats


@formula
def _push_wall(
    c: int, scene: Scene, contacts: Contacts, px: float, py: float, chunk: int, wall_impulse: Floats
) -> None:
    contact = contacts[c]
    couple, wall = contact.arm * contact.p_r, scene.wall[contact.j - scene.radius.size]
    wall_impulse[chunk, wall, X] -= px
    wall_impulse[chunk, wall, Y] -= py
    wall_impulse[chunk, wall, SPIN] -= contact.lever_x * py - contact.lever_y * px + couple
    wall_impulse[chunk, wall, _ALONG] -= contact.p_t
    if couple != 0.0:
        wall_impulse[chunk, wall, _ALONG] -= surface_turning(scene, contact.j, 1.0) * couple


@formula
def _account_chunk(
    chunk: int,
    first: int,
    last: int,
    scene: Scene,
    contacts: Contacts,
    after: Floats,
    partial: Floats,
    wall_impulse: Floats,
) -> None:
    """Write sums over contacts ``first … last-1``; numbers, not elements, for twice the speed."""
    friction, impact, sliding, negative, largest, loaded = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    xx, xy, yx, yy = 0.0, 0.0, 0.0, 0.0
    for c in range(first, last):
        contact = contacts[c]
        q_n, p_t, attraction = contact.p_n, contact.p_t, contact.attraction
        if q_n == 0.0 and attraction == 0.0:
            continue
        p_n = q_n - attraction
        i, j, nx, ny = contact.i, contact.j, contact.nx, contact.ny
        u_n, u_t = contact_after(c, scene, contacts, after)
        impact_loss = -p_n * 0.5 * (contact.u_n + u_n)
        friction_loss = -p_t * 0.5 * (contact.u_t + u_t) + rolling_loss(c, scene, contacts, after)
        friction += friction_loss
        impact += impact_loss
        sliding += contact.mu * abs(u_t) * q_n
        negative += min(0.0, friction_loss + impact_loss)
        largest = max(largest, p_n)
        loaded += 1.0 if q_n > 0.0 else 0.0
        px, py = p_n * nx - p_t * ny, p_n * ny + p_t * nx
        if j < scene.radius.size:
            branch = scene.radius[i] + scene.radius[j] + contact.gap
            xx += px * branch * nx
            xy += px * branch * ny
            yx += py * branch * nx
            yy += py * branch * ny
        else:
            _push_wall(c, scene, contacts, px, py, chunk, wall_impulse)
    partial[chunk, FRICTION], partial[chunk, IMPACT] = friction, impact
    partial[chunk, SLIDING], partial[chunk, NEGATIVE] = sliding, negative
    partial[chunk, VIRIAL], partial[chunk, VIRIAL + 1] = xx, xy
    partial[chunk, VIRIAL + 2], partial[chunk, VIRIAL + 3] = yx, yy
    partial[chunk, LARGEST], partial[chunk, LOADED] = largest, loaded


@parallel_kernel
def _account_chunks(
    scene: Scene, contacts: Contacts, after: Floats, partial: Floats, wall_impulse: Floats
) -> None:
    for chunk in prange(partial.shape[0]):
        last = min(contacts.size, (chunk + 1) * CHUNK)
        _account_chunk(chunk, chunk * CHUNK, last, scene, contacts, after, partial, wall_impulse)


def account_contacts(scene: Scene, contacts: Contacts, after: Floats) -> ContactSums:
    """Sum losses, virial and wall impulses over the contacts of a step, in fixed chunks.

    The losses are −p·½(u⁻+u⁺), exact for the scheme whether or not the solver has converged
    (Moreau–Jean energy identity). p is what acts, adhesion taken off; couples count as friction.
    """
    partial = chunks_for(contacts.size, SUMS)
    partial_wall = np.zeros((len(partial), scene.wall_position.shape[0], 4))
    _account_chunks(scene, contacts, after, partial, partial_wall)
    total = column_totals(partial)
    total[LARGEST] = partial[:, LARGEST].max()
    of_walls = column_totals(partial_wall)
    return ContactSums(total, of_walls[:, :_ALONG].copy(), of_walls[:, _ALONG].copy())


def warm_start_of(contacts: Contacts, has_couples: bool) -> tuple[Ints, Ints, Floats, Floats]:
    """Shapes i, j, impulses [N s] and couples [N m s] of contacts that carry an impulse, in order.

    Couples are of size 0 without rolling resistance.
    """
    couple = couples_of(contacts)[contacts["p_n"] > 0.0] if has_couples else np.empty(0)
    return *_carrying(contacts), couple


@kernel
def _carrying(contacts: Contacts) -> tuple[Ints, Ints, Floats]:
    found = 0
    for c in range(contacts.size):
        if contacts[c].p_n > 0.0:
            found += 1
    i, j, impulse = np.empty(found, np.int32), np.empty(found, np.int32), np.empty((found, 2))
    k = 0
    for c in range(contacts.size):
        contact = contacts[c]
        if contact.p_n > 0.0:
            i[k], j[k] = contact.i, contact.j
            impulse[k, NORMAL], impulse[k, TANGENTIAL] = contact.p_n, contact.p_t
            k += 1
    return i, j, impulse


# ---- Energy books: kinetic change = gravity + wall + load work − friction − impact − damping −
#      correction, plus what grains that come bring, minus what those that go take along.

_BOOK = {name: k for k, name in enumerate(BOOK_NAMES)}
_TALLY = {name: k for k, name in enumerate(TALLY_NAMES)}
_EXCHANGE = {name: k for k, name in enumerate(EXCHANGE_NAMES)}
_WINDOW = {name: k for k, name in enumerate(WINDOW_NAMES)}


SUMMED_SHARE = 2.0**-8
"""Share of the kinetic energy that an imbalance is compared with at least: what its sum is rounded
by is far below 10⁻¹⁰ of it."""

ROUNDED_SHARE = 2.0**-14
"""The same for each step: it rounds a velocity by up to 2⁻⁵³ of it, perhaps always in one way."""


def open_books(state: State, model: Model, motion: WallMotion) -> None:
    """Open the books with the kinetic energy now; once more if it changes before the first step."""
    grains = model.grains
    u, v, spin = state.velocity.T
    kinetic = total(0.5 * grains.mass * (u * u + v * v) + 0.5 * grains.inertia * (spin * spin))
    kinetic += motion.kinetic(state.wall_velocity)
    state.books[_BOOK["kinetic"]] = kinetic
    state.books[_BOOK["kinetic_start"]] = kinetic - _brought_in(state)


def switch_wall_kinetic(state: State, change: float) -> None:
    """Book as wall work the energy of walls that turn from prescribed to driven or back."""
    state.books[_BOOK["kinetic"]] += change
    state.books[_BOOK["wall_work"]] += change
    state.books[_BOOK["terms"]] += 2.0 * abs(change)


def book_exchange(state: State, brought: float, taken: float) -> None:
    """Enter the kinetic energy that grains bring and take along [J] where the books are open."""
    state.exchange[_EXCHANGE["kinetic_in"]] += brought
    state.exchange[_EXCHANGE["kinetic_out"]] += taken
    state.books[_BOOK["kinetic"]] += brought - taken
    state.books[_BOOK["terms"]] += brought + taken


def _brought_in(state: State) -> float:
    """Kinetic energy that came with grains less what went with them [J]."""
    if not state.exchange.size:
        return 0.0
    return float(state.exchange[_EXCHANGE["kinetic_in"]] - state.exchange[_EXCHANGE["kinetic_out"]])


def book_step(
    state: State,
    motion: WallMotion,
    sums: ContactSums,
    kinetic: float,
    gravity_work: float,
    correction: Correction,
    outcome: Outcome,
    dt: float,
) -> None:
    """Enter one step into the books, the tallies and the window of the time series.

    Wall velocities of ``state``, which is **modified**, and the ``kinetic`` energy of the
    grains [J] are those after the step. ``gravity_work`` [J] leaves out the correction.
    """
    mean = 0.5 * (motion.before + state.wall_velocity)
    driven = motion.driven
    wall_work = -total(np.where(driven, 0.0, sums.wall_impulse * mean))
    wall_work -= total(sums.belt_impulse * (0.5 * (motion.belt_before + motion.belt)))
    load_work = motion.load_work(mean, dt) + correction.load_work
    damping = dt * total(motion.damping * mean * mean)
    gravity = gravity_work + dt * total(motion.weight * mean) + correction.gravity_work
    moved = correction.gravity_work + correction.load_work
    friction, impact = float(sums.total[FRICTION]), float(sums.total[IMPACT])
    kinetic += motion.kinetic(state.wall_velocity)
    books = state.books
    change = kinetic - books[_BOOK["kinetic"]]
    books[_BOOK["kinetic"]] = kinetic
    entries = {
        "gravity_work": gravity,
        "wall_work": wall_work,
        "load_work": load_work,
        "friction_loss": friction,
        "impact_loss": impact,
        "damping_loss": damping,
        "correction_work": moved,
    }
    for name, value in entries.items():
        books[_BOOK[name]] += value
    books[_BOOK["friction_sliding"]] += sums.total[SLIDING]
    books[_BOOK["negative_loss"]] += sums.total[NEGATIVE]
    books[_BOOK["terms"]] += abs(change) + math.fsum(abs(value) for value in entries.values())
    _close(state)
    _tally(state, sums, correction, outcome, dt)
    _add_to_window(state, sums, outcome, dt)


def _close(state: State) -> None:
    """Strike the balance: an imbalance over the terms, or a share of the energy (theory §8)."""
    books = state.books
    works = books[_BOOK["gravity_work"]] + books[_BOOK["wall_work"]] + books[_BOOK["load_work"]]
    losses = (
        books[_BOOK["friction_loss"]] + books[_BOOK["impact_loss"]] + books[_BOOK["damping_loss"]]
    )
    gain = books[_BOOK["kinetic"]] - books[_BOOK["kinetic_start"]]
    imbalance = gain - (works - losses - books[_BOOK["correction_work"]]) - _brought_in(state)
    books[_BOOK["imbalance"]] = imbalance
    kinetic, steps = (
        max(float(books[_BOOK["kinetic"]]), float(books[_BOOK["kinetic_start"]])),
        state.step + 1,
    )
    scale = max(
        float(books[_BOOK["terms"]]),
        SUMMED_SHARE * kinetic,
        ROUNDED_SHARE * steps * float(books[_BOOK["kinetic"]]),
    )
    if scale > 0.0:
        books[_BOOK["closure"]] = max(books[_BOOK["closure"]], abs(imbalance) / scale)


def _tally(
    state: State, sums: ContactSums, correction: Correction, outcome: Outcome, dt: float
) -> None:
    tallies = state.tallies
    tallies[_TALLY["sweeps"]] += outcome.sweeps
    tallies[_TALLY["unconverged_steps"]] += not outcome.converged
    tallies[_TALLY["corrected_steps"]] += correction.rounds > 0
    for name, value in (
        ("residual_rms_max", outcome.rms),
        ("residual_max_max", outcome.maximum),
        ("max_overlap", correction.overlap),
        ("max_impulse_rate", float(sums.total[LARGEST]) / dt),
    ):
        tallies[_TALLY[name]] = max(tallies[_TALLY[name]], value)


def _add_to_window(state: State, sums: ContactSums, outcome: Outcome, dt: float) -> None:
    window = state.window
    window[_WINDOW["duration"]] += dt
    window[_WINDOW["steps"]] += 1.0
    window[_WINDOW["sweeps"]] += outcome.sweeps
    window[_WINDOW["unconverged"]] += not outcome.converged
    window[_WINDOW["contacts"]] += sums.total[LOADED]
    for name, value in (
        ("residual_rms", outcome.rms),
        ("residual_max", outcome.maximum),
        ("residual_energy", outcome.energy),
    ):
        window[_WINDOW[name]] = max(window[_WINDOW[name]], value)
    first = _WINDOW["virial_xx"]
    window[first : first + 4] += sums.total[VIRIAL : VIRIAL + 4]
    state.window_wall_impulse += sums.wall_impulse
