"""What carries heat, and how far: contacts, the gas in the gaps, radiation, and grains that move.

The mean flux is q = (1/A) [Σ φ ℓ + Σ C (T − ⟨T⟩) ds/dt] with the heat φ that flows from j to i:
what grains conduct, and what they carry (J. H. Irving & J. G. Kirkwood, J. Chem. Phys. 18 (1950)
817, for the energy of particles). In a cell s is beside the mean flow, and q does not depend on
where the sides lie. Between two walls a distance H apart q A is H times the heat that goes from one
to the other, in a steady state without friction, whatever carries it: then Σ C T r stays.

A cell that is periodic in both directions may have a mean gradient of temperature G. A grain at r
is warmer than its T by G·r, and so are its images. All T, which the state holds, are beside the
gradient, as velocities are beside the mean flow: they belong to no image. Between two grains of
branch vector ℓ, from j to i, heat flows as if j were warmer by −G·ℓ. A grain that moves by Δs
beside the mean flow (with which the gradient moves) takes its heat along: T falls by G·Δs. Where
temperatures themselves count, as in radiation and friction, they are T: gradients are small.
"""

from __future__ import annotations

import numpy as np

from multicor_cli.engine.geometry.radii import other_radius
from multicor_cli.engine.geometry.scene import Scene, known_geometry, shortest
from multicor_cli.engine.heat.network import Ends
from multicor_cli.engine.heat.radiation import linear_coefficient
from multicor_cli.engine.heat.rates import Network
from multicor_cli.engine.jit.compile import kernel, subroutine
from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats, Ints

# ---- A mean gradient of temperature in a cell


@kernel
def look_ahead(
    scene: Scene, i: Ints, j: Ints, gradient: Floats
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


# ---- What passes, and how far


@kernel
def branches(scene: Scene, i: Ints, j: Ints) -> Floats:
    """From the centers of grains j, or the nearest points of walls, to those of i [m], ``(e, 2)``.

    Of a grain that is glued to a wall the center counts.
    """
    branch = np.empty((i.size, 2))
    for k in range(i.size):
        gap, nx, ny = known_geometry(scene, i[k], j[k])
        reach = scene.radius[i[k]] + gap + other_radius(scene, j[k])
        branch[k, X], branch[k, Y] = reach * nx, reach * ny
    return branch


@kernel
def passed(
    net: Network, ends: Ends, conductance: Floats, of_contacts: Floats, branch: Floats,
    capacity: Floats, strayed: Floats, lasted: Floats, of_walls: Floats, dt: float,
) -> Floats:  # fmt: skip
    """What passes along x and y within ``dt`` [s], times the area [J m], shape ``(2, 4)``.

    Columns are contacts, gas, radiation and motion, as in `GRADIENT_BOOKS` and `FLUX_BOOKS`.
    Radiation counts at the mean temperatures, so that it is of second order in ``dt``.

    Args:
        net: The network, of nodes: grains, and then walls with a heat capacity.
        ends: Where its links lead.
        conductance: Conductances of the links [W/K], shape ``(e,)``.
        of_contacts: What contacts have of them [W/K], likewise.
        branch: Branch vectors of the links [m], shape ``(e, 2)``.
        capacity: Heat capacities of the nodes [J/K].
        strayed: How far the grains have moved, in a cell beside the mean flow [m], ``(n, 2)``.
        lasted: Integral of the temperatures of the nodes over the time [K s].
        of_walls: The same of walls of known temperature; heat that others give [J]; ``(w,)``.
        dt: The time.
    """
    found = np.zeros((2, 4))
    for k in range(net.i.size):
        row, a, b = ends.between[k], lasted[net.i[k]], lasted[net.j[k]]
        apart = b - a
        if net.ahead.size:
            apart += dt * net.ahead[k]
        _add(found, branch, row, conductance, of_contacts, _radiates(net.area, k, a, b, dt), apart)
    for k in range(net.wall_i.size):
        row, a, b = ends.known[k], lasted[net.wall_i[k]], of_walls[net.wall[k]]
        radiation = _radiates(net.wall_area, k, a, b, dt)
        _add(found, branch, row, conductance, of_contacts, radiation, b - a)
    for k in range(net.flow_i.size):  # as if it were conducted
        row = ends.flowing[k]
        if conductance[row] > 0.0:
            apart = net.flow_share[k] * of_walls[net.flow_wall[k]] / conductance[row]
            _add(found, branch, row, conductance, of_contacts, 0.0, apart)
    n, all_heat, all_capacity = len(strayed), 0.0, 0.0
    for i in range(n):
        all_heat += capacity[i] * lasted[i]
        all_capacity += capacity[i]
    mean = all_heat / all_capacity
    for i in range(n):
        for d in range(2):
            found[d, 3] += capacity[i] * (lasted[i] - mean) / dt * strayed[i, d]
    return found


@subroutine
def _radiates(area: Floats, k: int, a: float, b: float, dt: float) -> float:
    """Conductance of radiation at the mean of temperatures that have lasted ``dt`` [W/K]."""
    if area.size == 0:
        return 0.0
    return linear_coefficient(area[k], max(a, 0.0) / dt, max(b, 0.0) / dt)


@kernel
def _add(
    found: Floats, branch: Floats, row: int, conductance: Floats, of_contacts: Floats,
    radiation: float, apart: float,
) -> None:  # fmt: skip
    """Add what a link has passed; its ends were ``apart`` [K s]."""
    for d in range(2):
        found[d, 0] += of_contacts[row] * apart * branch[row, d]
        found[d, 1] += (conductance[row] - of_contacts[row]) * apart * branch[row, d]
        found[d, 2] += radiation * apart * branch[row, d]
