"""Energy books: kinetic change = gravity work + wall work + load work − friction − impact − damping − correction.

Where grains come and go, plus what they bring with them, minus what they take along.
"""

from __future__ import annotations

import math

import numpy as np

from multicor_cli.arithmetic.sums import total
from multicor_cli.engine.contact.solve import Outcome
from multicor_cli.engine.energy import account
from multicor_cli.engine.motion.correction import Correction
from multicor_cli.engine.motion.walls import WallMotion
from multicor_cli.model.books import BOOK_NAMES, EXCHANGE_NAMES, TALLY_NAMES, WINDOW_NAMES
from multicor_cli.model.model import Model
from multicor_cli.model.state import State

_BOOK = {name: k for k, name in enumerate(BOOK_NAMES)}
_TALLY = {name: k for k, name in enumerate(TALLY_NAMES)}
_EXCHANGE = {name: k for k, name in enumerate(EXCHANGE_NAMES)}
_WINDOW = {name: k for k, name in enumerate(WINDOW_NAMES)}


SUMMED_SHARE = 2.0**-8
"""Share of the kinetic energy that an imbalance is compared with at least: what its sum is rounded by is far below 10⁻¹⁰ of it."""

ROUNDED_SHARE = 2.0**-14
"""The same for each step taken: a step rounds every velocity, by up to 2⁻⁵³ of it, perhaps always in the same direction."""


def open_books(state: State, model: Model, motion: WallMotion) -> None:
    """Open the books with the kinetic energy of the initial state; once more if that has changed before the first step."""
    grains = model.grains
    u, v, spin = state.velocity.T
    kinetic = total(0.5 * grains.mass * (u * u + v * v) + 0.5 * grains.inertia * (spin * spin))
    kinetic += motion.kinetic(state.wall_velocity)
    state.books[_BOOK["kinetic"]] = kinetic
    state.books[_BOOK["kinetic_start"]] = kinetic - _brought_in(state)


def switch_wall_kinetic(state: State, change: float) -> None:
    """Book the kinetic energy that appears when a moving wall changes between prescribed and driven as work of the wall."""
    state.books[_BOOK["kinetic"]] += change
    state.books[_BOOK["wall_work"]] += change
    state.books[_BOOK["terms"]] += 2.0 * abs(change)


def book_exchange(state: State, brought: float, taken: float) -> None:
    """Enter the kinetic energy that grains bring with them and take along [J] where the books are open."""
    state.exchange[_EXCHANGE["kinetic_in"]] += brought
    state.exchange[_EXCHANGE["kinetic_out"]] += taken
    state.books[_BOOK["kinetic"]] += brought - taken
    state.books[_BOOK["terms"]] += brought + taken


def _brought_in(state: State) -> float:
    """Kinetic energy that came with grains less what went with them [J]; 0 where none comes or goes."""
    if not state.exchange.size:
        return 0.0
    return float(state.exchange[_EXCHANGE["kinetic_in"]] - state.exchange[_EXCHANGE["kinetic_out"]])


def book_step(
    state: State,
    motion: WallMotion,
    sums: account.ContactSums,
    kinetic: float,
    gravity_work: float,
    correction: Correction,
    outcome: Outcome,
    dt: float,
) -> None:
    """Enter one step into the books, the tallies and the window of the time series.

    Args:
        state: **Modified**; its wall velocities are those after the step.
        motion: Drives of the step.
        sums: Losses, virial and wall impulses of the contacts.
        kinetic: Kinetic energy of the grains after the step [J].
        gravity_work: Work of gravity on the grains, correction left out [J].
        correction: What the position correction did.
        outcome: What the solver did.
        dt: Time step [s].
    """
    mean = 0.5 * (motion.before + state.wall_velocity)
    driven = motion.driven
    wall_work = -total(np.where(driven, 0.0, sums.wall_impulse * mean))
    wall_work -= total(sums.belt_impulse * (0.5 * (motion.belt_before + motion.belt)))
    load_work = motion.load_work(mean, dt) + correction.load_work
    damping = dt * total(motion.damping * mean * mean)
    gravity = gravity_work + dt * total(motion.weight * mean) + correction.gravity_work
    moved = correction.gravity_work + correction.load_work
    friction, impact = float(sums.total[account.FRICTION]), float(sums.total[account.IMPACT])
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
    books[_BOOK["friction_sliding"]] += sums.total[account.SLIDING]
    books[_BOOK["negative_loss"]] += sums.total[account.NEGATIVE]
    books[_BOOK["terms"]] += abs(change) + math.fsum(abs(value) for value in entries.values())
    _close(state)
    _tally(state, sums, correction, outcome, dt)
    _add_to_window(state, sums, outcome, dt)


def _close(state: State) -> None:
    """Strike the balance.

    An imbalance is compared with the terms; where little has worked on the grains, with a share of their energy (theory §8).
    """
    books = state.books
    works = books[_BOOK["gravity_work"]] + books[_BOOK["wall_work"]] + books[_BOOK["load_work"]]
    losses = books[_BOOK["friction_loss"]] + books[_BOOK["impact_loss"]] + books[_BOOK["damping_loss"]]
    gain = books[_BOOK["kinetic"]] - books[_BOOK["kinetic_start"]]
    imbalance = gain - (works - losses - books[_BOOK["correction_work"]]) - _brought_in(state)
    books[_BOOK["imbalance"]] = imbalance
    kinetic, steps = max(float(books[_BOOK["kinetic"]]), float(books[_BOOK["kinetic_start"]])), state.step + 1
    scale = max(float(books[_BOOK["terms"]]), SUMMED_SHARE * kinetic, ROUNDED_SHARE * steps * float(books[_BOOK["kinetic"]]))
    if scale > 0.0:
        books[_BOOK["closure"]] = max(books[_BOOK["closure"]], abs(imbalance) / scale)


def _tally(state: State, sums: account.ContactSums, correction: Correction, outcome: Outcome, dt: float) -> None:
    tallies = state.tallies
    tallies[_TALLY["sweeps"]] += outcome.sweeps
    tallies[_TALLY["unconverged_steps"]] += not outcome.converged
    tallies[_TALLY["corrected_steps"]] += correction.rounds > 0
    for name, value in (
        ("residual_rms_max", outcome.rms),
        ("residual_max_max", outcome.maximum),
        ("max_overlap", correction.overlap),
        ("max_impulse_rate", float(sums.total[account.LARGEST]) / dt),
    ):
        tallies[_TALLY[name]] = max(tallies[_TALLY[name]], value)


def _add_to_window(state: State, sums: account.ContactSums, outcome: Outcome, dt: float) -> None:
    window = state.window
    window[_WINDOW["duration"]] += dt
    window[_WINDOW["steps"]] += 1.0
    window[_WINDOW["sweeps"]] += outcome.sweeps
    window[_WINDOW["unconverged"]] += not outcome.converged
    window[_WINDOW["contacts"]] += sums.total[account.LOADED]
    for name, value in (
        ("residual_rms", outcome.rms),
        ("residual_max", outcome.maximum),
        ("residual_energy", outcome.energy),
    ):
        window[_WINDOW[name]] = max(window[_WINDOW[name]], value)
    first = _WINDOW["virial_xx"]
    window[first : first + 4] += sums.total[account.VIRIAL : account.VIRIAL + 4]
    state.window_wall_impulse += sums.wall_impulse
