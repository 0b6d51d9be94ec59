"""Accelerated projected gradient descent, after Mazhar, Heyn, Negrut & Tasora (ACM Trans. Graph.
34, 2015, 32), preconditioned.

Nesterov's method on the impulses, with a step found by backtracking and a restart when the step
points uphill. Theirs solves a convexified problem, in which sliding contacts dilate; here impulses
are cut to Coulomb's cone along the tangent, so that the solution is that of all other methods.
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

_TRIES = 20


@kernel
def _step(ahead: Floats, gradient: Floats, scales: Floats, size: float, new: Floats) -> None:
    for c in range(ahead.shape[0]):
        p_n = ahead[c, 0] - size * scales[c, 0] * gradient[c, 0]
        p_t = ahead[c, 1] - size * scales[c, 1] * gradient[c, 1]
        new[c, 0], new[c, 1] = cut_to_cone(p_n, p_t, scales[c, 2])


@kernel
def _products(change: Floats, image: Floats, scales: Floats) -> tuple[float, float]:
    """Δᵀ W Δ, and Δᵀ D Δ with the diagonal D of W."""
    full, diagonal = 0.0, 0.0
    for c in range(change.shape[0]):
        for d in range(2):
            full += change[c, d] * image[c, d]
            diagonal += change[c, d] * change[c, d] / scales[c, d]
    return full, diagonal


@kernel
def run_gradient(s: System, iterations: int, parameters: Floats, log: Log) -> int:
    """The iteration; no parameters. A sweep is counted for each product with the operator, more
    than one to backtrack.
    """
    scales, last = contact_scales(s), all_impulses(s)
    ahead, new = last.copy(), np.empty_like(last)
    gradient, image, ahead_gradient = np.empty_like(last), np.empty_like(last), np.empty_like(last)
    velocity = s.velocity.copy()
    gather_velocities(s, s.velocity, True, gradient)
    ahead_gradient[:] = gradient
    size, theta, work = 1.0, 1.0, 0.0
    for number in range(iterations):
        for _ in range(_TRIES):
            _step(ahead, ahead_gradient, scales, size, new)
            velocity[:, :INVERSE_MASS] = 0.0
            change = new - ahead
            spread_impulses(s, change, velocity)
            gather_velocities(s, velocity, False, image)
            work += 1.0
            full, diagonal = _products(change, image, scales)
            if full * size <= diagonal:
                break
            size *= 0.7
        # The gradient is linear: that of the new iterate needs no product of its own.
        new_gradient = ahead_gradient + image
        following = 0.5 * theta * (np.sqrt(theta * theta + 4.0) - theta)
        factor = theta * (1.0 - theta) / (theta * theta + following)
        theta = following
        if np.sum(ahead_gradient * (new - last)) > 0.0:
            theta, factor = 1.0, 0.0
        ahead = new + factor * (new - last)
        ahead_gradient = new_gradient + factor * (new_gradient - gradient)
        last[:] = new
        gradient[:] = new_gradient
        size *= 1.02
        if log.rows.shape[0] > 0:
            set_impulses(s, new)
        if record(s, log, number, work):
            return number + 1
    set_impulses(s, last)
    return iterations
