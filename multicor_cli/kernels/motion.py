"""Prediction and motion of the grains: q_m = q + ½Δt v, free velocities, and q⁺ = q_m + ½Δt v⁺ (Moreau–Jean, θ = ½)."""

from __future__ import annotations

import numpy as np

from multicor_cli.kernels.jit import CHUNK, parallel_kernel, prange
from multicor_cli.state.model import Floats


@parallel_kernel
def predict(
    position: Floats,
    velocity: Floats,
    radius: Floats,
    mass: Floats,
    gravity: Floats,
    dt: float,
    middle: Floats,
    start: Floats,
    free: Floats,
    fastest: Floats,
) -> None:
    """Positions at mid-step and free velocities of the grains.

    Args:
        position: x, y [m], angle [rad], shape ``(n, 3)``.
        velocity: v_x, v_y [m/s], ω [rad/s], shape ``(n, 3)``.
        radius: Radii [m], shape ``(n,)``.
        mass: Masses [kg], shape ``(n,)``.
        gravity: Acceleration of gravity [m/s²], shape ``(2,)``.
        dt: Time step [s].
        middle: q_m, shape ``(n, 3)``. **Modified.**
        start: Bodies (v_x, v_y, a ω, 1/m) at the start of the step, shape ``(bodies, 4)``. **Grains modified.**
        free: The same with the free velocities. **Grains modified.**
        fastest: Largest speed in each chunk of grains, at the start or free [m/s]; ``nan`` if a number is not finite, shape
            ``(chunks, 1)``. **Modified.**
    """
    count = radius.size
    half = 0.5 * dt
    for chunk in prange(fastest.shape[0]):
        best = 0.0
        bad = False
        for i in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            for d in range(3):
                middle[i, d] = position[i, d] + half * velocity[i, d]
            vx, vy = velocity[i, 0], velocity[i, 1]
            start[i, 0], start[i, 1] = vx, vy
            start[i, 2], start[i, 3] = radius[i] * velocity[i, 2], 1.0 / mass[i]
            fx, fy = vx + dt * gravity[0], vy + dt * gravity[1]
            free[i, 0], free[i, 1], free[i, 2], free[i, 3] = fx, fy, start[i, 2], start[i, 3]
            square = max(vx * vx + vy * vy, fx * fx + fy * fy)
            if not np.isfinite(square + start[i, 2] + middle[i, 0] + middle[i, 1]):
                bad = True
            best = max(best, square)
        fastest[chunk, 0] = np.nan if bad else np.sqrt(best)


@parallel_kernel
def move(
    middle: Floats,
    start: Floats,
    after: Floats,
    radius: Floats,
    mass: Floats,
    gravity: Floats,
    spin_factor: float,
    dt: float,
    position: Floats,
    velocity: Floats,
    sums: Floats,
) -> None:
    """End of the step for the grains.

    Args:
        middle: q_m, shape ``(n, 3)``.
        start: Bodies (v_x, v_y, a ω, 1/m) at the start of the step.
        after: The same with the velocities v⁺.
        radius: Radii [m], shape ``(n,)``.
        mass: Masses [kg], shape ``(n,)``.
        gravity: Acceleration of gravity [m/s²], shape ``(2,)``.
        spin_factor: β = m a²/I.
        dt: Time step [s].
        position: Positions at the end of the step (x not yet wrapped), shape ``(n, 3)``. **Modified.**
        velocity: Velocities and spins v⁺, shape ``(n, 3)``. **Modified.**
        sums: For each chunk of grains the kinetic energy at the end [J] and the work of gravity ΣF·½Δt(v⁻+v⁺) [J], shape
            ``(chunks, 2)``. **Modified.**
    """
    count = radius.size
    half = 0.5 * dt
    for chunk in prange(sums.shape[0]):
        for i in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            vx, vy, s = after[i, 0], after[i, 1], after[i, 2]
            velocity[i, 0], velocity[i, 1] = vx, vy
            if s != start[i, 2]:  # an untouched spin keeps its bits
                velocity[i, 2] = s / radius[i]
            for d in range(3):
                position[i, d] = middle[i, d] + half * velocity[i, d]
            square = vx * vx + vy * vy
            sums[chunk, 0] += 0.5 * mass[i] * (square + s * s / spin_factor)
            work = gravity[0] * (start[i, 0] + vx) + gravity[1] * (start[i, 1] + vy)
            sums[chunk, 1] += mass[i] * half * work


@parallel_kernel
def wrap(position: Floats, image: np.ndarray, period: float) -> None:
    """Bring x back into [0, period) and count how often. **Modifies** ``position`` ``(n, 3)`` and ``image`` ``(n,)``."""
    for i in prange(position.shape[0]):
        if position[i, 0] >= period:
            position[i, 0] -= period
            image[i] += 1
        elif position[i, 0] < 0.0:
            position[i, 0] += period
            image[i] -= 1


@parallel_kernel
def displacements(position: Floats, reference: Floats, period: float, farthest: Floats) -> None:
    """Largest distance [m] moved since ``reference`` ``(n, 2)`` was recorded; **modifies** ``farthest`` ``(chunks, 1)``."""
    count = position.shape[0]
    for chunk in prange(farthest.shape[0]):
        best = 0.0
        for i in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            dx = position[i, 0] - reference[i, 0]
            if period > 0.0:
                dx -= period * np.round(dx / period)
            dy = position[i, 1] - reference[i, 1]
            best = max(best, dx * dx + dy * dy)
        farthest[chunk, 0] = np.sqrt(best)
