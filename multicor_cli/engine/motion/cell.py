"""The cell of a run that is periodic in both directions, and its mean flow (theory §2.1).

The cell is spanned by (width, 0) and (tilt, height). It is a wall without shapes: its "position"
are these three, its "velocity" is the gradient L = [[L_xx, L_xy], [0, L_yy]] of the mean flow.
Velocities c of grains are relative to it: places move with ṙ = c + L r, and so do their images.

Grains keep their real velocities where the mean flow differs, so m ċ = f − m L c, and what this
takes from their energy the gradient gets: M dL/dt = Σ f⊗ℓ + Σ m c⊗c − A σ.

In both halves of a step the mean flow is that at q_m: q_m = q + ½Δt (c⁻ + L⁻ q_m) and q⁺ = q_m +
½Δt (c⁺ + L⁺ q_m). So a branch vector changes by ½Δt u⁻ and by ½Δt u⁺, with u = c_i − c_j + L ℓ_m,
and the scheme is of second order.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from multicor_cli.engine.jit.compile import kernel
from multicor_cli.engine.orders import PhysicsError
from multicor_cli.model.columns import XX, XY, YY, X, Y
from multicor_cli.model.model import Floats

ROUNDS = 50
"""Most rounds in which convection is solved; each leaves (c Δt/d)² of the error or less."""


def sides_at_middle(sides: Floats, gradient: Floats, half: float) -> Floats:
    """Width, height and tilt at q_m [m], after half a step [s] with a gradient [1/s]."""
    width, height, tilt = sides.tolist()
    xx, yy, xy = (half * gradient).tolist()
    height /= 1.0 - yy
    return np.array([width / (1.0 - xx), height, (tilt + xy * height) / (1.0 - xx)])


def sides_at_end(middle: Floats, gradient: Floats, half: float) -> Floats:
    """The same at the end of a step, from those at q_m."""
    width, height, tilt = middle.tolist()
    xx, yy, xy = (half * gradient).tolist()
    return np.array([width + xx * width, height + yy * height, tilt + (xx * tilt + xy * height)])


def require_room(sides: Floats, diameter: float, step: int) -> None:
    """Raise `PhysicsError` at a ``step`` that leaves less than two largest diameters [m]."""
    width, height = sides[:2].tolist()
    if not min(width, height) >= 2.0 * diameter:
        message = (
            f"the cell would be {width:.3g} m by {height:.3g} m, where the largest grain is "
            f"{diameter:.3g} m wide: nothing holds it against its stress, or its rate leads there; "
            "give it more grains, another rate or stress, or a shorter time step"
        )
        raise PhysicsError(step, message)


def require_slowness(cutoff: float, step: int) -> float:
    """The gap that no pair closes in a ``step``, if there is one: a cell may strain too fast.

    Raises `PhysicsError` if there is none.
    """
    if cutoff < math.inf:
        return cutoff
    message = (
        "the cell strains by as much as its size in a step: give a shorter time step, a smaller "
        "stress or rate, or a greater cell_inertia"
    )
    raise PhysicsError(step, message)


@kernel
def carry_to_middle(place: Floats, gradient: Floats, half: float) -> None:
    """From places q + ½Δt c⁻ to q_m, **modified**, shape ``(n, ≥ 2)``."""
    xx, yy, xy = half * gradient[XX], half * gradient[YY], half * gradient[XY]
    for i in range(place.shape[0]):
        place[i, Y] /= 1.0 - yy
        place[i, X] = (place[i, X] + xy * place[i, Y]) / (1.0 - xx)


def strain_between(before: Floats, after: Floats) -> Floats:
    """Components xx, yy and xy of the strain that leads from one width, height, tilt to another."""
    xx, yy = (after[:2] / before[:2] - 1.0).tolist()
    return np.array([xx, yy, (after[XY] - (1.0 + xx) * before[XY]) / before[YY]])


@kernel
def carry(place: Floats, gradient: Floats, duration: float, out: Floats) -> None:
    """Add what the mean flow at ``place`` does in a time [s] to the places ``out``, **modified**.

    Both are ``(n, ≥ 2)``, and may be the same array.
    """
    xx, yy, xy = duration * gradient[XX], duration * gradient[YY], duration * gradient[XY]
    for i in range(place.shape[0]):
        x, y = place[i, X], place[i, Y]
        out[i, X] += xx * x + xy * y
        out[i, Y] += yy * y


class Convection(NamedTuple):
    """How the mean flow acts on velocities c in a step.

    Attributes:
        gradient: L after it, where a stress drives it; shape ``(3,)``.
        pull: Δt Σ m c⊗c: xx, yy, xy [J s].
    """

    gradient: Floats
    pull: Floats


@kernel
def convect(
    mass: Floats, before: Floats, after: Floats, inverse: Floats, dt: float, start: Floats,
    free: Floats,
) -> Convection:  # fmt: skip
    """Let the mean flow act on velocities: −m L c on grains, Σ m c⊗c on the gradient.

    By the implicit midpoint rule, which keeps the energy of both together to rounding: c and L are
    the means of before and after it. ``before`` and ``after`` are the gradients of the step where
    a rate is prescribed, and ``before`` that of what a stress drives, with the ``inverse`` inertia
    [1/(kg m²)], 0 elsewhere; shapes ``(3,)``. **Modifies** x and y of ``start`` and ``free``.
    """
    t_xx, t_yy, t_xy = 0.0, 0.0, 0.0
    for i in range(mass.size):
        u, v = start[i, X], start[i, Y]
        t_xx += mass[i] * u * u
        t_yy += mass[i] * v * v
        t_xy += mass[i] * u * v
    half, gradient, pull = 0.5 * dt, before.copy(), np.zeros(3)
    a, b, c = 1.0, 0.0, 1.0
    for _ in range(ROUNDS):
        mean = np.empty(3)
        for d in range(3):
            mean[d] = 0.5 * (before[d] + (gradient[d] if inverse[d] > 0.0 else after[d]))
        # ĉ = (1 + ½Δt L̂)⁻¹ c⁻ = (a c_x + b c_y, c c_y)
        a, c = 1.0 / (1.0 + half * mean[XX]), 1.0 / (1.0 + half * mean[YY])
        b = -half * mean[XY] * a * c
        last = pull.copy()
        pull[XX] = dt * (a * a * t_xx + 2.0 * a * b * t_xy + b * b * t_yy)
        pull[YY] = dt * (c * c * t_yy)
        pull[XY] = dt * (a * c * t_xy + b * c * t_yy)
        is_same = True
        for d in range(3):
            gradient[d] = before[d] + inverse[d] * pull[d]
            is_same = is_same and last[d] == pull[d]
        if is_same:
            break
    for i in range(mass.size):
        u, v = start[i, X], start[i, Y]
        start[i, X] = free[i, X] = 2.0 * (a * u + b * v) - u
        start[i, Y] = free[i, Y] = 2.0 * (c * v) - v
    return Convection(gradient, pull)


@kernel
def wrap_cell(position: Floats, sides: Floats) -> None:
    """Bring places back into the cell, and its tilt into ± half its width; **modifies** both.

    Neither changes where the images are.
    """
    width, height = sides[XX], sides[YY]
    sides[XY] -= width * np.floor(sides[XY] / width + 0.5)
    tilt = sides[XY]
    for i in range(position.shape[0]):
        up = np.floor(position[i, Y] / height)
        if up != 0.0:
            position[i, X] -= up * tilt
            position[i, Y] -= up * height
        right = np.floor(position[i, X] / width)
        if right != 0.0:
            position[i, X] -= right * width
