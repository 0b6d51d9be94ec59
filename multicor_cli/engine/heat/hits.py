"""Heat that impacts of grains that are no discs conduct.

A corner conducts as a sphere does (`impact_exchange` of `engine/heat/friction.py`), with a* of its
place and the mass that the impact feels there: ``1/m = n·(…)·n`` with the levers of both grains,
``Σ [1 + β l²/σ²]/m_i`` (theory, Grains of any shape), or of a wall that is free to move.

Sides that hit flat are pressed on the area A all the time: a punch of this area and the stiffness
``k = 2 E* √(A/π)`` is in contact for half a period, ``t_c = π √(m/k)``, whatever the speed, and two
half-spaces exchange

``E/ΔT = (2/√π) A √t_c/(b_i^−½ + b_j^−½)``, ``b = ρcλ``.

Whichever conducts more counts, as of contacts that last.

Source: K. L. Johnson, Contact Mechanics (1985), eq. 3.36 (k); H. S. Carslaw & J. C. Jaeger,
Conduction of Heat in Solids (1959) (half-spaces); t_c is derived.

Validity: elastic impacts that touch nothing else meanwhile; of sides, heat that goes less deep than
they are wide, √(λ t_c/ρc) ≪ √A, and a flat that hits flat: one that hits with a corner first is the
impact of a corner.
"""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.contacts import Contacts
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.heat.friction import MOST_OF_IMPACT, impact_exchange, wall_gives
from multicor_cli.engine.heat.mechanism import HeatLaws
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.model import Floats, Ints


@formula
def flat_time(m_eff: float, area: float, modulus: float) -> float:
    """Duration of the impact of flat sides ``π √(m/(2E* √(A/π)))`` [s]; m [kg], A [m²], E* [Pa]."""
    return pi * sqrt(m_eff / (2.0 * modulus * sqrt(area / pi)))


@formula
def flat_exchange(
    m_eff: float, area: float, modulus: float, conductivity_i: float, volumetric_i: float,
    conductivity_j: float, volumetric_j: float,
) -> float:  # fmt: skip
    """Heat of an impact of sides per difference of temperature [J/K]; 0 where A [m²] is.

    λ [W/(m K)], ρc [J/(m³ K)]; others as `flat_time`.
    """
    if area <= 0.0:
        return 0.0
    depth = 1.0 / sqrt(conductivity_i * volumetric_i) + 1.0 / sqrt(conductivity_j * volumetric_j)
    return 2.0 * area * sqrt(flat_time(m_eff, area, modulus) / pi) / depth


@kernel
def known_points(
    row: NDArray[np.int64], loaded_j: Ints, loaded_key: Ints, i: Ints, j: Ints, key: Ints,
    head: Ints,
) -> NDArray[np.bool_]:  # fmt: skip
    """Whether a place had a point that carried an impulse in the step before, shape ``(c,)``.

    ``row`` is the first of each grain among the points loaded then; ``head`` the first contact of
    each place.
    """
    found = np.zeros(i.size, np.bool_)
    for c in range(i.size):
        for k in range(row[i[c]], row[i[c] + 1]):
            if loaded_j[k] == j[c] and loaded_key[k] == key[c]:
                found[head[c]] = True
    for c in range(i.size):
        found[c] = found[head[c]]
    return found


@kernel
def hit(
    scene: Scene, mass: Floats, mobility: Floats, spin_factor: float, contacts: Contacts, key: Ints,
    head: Ints, radius: Floats, area: Floats, carried: Floats, total: Floats,
    is_known: NDArray[np.bool_], laws: HeatLaws, dt: float, conductance: Floats,
) -> None:  # fmt: skip
    """Give points that are new in this step the conductance of an impact, spread over the step.

    Not where others press, as in `collide`. A place is hit once, at the mean of its points by
    impulse, and they share the impact so: impulses ``carried``, and in ``total`` by the place
    [N s]. Of places are a* [m] and the area that is pressed [m²]; ``spin_factor`` is m σ²/I,
    ``mobility`` of walls as in `Moved`. **Modifies** ``conductance`` [W/K], shape ``(c,)`` as the
    others.
    """
    count = key.size
    speed, turn, turn_too = np.zeros(count), np.zeros(count), np.zeros(count)
    for c in range(count):
        if key[c] >= 0 and carried[c] > 0.0:
            share, h = carried[c] / total[c], head[c]
            speed[h] -= share * contacts[c].u_n
            turn[h] += share * contacts[c].turn_in
            turn_too[h] += share * contacts[c].turn_jn
    for c in range(count):
        h = head[c]
        if key[c] < 0 or carried[c] <= 0.0 or is_known[c] or speed[h] <= 0.0:
            continue
        i, j = contacts[c].i, contacts[c].j
        a, b = scene.material[i], scene.material[j]
        inverse = (1.0 + spin_factor * turn[h] * turn[h]) / mass[i]
        if j < scene.radius.size:
            inverse += (1.0 + spin_factor * turn_too[h] * turn_too[h]) / mass[j]
        else:
            wall, nx, ny = scene.wall[j - scene.radius.size], contacts[c].nx, contacts[c].ny
            inverse += wall_gives(mobility, wall, nx, ny, turn_too[h])
        if total[c] * inverse > MOST_OF_IMPACT * speed[h]:
            continue
        solid = laws.conductivity[a], laws.volumetric[a], laws.conductivity[b], laws.volumetric[b]
        modulus = laws.modulus[a, b]
        exchange = max(
            impact_exchange(1.0 / inverse, radius[c], modulus, speed[h], *solid),
            flat_exchange(1.0 / inverse, area[c], modulus, *solid),
        )
        conductance[c] = exchange / dt * (carried[c] / total[c])
