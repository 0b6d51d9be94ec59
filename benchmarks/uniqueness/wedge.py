"""Two solutions by hand: a disc between two walls that open like a wedge, and moves out of it.

The walls touch the disc at (−s, ±c), s = 7/25, c = 24/25; their normals point to the disc. It moves
along x at the speed 1, away from both. That it goes on, with no impulse, is a solution. That it
stops is another: impulses p_n at both contacts and p_t = κ p_n against the motion stop it if 2 p_n
(κ c − s) = 1, which the cone allows for s/c < κ ≤ μ. Everything is a fraction, so both are checked
without rounding.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from multicor_cli.engine import ContactProblem

S, C = Fraction(7, 25), Fraction(24, 25)
FRICTION = Fraction(1, 2)
NORMALS = ((S, -C), (S, C))
"""Upper and lower contact; mass and radius are 1, the moment of inertia is 1/2."""

Pair = tuple[Fraction, Fraction]
ZERO = Fraction(0)
CHANGEABLE: tuple[Pair, Pair] = ((ZERO, ZERO), (ZERO, ZERO))


def holding(share: Fraction) -> tuple[Pair, Pair]:
    """Impulses (p_n, p_t) of both contacts that stop the disc, with |p_t| = ``share`` p_n."""
    normal = 1 / (2 * (share * C - S))
    return (normal, -share * normal), (normal, share * normal)


def velocity_after(impulses: tuple[Pair, Pair]) -> tuple[Fraction, Fraction, Fraction]:
    """v_x, v_y and ω of the disc after the impulses."""
    vx, vy, spin = Fraction(1), ZERO, ZERO
    for (nx, ny), (p_n, p_t) in zip(NORMALS, impulses, strict=True):
        vx += p_n * nx - p_t * ny
        vy += p_n * ny + p_t * nx
        spin -= 2 * p_t  # the lever is −n: (−n) × (p_t t) = −p_t, over I = 1/2
    return vx, vy, spin


def is_solution(impulses: tuple[Pair, Pair], friction: Fraction = FRICTION) -> bool:
    """Whether the impulses solve the problem, without rounding."""
    vx, vy, spin = velocity_after(impulses)
    for (nx, ny), (p_n, p_t) in zip(NORMALS, impulses, strict=True):
        u_n, u_t = vx * nx + vy * ny, vy * nx - vx * ny - spin
        if min(u_n, p_n) < 0 or u_n * p_n != 0 or abs(p_t) > friction * p_n:
            return False
        if u_t != 0 and (abs(p_t) < friction * p_n or p_t * u_t > 0):
            return False
    return True


def as_problem(friction: Fraction = FRICTION) -> ContactProblem:
    """The same as the program sees it; body 1 is the walls."""
    normal = np.array(NORMALS, np.float64)
    lever = np.stack([-normal, np.zeros((2, 2))], axis=1)
    inverse = np.array([[1.0, 1.0, 2.0], [0.0, 0.0, 0.0]])
    velocity = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    pair = np.array([[0, 1], [0, 1]], np.int32)
    return ContactProblem(
        inverse, velocity, pair, normal, lever, np.zeros(2), np.full(2, float(friction))
    )
