"""The energy books, and what contacts add to them in a step: losses, and impulses on walls."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic.sums import total
from multicor_cli.engine.contact.contacts import Contacts, contact_after
from multicor_cli.engine.contact.faces import FacePairs
from multicor_cli.engine.contact.law import GRAZE
from multicor_cli.engine.contact.rolling import rolling_loss
from multicor_cli.engine.contact.solve import Outcome
from multicor_cli.engine.contact.vector_step import (
    FRICTION,
    IMPACT,
    LARGEST,
    LOADED,
    NEGATIVE,
    OVERLAP,
    SLIDING,
    SUMS,
    VIRIAL,
    end_lanes,
)
from multicor_cli.engine.geometry.outlines import circle_gap, gap_at_least, true_gap
from multicor_cli.engine.geometry.pieces import Pieces, are_convex
from multicor_cli.engine.geometry.radii import smaller_of, surface_turning
from multicor_cli.engine.geometry.scene import Scene, pair_geometry
from multicor_cli.engine.jit.compile import inlined, kernel, parallel_kernel, prange, subroutine
from multicor_cli.engine.jit.vectors import BATCHES
from multicor_cli.engine.motion.correction import Correction
from multicor_cli.engine.motion.walls import WallMotion
from multicor_cli.model.books import BOOK_NAMES, EXCHANGE_NAMES, TALLY_NAMES, WINDOW_NAMES
from multicor_cli.model.columns import SPIN, X, Y
from multicor_cli.model.model import Floats, Ints, Model
from multicor_cli.model.state import State

# ---- The contacts of one step


class ContactSums(NamedTuple):
    """Result of `account_contacts`.

    Attributes:
        total: Sums over the contacts, and largest values, shape ``(SUMS,)`` of `vector_step`.
        wall_impulse: Impulse and angular impulse on the walls, shape ``(w, 3)``.
        belt_impulse: What the surface of each wall takes up along it, conjugate to its speed
            `BELT`: −Σ (p_t + κ C) with the curvature κ of the surface and the couple C on the grain
            [N s], shape ``(w,)``.
        adhesion_work: Work of adhesion on the motion [J].
    """

    total: Floats
    wall_impulse: Floats
    belt_impulse: Floats
    adhesion_work: float


@parallel_kernel
def account_grains(
    middle: Floats, velocity: Floats, pair: Ints, about: Floats, frame: Floats, impulse: Floats,
    before: Floats, gap: Floats, branch: Floats, depth: Floats, dt: float, period: float, xx: float,
    yy: float, xy: float,
) -> Floats:  # fmt: skip
    """What the contacts of two grains add to `SUMS`; arrays of `Schedule`, v⁺ in ``velocity``.

    In a cell (xx, yy, xy) is its gradient at the end of the step. **Modifies** ``depth``.
    """
    batches, half = pair.shape[0], 0.5 * period if period > 0.0 else np.inf
    sums = np.zeros(((batches + BATCHES - 1) // BATCHES, SUMS))
    for chunk in prange(sums.shape[0]):
        last = min(batches, (chunk + 1) * BATCHES)
        (
            sums[chunk, 0], sums[chunk, 1], sums[chunk, 2], sums[chunk, 3], sums[chunk, 4],
            sums[chunk, 5], sums[chunk, 6], sums[chunk, 7], sums[chunk, 8], sums[chunk, 9],
            sums[chunk, 10],
        ) = end_lanes(
            chunk * BATCHES, last, middle.reshape(-1), velocity.reshape(-1), pair.reshape(-1),
            about.reshape(-1), frame.reshape(-1), impulse.reshape(-1), before.reshape(-1),
            gap.reshape(-1), 0.5 * dt, period, half, branch.reshape(-1), xx, yy, xy,
            depth.reshape(-1),
        )  # fmt: skip
    total = np.zeros(SUMS)
    for chunk in range(sums.shape[0]):
        for k in range(SUMS):
            value = sums[chunk, k]
            total[k] = max(total[k], value) if k >= LARGEST else total[k] + value
    return total


@inlined
def _account(
    c: int, scene: Scene, contacts: Contacts, after: Floats, total: Floats, wall_impulse: Floats,
    belt_impulse: Floats,
) -> float:  # fmt: skip
    """Enter a contact into the last three, **modified**; returns the work of adhesion [J]."""
    contact = contacts[c]
    q_n, p_t, attraction = contact.p_n, contact.p_t, contact.attraction
    if q_n == 0.0 and attraction == 0.0:
        return 0.0
    j, nx, ny, lx, ly = contact.j, contact.nx, contact.ny, contact.lever_x, contact.lever_y
    p_n, is_point = q_n - attraction, contact.key >= 0
    u_n, u_t = contact_after(c, scene, contacts, after)
    impact, friction = -q_n * 0.5 * (contact.u_n + u_n), -p_t * 0.5 * (contact.u_t + u_t)
    friction += 0.0 if is_point else rolling_loss(c, scene, contacts, after)
    total[FRICTION] += friction
    total[IMPACT] += impact
    total[SLIDING] += contact.mu * abs(u_t) * q_n
    total[NEGATIVE] += min(0.0, friction + impact)
    total[LOADED] += 1.0 if q_n > 0.0 else 0.0
    total[LARGEST] = max(total[LARGEST], p_n)
    px, py = p_n * nx - p_t * ny, p_n * ny + p_t * nx
    if j >= scene.radius.size:
        wall, couple = scene.wall[j - scene.radius.size], contact.arm * contact.p_r
        wall_impulse[wall, X] -= px
        wall_impulse[wall, Y] -= py
        wall_impulse[wall, SPIN] -= lx * py - ly * px + couple
        belt_impulse[wall] -= p_t
        if couple != 0.0:
            belt_impulse[wall] -= surface_turning(scene, j, 1.0) * couple
    elif is_point or scene.height > 0.0:
        total[VIRIAL] += px * lx
        total[VIRIAL + 1] += px * ly
        total[VIRIAL + 2] += py * lx
        total[VIRIAL + 3] += py * ly
    else:
        branch = scene.radius[contact.i] + scene.radius[j] + contact.gap
        total[VIRIAL] += px * branch * nx
        total[VIRIAL + 1] += px * branch * ny
        total[VIRIAL + 2] += py * branch * nx
        total[VIRIAL + 3] += py * branch * ny
    return -attraction * 0.5 * (contact.u_n + u_n)


@kernel
def account_contacts(
    scene: Scene, end: Scene, contacts: Contacts, after: Floats, which: Ints, total: Floats
) -> ContactSums:
    """Sum losses, virial and wall impulses over some contacts of a step, one after the other.

    The losses are −q·½(u⁻+u⁺), exact for the scheme whether or not the solver has converged
    (Moreau–Jean energy identity); couples count as friction. What adhesion does is a work, not a
    loss; impulses on walls, and the stress, are those that act, with it.

    ``scene`` is that at q_m, ``end`` that at q⁺; ``total``, what others add to `SUMS`, is
    **modified**.
    """
    walls = scene.wall_position.shape[0]
    wall_impulse, belt_impulse, attracted = np.zeros((walls, 3)), np.zeros(walls), 0.0
    for k in range(which.size):
        c = which[k]
        i, j = contacts[c].i, contacts[c].j
        gap = pair_geometry(end, i, j)[0]
        if gap < 0.0:
            total[OVERLAP] = max(total[OVERLAP], -gap / smaller_of(end, i, j))
        attracted += _account(c, scene, contacts, after, total, wall_impulse, belt_impulse)
    return ContactSums(total, wall_impulse, belt_impulse, attracted)


@kernel
def account_faces(
    scene: Scene, end: Scene, pieces_end: Pieces, contacts: Contacts, after: Floats,
    faces: FacePairs, total: Floats, wall_impulse: Floats, belt_impulse: Floats, overlaps: Floats,
) -> float:  # fmt: skip
    """As `account_contacts`, of faces; **modifies** what that returns, but for the work of adhesion
    [J], which is returned.

    And ``overlaps`` of pairs at the end of the step over their smaller radii, shape ``(f,)``: of
    all above `GRAZE`, and of the largest below it. Others need no look: no pair overlaps more than
    the circles around it, or, of a piece each, than over one of its edges.
    """
    attracted, deepest = 0.0, 0.0
    for f in range(faces.first.size):
        base, i, j = faces.first[f], faces.i[f], faces.j[f]
        size, overlaps[f] = smaller_of(end, i, j), 0.0
        least = circle_gap(end, i, j)
        if least < 0.0 and are_convex(pieces_end, i, j):
            least = gap_at_least(end, pieces_end, i, j)
        if least < -deepest * size:
            overlaps[f] = max(0.0, -true_gap(end, pieces_end, i, j)[0] / size)
            total[OVERLAP] = max(total[OVERLAP], overlaps[f])
            if overlaps[f] <= GRAZE:
                deepest = max(deepest, overlaps[f])
        for c in range(base, base + faces.room[f]):
            attracted += _account(c, scene, contacts, after, total, wall_impulse, belt_impulse)
    return attracted


# ---- Energy books: kinetic change = gravity + wall + load + adhesion work − friction − impact −
#      damping − correction, plus what grains that come bring, minus what those that go take along.

_EXCHANGE = {name: k for k, name in enumerate(EXCHANGE_NAMES)}

_KINETIC, _START, _GRAVITY, _WALL, _LOAD, _FRICTION, _IMPACT, _DAMPING, _CORRECTION = (
    BOOK_NAMES.index(name)
    for name in (
        "kinetic", "kinetic_start", "gravity_work", "wall_work", "load_work", "friction_loss",
        "impact_loss", "damping_loss", "correction_work",
    )
)  # fmt: skip
_FRICTION_SLIDING, _NEGATIVE_LOSS, _TERMS, _IMBALANCE, _CLOSURE = (
    BOOK_NAMES.index(name)
    for name in ("friction_sliding", "negative_loss", "terms", "imbalance", "closure")
)
_SWEEPS, _UNCONVERGED, _CORRECTED, _RMS, _MAXIMUM, _OVERLAP, _IMPULSE_RATE = (
    TALLY_NAMES.index(name)
    for name in (
        "sweeps", "unconverged_steps", "corrected_steps", "residual_rms_max", "residual_max_max",
        "max_overlap", "max_impulse_rate",
    )
)  # fmt: skip
_DURATION, _STEPS, _ROW_SWEEPS, _ROW_UNCONVERGED, _CONTACTS, _ROW_RMS, _ROW_MAXIMUM, _ROW_ENERGY = (
    WINDOW_NAMES.index(name)
    for name in (
        "duration", "steps", "sweeps", "unconverged", "contacts", "residual_rms", "residual_max",
        "residual_energy",
    )
)  # fmt: skip
_ROW_VIRIAL = WINDOW_NAMES.index("virial_xx")


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
    state.books[_KINETIC] = kinetic
    state.books[_START] = kinetic - _brought_in(state)


def switch_wall_kinetic(state: State, change: float) -> None:
    """Book as wall work the energy of walls that turn from prescribed to driven or back."""
    state.books[_KINETIC] += change
    state.books[_WALL] += change
    state.books[_TERMS] += 2.0 * abs(change)


def book_worn(state: State, lost: float) -> None:
    """Enter the kinetic energy that what is worn off takes along [J]."""
    state.growth_books[1] += lost
    state.books[_KINETIC] -= lost
    state.books[_TERMS] += lost


def book_exchange(state: State, brought: float, taken: float) -> None:
    """Enter the kinetic energy that grains bring and take along [J] where the books are open."""
    state.exchange[_EXCHANGE["kinetic_in"]] += brought
    state.exchange[_EXCHANGE["kinetic_out"]] += taken
    state.books[_KINETIC] += brought - taken
    state.books[_TERMS] += brought + taken


def _brought_in(state: State) -> float:
    """Kinetic energy that came with grains less what went with them [J]."""
    if not state.exchange.size:
        return 0.0
    return float(state.exchange[_EXCHANGE["kinetic_in"]] - state.exchange[_EXCHANGE["kinetic_out"]])


def book_step(
    state: State, motion: WallMotion, sums: ContactSums, kinetic: float, gravity_work: float,
    correction: Correction, outcome: Outcome, dt: float, expansion_work: float = 0.0,
) -> None:  # fmt: skip
    """Enter one step into the books, the tallies and the window of the time series.

    Wall velocities of ``state``, which is **modified**, and the ``kinetic`` energy of the
    grains [J] are those after the step. ``gravity_work`` [J] leaves out the correction.
    """
    gained = _enter_adhesion(state, sums)
    if state.growth_books.size:
        state.growth_books[0] += expansion_work
        state.books[_TERMS] += abs(expansion_work)
        gained += float(state.growth_books[0] - state.growth_books[1])
    _enter(
        state.books, state.tallies, state.window, state.window_wall_impulse, motion.before,
        state.wall_velocity, motion.driven, motion.mass, motion.load, motion.stiffness,
        motion.damping, motion.weight, motion.belt_before, motion.belt, sums.wall_impulse,
        sums.belt_impulse, sums.total, kinetic, gravity_work, correction, outcome, dt,
    )  # fmt: skip
    _close(state.books, _brought_in(state) + gained, state.step + 1)


def _enter_adhesion(state: State, sums: ContactSums) -> float:
    """Enter the work of adhesion in a step; returns that since the start [J].

    It counts as a loss to impacts in runs of file formats before 1.7, which have no book for it.
    """
    if state.adhesion_books.size:
        state.adhesion_books[0] += sums.adhesion_work
        state.books[_TERMS] += abs(sums.adhesion_work)
        return float(state.adhesion_books[0])
    sums.total[IMPACT] -= sums.adhesion_work
    return 0.0


@kernel
def _enter(
    books: Floats, tallies: Floats, window: Floats, window_wall_impulse: Floats, before: Floats,
    after: Floats, driven: NDArray[np.bool_], mass: Floats, load: Floats, stiffness: Floats,
    damping: Floats, weight: Floats, belt_before: Floats, belt: Floats, wall_impulse: Floats,
    belt_impulse: Floats, sums: Floats, kinetic: float, gravity: float, correction: Correction,
    outcome: Outcome, dt: float,
) -> None:  # fmt: skip
    """Enter energies, works and tallies; arrays of walls are those of `WallMotion`, ``(w, 3)``."""
    wall_work, load_work, lost = 0.0, 0.0, 0.0
    for w in range(before.shape[0]):
        for d in range(3):
            mean = 0.5 * (before[w, d] + after[w, d])
            if not driven[w, d]:
                wall_work -= wall_impulse[w, d] * mean
            load_work += dt * (load[w, d] - 0.5 * dt * stiffness[w, d] * mean) * mean
            lost += dt * damping[w, d] * mean * mean
            gravity += dt * weight[w, d] * mean
            kinetic += 0.5 * mass[w, d] * after[w, d] * after[w, d]
            window_wall_impulse[w, d] += wall_impulse[w, d]
        wall_work -= belt_impulse[w] * (0.5 * (belt_before[w] + belt[w]))
    gravity += correction.gravity_work
    load_work += correction.load_work
    moved = correction.gravity_work + correction.load_work
    friction, impact = sums[FRICTION], sums[IMPACT]
    terms = abs(kinetic - books[_KINETIC])
    books[_KINETIC] = kinetic
    books[_GRAVITY] += gravity
    books[_WALL] += wall_work
    books[_LOAD] += load_work
    books[_FRICTION] += friction
    books[_IMPACT] += impact
    books[_DAMPING] += lost
    books[_CORRECTION] += moved
    books[_FRICTION_SLIDING] += sums[SLIDING]
    books[_NEGATIVE_LOSS] += sums[NEGATIVE]
    for value in (gravity, wall_work, load_work, friction, impact, lost, moved):
        terms += abs(value)
    books[_TERMS] += terms
    _tally(tallies, window, sums, correction, outcome, dt)


@kernel
def _close(books: Floats, brought: float, steps: int) -> None:
    """Strike the balance: an imbalance over the terms, or a share of the energy (theory §8)."""
    works = books[_GRAVITY] + books[_WALL] + books[_LOAD]
    losses = books[_FRICTION] + books[_IMPACT] + books[_DAMPING]
    gain = books[_KINETIC] - books[_START]
    imbalance = gain - (works - losses - books[_CORRECTION]) - brought
    books[_IMBALANCE] = imbalance
    scale = max(
        books[_TERMS],
        SUMMED_SHARE * max(books[_KINETIC], books[_START]),
        ROUNDED_SHARE * steps * books[_KINETIC],
    )
    if scale > 0.0:
        books[_CLOSURE] = max(books[_CLOSURE], abs(imbalance) / scale)


@subroutine
def _tally(
    tallies: Floats, window: Floats, sums: Floats, correction: Correction, outcome: Outcome,
    dt: float,
) -> None:  # fmt: skip
    failed = 0.0 if outcome.converged else 1.0
    tallies[_SWEEPS] += outcome.sweeps
    tallies[_UNCONVERGED] += failed
    tallies[_CORRECTED] += 1.0 if correction.rounds > 0 else 0.0
    tallies[_RMS] = max(tallies[_RMS], outcome.rms)
    tallies[_MAXIMUM] = max(tallies[_MAXIMUM], outcome.maximum)
    tallies[_OVERLAP] = max(tallies[_OVERLAP], correction.overlap)
    tallies[_IMPULSE_RATE] = max(tallies[_IMPULSE_RATE], sums[LARGEST] / dt)
    window[_DURATION] += dt
    window[_STEPS] += 1.0
    window[_ROW_SWEEPS] += outcome.sweeps
    window[_ROW_UNCONVERGED] += failed
    window[_CONTACTS] += sums[LOADED]
    window[_ROW_RMS] = max(window[_ROW_RMS], outcome.rms)
    window[_ROW_MAXIMUM] = max(window[_ROW_MAXIMUM], outcome.maximum)
    window[_ROW_ENERGY] = max(window[_ROW_ENERGY], outcome.energy)
    for k in range(4):
        window[_ROW_VIRIAL + k] += sums[VIRIAL + k]
