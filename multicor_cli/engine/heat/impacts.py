"""Heat that impacts conduct: of discs, and of grains of other shapes.

A corner conducts as a sphere does, with a* of its place and the mass that the impact feels there:
``1/m = n·(…)·n`` with the levers of both grains, ``Σ [1 + β l²/σ²]/m_i`` (theory, Grains of any
shape), or of a wall that is free to move.
"""

from __future__ import annotations

from math import inf, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic import power
from multicor_cli.engine.contact.contacts import Contacts
from multicor_cli.engine.contact.impacts import P_N, U_N, Impacts, row_of
from multicor_cli.engine.geometry.radii import hertz_radius
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.heat.mechanism import HeatLaws
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import SPIN, X, Y
from multicor_cli.model.model import Floats, Ints

# ---- Of discs, and of corners
#
# Formula: contact time `t_c = 2.87 (m²/(a* E*² v))^⅕`, largest spot `R = (15 m a*² v²/16E*)^⅕` with
# the reduced mass m, and the heat `E/ΔT = C π R² √t_c/(b_1^−½ + b_2^−½)`, `b = ρcλ`, where C(Fo, c)
# corrects the one-dimensional solution (C = 1 nearly) for the spreading of heat from a spot;
# `Fo = λ_1 t_c/(ρ_1 c_1 R²)`, `c = ρ_1 c_1/(ρ_2 c_2)`.
#
# Source: J. Sun & M. M. Chen, Int. J. Heat Mass Transf. 31 (1988) 969; fit of C by Z. Y. Zhou, A.
# B. Yu & M. Horio, Chem. Eng. J. 139 (2008) 408.
#
# Validity: elastic, smooth, head-on impact of spheres that touch nothing else meanwhile; Fo of
# order 1 or less (it is 0.16 for steel grains of 3 mm at 0.1 m/s, and goes as 1/v). The fit is not
# symmetric in the two bodies; here body 1 is the one with the smaller ρc, so that c ≤ 1, where C
# changes little, and what one body loses the other gains. For c well below 1 the square root in the
# fit ends near Fo = 16; beyond, it is held at 0. Lasting contacts carry far more: 3·10⁻⁷ of the
# heat capacity of such a grain per impact.


@formula
def impact_time(m_eff: float, a_eff: float, modulus: float, speed: float) -> float:
    """Duration of an elastic impact ``t_c = 2.87 (m²/(a* E*² v))^⅕`` [s] (Hertz).

    Reduced mass m = m_i m_j/(m_i + m_j) [kg], a* [m], contact modulus E* [Pa], speed of approach v
    [m/s]; infinite if that is not positive.
    """
    if speed <= 0.0:
        return inf
    return 2.87 * power(m_eff * m_eff / (a_eff * modulus * modulus * speed), 0.2)


@formula
def impact_radius(m_eff: float, a_eff: float, modulus: float, speed: float) -> float:
    """Largest spot ``R = (15 m a*² v²/(16 E*))^⅕`` [m] (Hertz); arguments as `impact_time`."""
    return power(0.9375 * m_eff * a_eff * a_eff * speed * speed / modulus, 0.2)


@formula
def fourier_number(conductivity: float, volumetric: float, time: float, radius: float) -> float:
    """Fourier number ``Fo = λ t/(ρc R²)``; λ [W/(m K)], ρc [J/(m³ K)], t [s], R [m]."""
    return conductivity * time / (volumetric * radius * radius)


@formula
def impact_coefficient(fo: float, ratio: float) -> float:
    """Correction C of the one-dimensional solution (Zhou, Yu & Horio 2008); c = ρ_1 c_1/(ρ_2 c_2).

    ``C = 0.435 (√(C_2² − 4 C_1 (C_3 − Fo)) − C_2)/C_1`` with quadratic C_k(c). Where C_2 > 0 it is
    written with the conjugate root, which is the same number and finite where C_1 = 0.
    """
    c_1 = (-2.300 * ratio + 8.909) * ratio - 4.235
    c_2 = (8.169 * ratio - 33.770) * ratio + 24.885
    c_3 = (-5.758 * ratio + 24.464) * ratio - 20.511
    square = c_2 * c_2 - 4.0 * c_1 * (c_3 - fo)
    if square <= 0.0:
        return -0.435 * c_2 / c_1
    if c_2 > 0.0:
        return 1.74 * (fo - c_3) / (sqrt(square) + c_2)
    return 0.435 * (sqrt(square) - c_2) / c_1


@formula
def impact_exchange(
    m_eff: float, a_eff: float, modulus: float, speed: float, conductivity_i: float,
    volumetric_i: float, conductivity_j: float, volumetric_j: float,
) -> float:  # fmt: skip
    """Heat of one impact per difference of temperature ``C π R² √t_c/(b_i^−½ + b_j^−½)`` [J/K].

    Sun & Chen 1988. Symmetric in the two bodies: body 1 of the fit is that with the smaller ρc, at
    equal ρc that with the larger λ. 0 if the speed of approach is not positive; arguments as
    `impact_time`, λ [W/(m K)], ρc [J/(m³ K)].
    """
    if speed <= 0.0:
        return 0.0
    time = impact_time(m_eff, a_eff, modulus, speed)
    radius = impact_radius(m_eff, a_eff, modulus, speed)
    is_first = volumetric_i < volumetric_j or (
        volumetric_i == volumetric_j and conductivity_i > conductivity_j
    )
    k_1 = conductivity_i if is_first else conductivity_j
    v_1 = volumetric_i if is_first else volumetric_j
    ratio = v_1 / (volumetric_j if is_first else volumetric_i)
    correction = impact_coefficient(fourier_number(k_1, v_1, time, radius), ratio)
    depth = 1.0 / sqrt(conductivity_i * volumetric_i) + 1.0 / sqrt(conductivity_j * volumetric_j)
    return correction * pi * radius * radius * sqrt(time) / depth


