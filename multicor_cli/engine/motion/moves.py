"""Grains in a step: q_m = q + ½Δt v, free velocities, q⁺ = q_m + ½Δt v⁺ (Moreau–Jean, θ = ½)."""

from __future__ import annotations

import numpy as np

from multicor_cli.engine.jit.arrays import CHUNK
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.model.columns import ANGLE, INVERSE_MASS, SPIN, SURFACE, X, Y
from multicor_cli.model.model import Floats
from multicor_cli.model.state import LARGEST


@parallel_kernel
def predict(
    position: Floats, velocity: Floats, radius: Floats, mass: Floats, gravity: Floats, dt: float,
    middle: Floats, start: Floats, free: Floats,
) -> float:  # fmt: skip
    """Positions at mid-step and free velocities of the grains.

    **Modifies** ``middle``, q_m, and the grains of ``start`` and ``free``, bodies (v_x, v_y, a ω,
    1/m) at the start of the step and with free velocities. Returns the largest coordinate [m];
    infinite if a number is not finite or absurd.
    """
    count, half = radius.size, 0.5 * dt
    fall_x, fall_y = dt * gravity[X], dt * gravity[Y]
    largest = np.zeros((count + CHUNK - 1) // CHUNK)
    for chunk in prange(largest.size):
        far = 0.0
        for i in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            # All is read before any is written: in vectors, then
            vx, vy, spin = velocity[i, X], velocity[i, Y], velocity[i, SPIN]
            x, y = position[i, X] + half * vx, position[i, Y] + half * vy
            angle, surface = position[i, ANGLE] + half * spin, radius[i] * spin
            lightness = 1.0 / mass[i]
            fx, fy = vx + fall_x, vy + fall_y
            middle[i, X], middle[i, Y], middle[i, ANGLE] = x, y, angle
            start[i, X], start[i, Y], start[i, SURFACE], start[i, INVERSE_MASS] = (
                vx, vy, surface, lightness,
            )  # fmt: skip
            free[i, X], free[i, Y], free[i, SURFACE], free[i, INVERSE_MASS] = (
                fx, fy, surface, lightness,
            )  # fmt: skip
            square = max(vx * vx + vy * vy, fx * fx + fy * fy)
            size = np.sqrt(square) + abs(surface) + abs(x) + abs(y) + abs(angle)
            if not size <= LARGEST:  # or nan
                far = np.inf
            far = max(far, abs(x), abs(y))
        largest[chunk] = far
    far = 0.0
    for chunk in range(largest.size):
        far = max(far, largest[chunk])
    return far


@kernel
def are_sound(after: Floats, before: Floats, position: Floats, belt: Floats) -> bool:
    """Whether no number of the walls is absurd or not finite; shapes ``(w, 3)`` and ``(w,)``."""
    sound = True
    for w in range(belt.size):
        for d in range(3):
            size = abs(after[w, d]) + abs(before[w, d]) + abs(position[w, d]) + abs(belt[w])
            sound = sound and size <= LARGEST
    return sound


@parallel_kernel
def move(
    middle: Floats, start: Floats, after: Floats, radius: Floats, mass: Floats, gravity: Floats,
    spin_factor: float, dt: float, position: Floats, velocity: Floats,
) -> tuple[float, float]:  # fmt: skip
    """End of the step for the grains; ``spin_factor`` is β = m a²/I, other arrays as `predict`.

    **Modifies** ``position`` (x not yet wrapped) and ``velocity``. Returns the kinetic energy at
    the end and the work of gravity ΣF·½Δt(v⁻+v⁺) [J].
    """
    count, half = radius.size, 0.5 * dt
    sums = np.zeros(((count + CHUNK - 1) // CHUNK, 2))
    for chunk in prange(sums.shape[0]):
        kinetic, gravity_work = 0.0, 0.0
        for i in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            vx, vy, s, spin = after[i, X], after[i, Y], after[i, SURFACE], velocity[i, SPIN]
            if s != radius[i] * spin:  # an untouched spin keeps its bits
                spin = s / radius[i]
            x, y, angle = (
                middle[i, X] + half * vx, middle[i, Y] + half * vy, middle[i, ANGLE] + half * spin,
            )  # fmt: skip
            velocity[i, X], velocity[i, Y], velocity[i, SPIN] = vx, vy, spin
            position[i, X], position[i, Y], position[i, ANGLE] = x, y, angle
            square = vx * vx + vy * vy
            kinetic += 0.5 * mass[i] * (square + s * s / spin_factor)
            work = gravity[X] * (start[i, X] + vx) + gravity[Y] * (start[i, Y] + vy)
            gravity_work += mass[i] * half * work
        sums[chunk, 0], sums[chunk, 1] = kinetic, gravity_work
    kinetic, gravity_work = 0.0, 0.0
    for chunk in range(sums.shape[0]):
        kinetic += sums[chunk, 0]
        gravity_work += sums[chunk, 1]
    return kinetic, gravity_work


@kernel
def wrap(position: Floats, image: np.ndarray, period: float) -> None:
    """Bring x back into [0, period) and count how often; **modifies** ``position``, ``image``."""
    for i in range(position.shape[0]):
        if position[i, X] >= period:
            position[i, X] -= period
            image[i] += 1
        elif position[i, X] < 0.0:
            position[i, X] += period
            image[i] -= 1
