"""Grains that expand with temperature or shrink as they wear, and what that does to contacts.

Formula: `a = a_0 [1 + α (T − T_0)]` with the temperature T_0 at the start of the run. A body that
grows at ȧ pushes what touches it: with g = ȧ_i + ȧ_j Signorini's condition of a closed contact is
u_n − g ≥ 0 ⟂ p_n ≥ 0, and the work of its growth is Σ p_n g.

Mass and angular momentum stay: a grain that grows turns more slowly. Where grains shrink, gaps
open, and what presses on them closes these. Walls keep their shapes.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import numpy as np

from multicor_cli.arithmetic import cbrt
from multicor_cli.engine.contact.contacts import Contacts, Speeds
from multicor_cli.engine.contact.faces import FacePairs
from multicor_cli.engine.contact.ordering import Schedule
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import BIAS, NORMAL, SPIN, X, Y
from multicor_cli.model.model import Floats, Ints


class Lanes(NamedTuple):
    """What growth looks at of a `Schedule`."""

    slot: Ints
    of_walls: Ints
    frame: Floats
    impulse: Floats
    before: Floats
    gap: Floats

    @classmethod
    def of(cls, schedule: Schedule) -> Lanes:
        return cls(*(getattr(schedule, name) for name in cls._fields))


MOST = 1e-4
"""Largest growth in a step, over the radius: what has warmed while nothing moved, as in a frozen
stage, takes some steps."""


@kernel
def grow(
    initial: Floats, rise: Floats, before: Floats, radius: Floats, dt: float, rate: Floats
) -> None:
    """Radii in a step and their rates ȧ [m/s], into ``radius`` and ``rate`` (both **modified**).

    ``rise`` is α (T − T_0), ``before`` the radius in the last step [m]; all of shape ``(n,)``.
    """
    for k in range(radius.size):
        most = MOST * before[k]
        change = initial[k] * (1.0 + rise[k]) - before[k]
        change = min(max(change, -most), most)
        radius[k] = before[k] + change
        rate[k] = change / dt


@kernel
def worn_sizes(worn: Floats, dimension: float) -> Floats:
    """Radii of grains that have lost a part of their volume over those before, shape ``(n,)``.

    ``dimension`` is 3 of spheres, 2 of discs.
    """
    size: Floats = np.empty(worn.size)
    for k in range(worn.size):
        left = 1.0 - worn[k]
        size[k] = cbrt(left) if dimension > 2.0 else np.sqrt(left)
    return size


@kernel
def shed(
    velocity: Floats, initial: Floats, worn: Floats, smaller: Floats, mass: Floats, radius: Floats,
    spin_radius: Floats, spin_factor: float,
) -> float:  # fmt: skip
    """Let what is worn off go, with the velocity that it has at the surface of its grain.

    Velocities and spins stay. Masses become ``initial`` [kg] less the part ``worn``, radii those
    before times ``smaller``. ``spin_radius`` is σ before [m], ``spin_factor`` m σ²/I. **Modifies**
    ``mass`` and ``radius``; returns the kinetic energy that goes [J].
    """
    lost = 0.0
    for k in range(mass.size):
        vx, vy, spin = velocity[k, X], velocity[k, Y], velocity[k, SPIN]
        now, about = initial[k] * (1.0 - worn[k]), spin_radius[k]
        turning = mass[k] * about * about - now * (about * smaller[k]) * (about * smaller[k])
        lost += 0.5 * ((mass[k] - now) * (vx * vx + vy * vy) + turning / spin_factor * spin * spin)
        mass[k], radius[k] = now, radius[k] * smaller[k]
    return lost


@kernel
def turn_slower(
    velocity: Floats, mass: Floats, before: Floats, radius: Floats, spin_radius: Floats,
    spin_factor: float,
) -> tuple[Floats, float]:  # fmt: skip
    """Velocities of the grains with spins ω (a⁻/a)², and the kinetic energy that they gain [J].

    ``spin_radius`` is σ with the new radii [m], ``spin_factor`` m σ²/I.
    """
    found, gained = velocity.copy(), 0.0
    for k in range(radius.size):
        about = before[k] * (spin_radius[k] / radius[k])
        ratio, speed = before[k] / radius[k], about * velocity[k, SPIN]
        found[k, SPIN] = ratio * ratio * velocity[k, SPIN]
        gained += 0.5 * mass[k] * (speed * speed) * (ratio * ratio - 1.0) / spin_factor
    return found, gained


@kernel
def push(rate: Floats, dt: float, i: Ints, j: Ints, lanes: Lanes, contacts: Contacts) -> Speeds:
    """Let closed contacts open at the rates at which their grains grow, ``rate`` [m/s].

    Losses of all that touch are then those of u_n − g: their mean over the step is taken from
    u⁻ − 2g. Of two grains in their lanes, of walls in the table. **Modifies** biases and u⁻ there.

    Returns the sum of g² and the number of those that open, as if they closed as fast: residuals
    are measured against that where nothing else moves.
    """
    squares, opening = 0.0, 0.0
    for q in range(lanes.slot.shape[0]):
        for lane in range(LANES):
            growth = _growth_in(rate, dt, i, j, lanes, q, lane)
            rise = max(growth, 0.0)
            lanes.frame[q, BIAS, lane] -= rise
            squares += rise * rise
            opening += rise > 0.0
            lanes.before[q, NORMAL, lane] -= 2.0 * growth
    for c in lanes.of_walls:
        growth = _growth_at(rate[i[c]], contacts[c].gap, dt)
        rise = max(growth, 0.0)
        contacts[c].bias -= rise
        squares += rise * rise
        opening += rise > 0.0
        contacts[c].u_n -= 2.0 * growth
    return Speeds(squares, opening, 0.0, 0.0, 0.0, 0.0)


@kernel
def work_of_growth(
    rate: Floats, dt: float, i: Ints, j: Ints, lanes: Lanes, contacts: Contacts
) -> float:
    """Work of the growth of the grains on their contacts Σ p_n g [J]; arguments as `push`.

    Impulses are q_n = p_n + F Δt where grains adhere (theory §3.1).
    """
    work = 0.0
    for q in range(lanes.slot.shape[0]):
        for lane in range(LANES):
            growth = _growth_in(rate, dt, i, j, lanes, q, lane)
            if growth != 0.0:
                attraction = contacts[lanes.slot[q, lane]].attraction
                work += (lanes.impulse[q, NORMAL, lane] - attraction) * growth
    for c in lanes.of_walls:
        p_n = contacts[c].p_n - contacts[c].attraction
        work += p_n * _growth_at(rate[i[c]], contacts[c].gap, dt)
    return work


# ---- At the points of grains that are no discs: there an outline moves with ȧ/a times its distance
# from the center, straight along the normal. That it moves along the other, too, is left out.


@kernel
def push_points(
    rate: Floats, radius: Floats, spin_radius: Floats, dt: float, faces: FacePairs,
    contacts: Contacts,
) -> Speeds:  # fmt: skip
    """As `push`, of points; ``radius`` of the grains, and σ [m]."""
    squares, opening = 0.0, 0.0
    for f in range(faces.first.size):
        for c in range(faces.first[f], faces.first[f] + faces.room[f]):
            if contacts[c].gap < inf:
                growth = _growth_of(rate, radius, spin_radius, dt, c, contacts)
                rise = max(growth, 0.0)
                contacts[c].bias -= rise
                squares += rise * rise
                opening += rise > 0.0
                contacts[c].u_n -= 2.0 * growth
    return Speeds(squares, opening, 0.0, 0.0, 0.0, 0.0)


@kernel
def work_at_points(
    rate: Floats, radius: Floats, spin_radius: Floats, dt: float, faces: FacePairs,
    contacts: Contacts,
) -> float:  # fmt: skip
    """As `work_of_growth`, of points; arguments as `push_points`."""
    work = 0.0
    for f in range(faces.first.size):
        for c in range(faces.first[f], faces.first[f] + faces.room[f]):
            if contacts[c].gap < inf:
                growth = _growth_of(rate, radius, spin_radius, dt, c, contacts)
                work += (contacts[c].p_n - contacts[c].attraction) * growth
    return work


@formula
def _growth_of(
    rate: Floats, radius: Floats, spin_radius: Floats, dt: float, c: int, contacts: Contacts
) -> float:
    """G of a point, as `_growth_at` [m/s]."""
    i, j = contacts[c].i, contacts[c].j
    growth = -rate[i] / radius[i] * (contacts[c].turn_it * spin_radius[i])
    if j < rate.size:
        growth += rate[j] / radius[j] * (contacts[c].turn_jt * spin_radius[j])
    return _growth_at(growth, contacts[c].gap, dt)


@formula
def _growth_in(rate: Floats, dt: float, i: Ints, j: Ints, lanes: Lanes, q: int, lane: int) -> float:
    """G of two grains in a lane if they touch [m/s]; else 0."""
    c = lanes.slot[q, lane]
    if c < 0 or j[c] >= rate.size:
        return 0.0
    return _growth_at(rate[i[c]] + rate[j[c]], lanes.gap[q, lane], dt)


@formula
def _growth_at(growth: float, gap: float, dt: float) -> float:
    """G of a contact with this gap at q_m if it is closed, but for what shrank in two steps."""
    return growth if gap <= max(0.0, -2.0 * growth * dt) else 0.0