@formula
def wall_gives(mobility: Floats, wall: int, nx: float, ny: float, lever: float) -> float:
    """What a wall adds to the inverse of the mass that an impact along n feels [1/kg]; 0 if held.

    ``mobility`` as in `Moved`; the lever is that of n about the reference point [m].
    """
    along = mobility[wall, X] * (nx * nx) + mobility[wall, Y] * (ny * ny)
    return along + mobility[wall, SPIN] * (lever * lever)


MOST_OF_IMPACT = 30.0
"""Impulse of a contact over m u⁻ above which it is not that of an impact.

An impact makes 1 + e, or 2 (1 + M/m) where a heavy grain hits a light one that others hold. Where
it is more they press there, and the contact conducts as one that lasts: in a dense flow contacts
close again at speeds that only rounding leaves."""


@formula
def _exchange_between(
    scene: Scene, mass: Floats, laws: HeatLaws, i: int, j: int, gives: float, speed: float,
    impulse: float,
) -> float:  # fmt: skip
    """`impact_exchange` of a disc and a disc or a wall, of which `wall_gives` tells.

    0 if the impact does not make the ``impulse`` [N s].
    """
    if j < scene.radius.size:
        m = mass[i] * mass[j] / (mass[i] + mass[j])
    else:
        m = mass[i] / (1.0 + mass[i] * gives)
    if impulse > MOST_OF_IMPACT * m * speed:
        return 0.0
    a, b = scene.material[i], scene.material[j]
    return impact_exchange(
        m, hertz_radius(scene, i, j), laws.modulus[a, b], speed, laws.conductivity[a],
        laws.volumetric[a], laws.conductivity[b], laws.volumetric[b],
    )  # fmt: skip


@kernel
def strike(
    scene: Scene, mass: Floats, impacts: Impacts, i: Ints, j: Ints, laws: HeatLaws, dt: float,
    is_known: NDArray[np.bool_], conductance: Floats,
) -> None:  # fmt: skip
    """Give contacts (i, j) that had impacts in flight the conductance of all of them together.

    Each has a speed of its own: the u⁻ of the contact is that of no impact. They are spread over
    the step. Walls that are hit in flight are held. **Modifies** ``conductance`` [W/K], shape
    ``(c,)``, and ``is_known`` of these contacts, as they are dealt with.
    """
    is_met = np.zeros(i.size, np.bool_)
    for e in range(impacts.i.size):
        if impacts.said[e, P_N] > 0.0:
            first, second = impacts.i[e], impacts.j[e]
            c = row_of(i, j, first, second)
            speed = -impacts.said[e, U_N]
            exchange = _exchange_between(scene, mass, laws, first, second, 0.0, speed, 0.0) / dt
            conductance[c] = exchange if not is_met[c] else conductance[c] + exchange
            is_met[c] = is_known[c] = True


@kernel
def collide(
    scene: Scene, mass: Floats, mobility: Floats, contacts: Contacts, total: Floats,
    is_known: NDArray[np.bool_], laws: HeatLaws, dt: float, conductance: Floats,
) -> None:  # fmt: skip
    """Give contacts that are new in this step the conductance of an impact, spread over the step.

    Where others press (`MOST_OF_IMPACT`) it is that of contacts that last. A place is hit once: its
    contacts share the impact in proportion to their impulses, ``total`` of each place [N s].
    Circles of walls have the a* of Hertz. Places that are known carried an impulse in the step
    before. ``mobility`` of walls as in `Moved`. **Modifies** ``conductance``
    [W/K], shape ``(c,)`` as the others.
    """
    grains = scene.radius.size
    for c in range(contacts.size):
        contact = contacts[c]
        speed, normal = -contact.u_n, contact.p_n
        if normal > 0.0 and speed > 0.0 and not is_known[c]:
            i, j, nx, ny, gives = contact.i, contact.j, contact.nx, contact.ny, 0.0
            if j >= grains:
                lever = contact.lever_x * ny - contact.lever_y * nx
                gives = wall_gives(mobility, scene.wall[j - grains], nx, ny, lever)
            exchange = _exchange_between(scene, mass, laws, i, j, gives, speed, total[c])
            if exchange > 0.0:
                conductance[c] = exchange / dt * (normal / total[c])


# ---- Of sides that hit flat
#
# They are pressed on the area A all the time: a punch of this area and the stiffness
# `k = 2 E* √(A/π)` is in contact for half a period, `t_c = π √(m/k)`, whatever the speed, and two
# half-spaces exchange `E/ΔT = (2/√π) A √t_c/(b_i^−½ + b_j^−½)`, `b = ρcλ`. Whichever conducts more
# counts, as of contacts that last.
#
# Source: K. L. Johnson, Contact Mechanics (1985), eq. 3.36 (k); H. S. Carslaw & J. C. Jaeger,
# Conduction of Heat in Solids (1959) (half-spaces); t_c is derived.
#
# Validity: elastic impacts that touch nothing else meanwhile; heat that goes less deep than the
# sides are wide, √(λ t_c/ρc) ≪ √A, and a flat that hits flat: one that hits with a corner first is
# the impact of a corner.


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
