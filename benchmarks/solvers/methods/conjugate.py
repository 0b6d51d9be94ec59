"""The conjugate projected gradient method after Renouf & Alart (Comput. Methods Appl. Mech. Engrg.
194, 2005), preconditioned.

Unknowns are the impulses. Each iteration takes an exact step of the quadratic energy along a
direction conjugate to the last one in the constraints that are active, then cuts the impulses to
the cone, whose opening is that of the normal impulses of the moment. Theirs takes a contact to
slide if its impulse lies on the cone; here it does if the step of steepest descent leaves the cone.
"""

from __future__ import annotations

import numpy as np

from methods.operators import (
    Log,
    all_impulses,
    contact_scales,
    cut_to_cone,
    gather_velocities,
    kernel,
    record,
    set_impulses,
    spread_impulses,
)
from multicor_cli.engine.contact.sweep import System
from multicor_cli.model.columns import INVERSE_MASS
from multicor_cli.model.model import Floats


@kernel
def _cut(impulse: Floats, scales: Floats) -> None:
    for c in range(impulse.shape[0]):
        impulse[c, 0], impulse[c, 1] = cut_to_cone(impulse[c, 0], impulse[c, 1], scales[c, 2])


@kernel
def _choose_directions(
    impulse: Floats, scales: Floats, gradient: Floats, steepest: Floats, direction: Floats
) -> None:
    """The preconditioned step of steepest descent, cut to the cone; the last direction is freed of
    what the cone does not allow.

    What slides goes to its cone and no farther: its tangential gradient stays large and would spoil
    the length of the step.
    """
    for c in range(gradient.shape[0]):
        p_n, p_t, mu = impulse[c, 0], impulse[c, 1], scales[c, 2]
        next_n, next_t = p_n - gradient[c, 0] * scales[c, 0], p_t - gradient[c, 1] * scales[c, 1]
        new_n, new_t = cut_to_cone(next_n, next_t, mu)
        steepest[c, 0], steepest[c, 1] = new_n - p_n, new_t - p_t
        if new_n != next_n:
            direction[c, 0] = 0.0
        if new_t != next_t:
            direction[c, 1] = 0.0


@kernel
def run_conjugate(s: System, iterations: int, parameters: Floats, log: Log) -> int:
    """The iteration; no parameters. Two products with the operator each: counted as two sweeps."""
    scales, impulse = contact_scales(s), all_impulses(s)
    gradient, image = np.empty_like(impulse), np.zeros_like(impulse)
    steepest, direction = np.empty_like(impulse), np.zeros_like(impulse)
    velocity = s.velocity.copy()
    curvature = 0.0
    for number in range(iterations):
        gather_velocities(s, s.velocity, True, gradient)
        _choose_directions(impulse, scales, gradient, steepest, direction)
        factor = -np.sum(steepest * image) / curvature if curvature > 0.0 else 0.0
        direction = steepest + factor * direction
        velocity[:, :INVERSE_MASS] = 0.0
        spread_impulses(s, direction, velocity)
        gather_velocities(s, velocity, False, image)
        curvature = np.sum(direction * image)
        if curvature > 0.0:
            impulse += -np.sum(gradient * direction) / curvature * direction
        _cut(impulse, scales)
        set_impulses(s, impulse)
        if record(s, log, number, 2.0 * (number + 1)):
            return number + 1
    return iterations
