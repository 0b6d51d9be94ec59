"""What the inside of a disc adds to the resistance of its contacts.

A disc that gains heat q through one arc and loses it evenly over its area has, for q uniform over
the arc and b ≪ a, the mean temperature of the arc above that of the disc

    R_0 q,   R_0 = [ln(a/b) + 13/8 − ln 2]/(π λ h),

and that of an arc at the angle φ

    R_φ q,   R_φ = [1/8 − ln(2 sin(φ/2))]/(π λ h)

(the Neumann function −ln(|x − e|/a) + r²/(4a²) − 1/8 over π λ h, averaged over the arc; e: the arc,
x: a point of the disc at the distance r from its center). A contact of interface conductance H = Bi
λ h between two discs then conducts

    H_eff = H/(1 + 2 Bi λ h R_0)

from mean to mean temperature. R_0 grows with the logarithm of a/b: in two dimensions a conductance
cannot be named without b.
"""

from __future__ import annotations

import numpy as np
from arrangement import Contact, Floats, start_values
from finite_elements import Disc, couple
from scipy import sparse
from scipy.sparse.linalg import spsolve


def own_resistance(half_width: float) -> float:
    """λ h R_0 of an arc of half-width b [radii], leading order in b."""
    return float((np.log(1.0 / half_width) + 1.625 - np.log(2.0)) / np.pi)


def mutual_resistance(angle: float) -> float:
    """λ h R_φ between arcs at an angle [rad]."""
    return float((0.125 - np.log(2.0 * np.sin(0.5 * angle))) / np.pi)


def effective_share(biot: float, half_width: float) -> float:
    """H_eff/H: conductance from mean to mean temperature over that of the interface."""
    return 1.0 / (1.0 + 2.0 * biot * own_resistance(half_width))


def measured_resistance(disc: Disc) -> float:
    """λ h R_0 of a meshed disc: unit heat through one arc, taken out evenly."""
    theta = _solve_floating(disc.stiffness, disc.arc_average(0) - disc.average)
    return float(disc.arc_average(0) @ theta - disc.average @ theta)


def measured_share(disc: Disc, biot: float) -> float:
    """H_eff/H of two meshed discs: heat put evenly into one and taken evenly out of the other."""
    _, conduction = couple(disc, [Contact(0, 1, 0)], 2, biot)
    load = np.concatenate([disc.average, -disc.average])
    return float(1.0 / (biot * (load @ _solve_floating(conduction, load))))


def _solve_floating(matrix: sparse.csr_array, load: Floats) -> Floats:
    """Solution of a pure Neumann problem (its constant is set by a first value of 0)."""
    free = sparse.csc_matrix(matrix)[1:, 1:]
    return np.concatenate([[0.0], np.asarray(spsolve(free, load[1:]))])


def solve_network(
    contacts: list[Contact], count: int, biot: float, half_width: float, times: Floats
) -> Floats:
    """θ of grains with one temperature each whose contacts feel each other: the flows through all
    arcs of a disc shift each arc's temperature by R_0 and R_φ, as if the inside were in a steady
    state at every moment.

    Args:
        contacts: Who touches whom.
        count: Number of grains.
        biot: Bi of the interfaces.
        half_width: b [radii].
        times: s = t H/C with the conductance H of the interfaces, shape ``(m,)``.

    Returns:
        θ, shape ``(m, count)``.
    """
    size = len(contacts)
    difference = np.zeros((size, count))  # θ_i − θ_j of each contact
    resistance = np.eye(size) / biot
    for k, contact in enumerate(contacts):
        difference[k, [contact.i, contact.j]] = 1.0, -1.0
        for m, other in enumerate(contacts):
            for grain in {contact.i, contact.j} & {other.i, other.j}:
                sign = _sign(contact, grain) * _sign(other, grain)
                turn = abs(_direction(contact, grain) - _direction(other, grain)) * np.pi / 3.0
                resistance[k, m] += sign * (
                    own_resistance(half_width) if turn == 0.0 else mutual_resistance(turn)
                )
    network = difference.T @ np.linalg.solve(resistance, difference) / biot
    rates, modes = np.linalg.eigh(0.5 * (network + network.T))
    return np.asarray((np.exp(-np.outer(times, rates)) * (modes.T @ start_values(count))) @ modes.T)


def _sign(contact: Contact, grain: int) -> float:
    """1 for the first grain of a contact, −1 for the second."""
    return 1.0 if grain == contact.i else -1.0


def _direction(contact: Contact, grain: int) -> int:
    return contact.direction if grain == contact.i else (contact.direction + 3) % 6
