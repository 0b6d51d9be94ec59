"""A mean gradient of temperature G in a cell that is periodic in both directions.

A grain at r is warmer than its T by G·r, and so are its images. All T, which the state holds, are
beside the gradient, as velocities are beside the mean flow: they belong to no image. Between two
grains of branch vector ℓ, from j to i, heat flows as if j were warmer by −G·ℓ. A grain that moves
by Δs beside the mean flow (with which the gradient moves) takes its heat along: T falls by G·Δs.
Where temperatures themselves count, as in radiation and friction, they are T: gradients are small.

The mean flux is q = (1/A) [Σ φ ℓ + Σ C (T − ⟨T⟩) ds/dt] with the heat φ that flows from j to i:
what grains conduct, and what they carry (J. H. Irving & J. G. Kirkwood, J. Chem. Phys. 18 (1950)
817, for the energy of particles). It does not depend on where the sides of the cell lie.
"""

from __future__ import annotations

import numpy as np

from multicor_cli.engine.geometry.scene import Scene, shortest
from multicor_cli.engine.heat.mechanism import Indices
from multicor_cli.engine.heat.radiation import linear_coefficient
from multicor_cli.engine.heat.rates import Network
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats


@kernel
def look_ahead(
    scene: Scene, i: Indices, j: Indices, gradient: Floats
) -> tuple[Floats, Floats]:  # fmt: skip
    """Branch vectors of pairs [m], and how much warmer the gradient [K/m] makes the second [K].

    Shapes ``(e, 2)`` and ``(e,)``.
    """
    branch, ahead = np.empty((i.size, 2)), np.empty(i.size)
    for k in range(i.size):
        x, y = shortest(
            scene.position[i[k], X] - scene.position[j[k], X],
            scene.position[i[k], Y] - scene.position[j[k], Y],
            scene.period, scene.height, scene.tilt,
        )  # fmt: skip
        branch[k, X], branch[k, Y] = x, y
        ahead[k] = -(gradient[X] * x + gradient[Y] * y)
    return branch, ahead


@kernel
def take_along(capacity: Floats, strayed: Floats, gradient: Floats) -> Floats:
    """Heat that grains gain as they move along the gradient, −C G·Δs [J], shape ``(n,)``.

    ``strayed`` is how far they have moved beside the mean flow [m], shape ``(n, 2)``.
    """
    gained = np.empty(capacity.size)
    for i in range(capacity.size):
        gained[i] = -capacity[i] * (gradient[X] * strayed[i, X] + gradient[Y] * strayed[i, Y])
    return gained


@kernel
def passed(
    net: Network, of_contacts: Floats, branch: Floats, capacity: Floats, strayed: Floats,
    lasted: Floats, dt: float,
) -> Floats:  # fmt: skip
    """What passes along x and y within ``dt`` [s], times the area [J m], shape ``(2, 4)``.

    Columns are contacts, gas, radiation and motion, as in `GRADIENT_BOOKS`. Radiation counts at the
    mean temperatures, so that it is of second order in ``dt``.

    Args:
        net: The network.
        of_contacts: What contacts have of its conductances [W/K], shape ``(e,)``.
        branch: Branch vectors of its links [m], shape ``(e, 2)``.
        capacity: Heat capacities of the grains [J/K], shape ``(n,)``.
        strayed: How far they have moved beside the mean flow [m], shape ``(n, 2)``.
        lasted: Integral of their temperatures over the time [K s], shape ``(n,)``.
        dt: The time.
    """
    found = np.zeros((2, 4))
    for k in range(net.i.size):
        a, b = lasted[net.i[k]], lasted[net.j[k]]
        apart = b - a + dt * net.ahead[k]
        radiation = 0.0
        if net.area.size:
            radiation = linear_coefficient(net.area[k], max(a, 0.0) / dt, max(b, 0.0) / dt)
        for d in range(2):
            found[d, 0] += of_contacts[k] * apart * branch[k, d]
            found[d, 1] += (net.conductance[k] - of_contacts[k]) * apart * branch[k, d]
            found[d, 2] += radiation * apart * branch[k, d]
    all_heat, all_capacity = 0.0, 0.0
    for i in range(capacity.size):
        all_heat += capacity[i] * lasted[i]
        all_capacity += capacity[i]
    mean = all_heat / all_capacity
    for i in range(capacity.size):
        for d in range(2):
            found[d, 3] += capacity[i] * (lasted[i] - mean) / dt * strayed[i, d]
    return found
