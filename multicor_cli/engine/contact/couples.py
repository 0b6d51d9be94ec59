"""The couples of rolling resistance in the sweep: each is one more unknown, relaxed after all contacts (theory §3.2).

In velocity units a couple is friction on the rolling velocity u_r = a* (ω_i − ω_j): |p_r| ≤ μ_r q_n, where p_r is the impulse of
the couple over a*. It acts on spins alone and takes its bound from the normal impulse of its contact, so neither the contacts nor
their vectors know of it. Couples are relaxed serially, in the order of their contacts; one takes some three times as long as a
light contact, which is one of four in a vector (14 and 5 ns in a bed of 18,000 contacts).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.jit.compile import loop_body
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import FIRST, NORMAL, SECOND, SPIN, SURFACE
from multicor_cli.model.model import Floats, Ints


class Couples(NamedTuple):
    """The couples of a `System`, ``k`` rows; arrays without rows where there is no rolling resistance.

    Attributes:
        contact: Contact behind each, shape ``(k,)``.
        place: Where its normal impulse is: in the flat ``impulse`` of the system, or -1 - g for the general contact g,
            shape ``(k,)``.
        body: Rows of its bodies, shape ``(k, 2)``.
        arm: What the third velocities of both bodies count in u_r: a*/a for grains, a* [m] for walls, shape ``(k, 2)``.
        limit: μ_r, shape ``(k,)``.
        inverse: 1/W_rr [kg], shape ``(k,)``.
        impulse: p_r [N s], shape ``(k,)``. **Modified by sweeps.**
        turning: What the running surface of a wall takes from u_r [m/s], shape ``(k,)``.
    """

    contact: Ints
    place: NDArray[np.int64]
    body: Ints
    arm: Floats
    limit: Floats
    inverse: Floats
    impulse: Floats
    turning: Floats


_NONE = np.empty(0)
NO_COUPLES = Couples(
    np.empty(0, np.int32), np.empty(0, np.int64), np.empty((0, 2), np.int32), np.empty((0, 2)), _NONE, _NONE, _NONE, _NONE
)  # fmt: skip


@formula
def solve_rolling(p_r: float, u_r: float, w_inverse: float, bound: float) -> float:
    """Exact p_r of one couple with all else held [N s]: stick, cut to ± ``bound`` = μ_r q_n (theory §3.2).

    Args:
        p_r: Impulse now [N s].
        u_r: Rolling velocity that goes with it [m/s].
        w_inverse: 1/W_rr [kg].
        bound: Largest impulse [N s].
    """
    return min(max(p_r - u_r * w_inverse, -bound), bound)


@loop_body
def _bound(k: int, couples: Couples, impulse: Floats, general_impulse: Floats) -> float:
    """μ_r q_n; ``impulse`` flat."""
    place = couples.place[k]
    q_n = impulse[place] if place >= 0 else general_impulse[-1 - place, NORMAL]
    return couples.limit[k] * q_n


@loop_body
def couple_velocity(k: int, couples: Couples, velocity: Floats) -> float:
    """u_r [m/s]; ``velocity`` as in `System`."""
    i, j = couples.body[k, FIRST], couples.body[k, SECOND]
    turning = couples.arm[k, FIRST] * velocity[i, SURFACE] - couples.arm[k, SECOND] * velocity[j, SURFACE]
    return turning - couples.turning[k]


@loop_body
def push_couple(k: int, d_r: float, couples: Couples, velocity: Floats, inverse: Floats) -> None:
    """Change the spins of the two bodies of a couple by an impulse. Arrays as in `System`."""
    i, j = couples.body[k, FIRST], couples.body[k, SECOND]
    velocity[i, SURFACE] += inverse[i, SPIN] * couples.arm[k, FIRST] * d_r
    velocity[j, SURFACE] -= inverse[j, SPIN] * couples.arm[k, SECOND] * d_r


@loop_body
def relax_couples(
    velocity: Floats, inverse: Floats, couples: Couples, impulse: Floats, general_impulse: Floats, before: Floats,
    extrapolation: float,
) -> float:  # fmt: skip
    """Relax all couples; returns the sum of the squares of the velocity corrections [m²/s²].

    Arrays as in `System`, the impulses of light contacts flat, and the last impulses of the couples, ``before``, from which they
    are extrapolated first.
    """
    total = 0.0
    for k in range(couples.impulse.size):
        now = couples.impulse[k]
        p_r = now + extrapolation * (now - before[k])
        bound = _bound(k, couples, impulse, general_impulse)
        new = solve_rolling(p_r, couple_velocity(k, couples, velocity), couples.inverse[k], bound)
        couples.impulse[k], before[k] = new, now
        push_couple(k, new - p_r, couples, velocity, inverse)
        correction = (new - p_r) / couples.inverse[k]
        total += correction * correction
    return total


@loop_body
def couple_square(k: int, couples: Couples, velocity: Floats, impulse: Floats, general_impulse: Floats) -> float:
    """Square of e_r of one couple [m²/s²], arguments as `relax_couples`."""
    p_r, bound = couples.impulse[k], _bound(k, couples, impulse, general_impulse)
    correction = (solve_rolling(p_r, couple_velocity(k, couples, velocity), couples.inverse[k], bound) - p_r) / couples.inverse[k]
    return correction * correction


@loop_body
def measure_couples(
    velocity: Floats, couples: Couples, impulse: Floats, general_impulse: Floats
) -> tuple[float, float, float, float]:
    """Residuals of the couples, arguments as `relax_couples`.

    Returns the sum of the squares of their velocity corrections e_r and the largest of them [m²/s²], the sum of the powers p_r e_r
    [J], and the number of couples with p_r ≠ 0 or e_r ≠ 0.
    """
    squares, largest, power, active = 0.0, 0.0, 0.0, 0.0
    for k in range(couples.impulse.size):
        p_r = couples.impulse[k]
        bound = _bound(k, couples, impulse, general_impulse)
        new = solve_rolling(p_r, couple_velocity(k, couples, velocity), couples.inverse[k], bound)
        correction = (new - p_r) / couples.inverse[k]
        squares += correction * correction
        largest = max(largest, correction * correction)
        power += p_r * correction
        active += 1.0 if p_r != 0.0 or correction != 0.0 else 0.0
    return squares, largest, power, active
