"""Heat that contacts generate: sliding friction, its share in each body, wear, and impacts.

Formulas: the energy lost in a step, ``−p_t ½(u_t⁻ + u_t⁺)`` and ``−p_n ½(u_n⁻ + u_n⁺)``, or
``Q = μ F_n |u_t|`` (both derived: the work of Coulomb's law).

Validity: the power is that of a contact that slides with the velocity u_t all through the step.
Temperatures are those of grains; the spot itself may be much hotter for an instant. The law of
friction is elsewhere: `contact/law.py`, and μ in `contact/contacts.py`.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, pi, sqrt
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic import power
from multicor_cli.engine.contact.contacts import (
    Contacts,
    contact_after,
    relative_velocity,
    stretch_along,
)
from multicor_cli.engine.contact.impacts import P_N, U_N, Impacts, row_of
from multicor_cli.engine.contact.rolling import rolled_loss, rolling_loss
from multicor_cli.engine.geometry.radii import hertz_radius
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.heat.mechanism import HeatLaws
from multicor_cli.engine.jit.arrays import CHUNK, column_totals
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange, subroutine
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import FRICTION, IMPACT, MU, NORMAL, NX, NY, SPIN, TANGENTIAL, X, Y
from multicor_cli.model.model import Floats, Ints

# ---- Archard's law of sliding wear.
#
# Formula: volume `V = K F s/H`. Source: J. F. Archard, J. Appl. Phys. 24 (1953) 981.
#
# Validity: steady adhesive or abrasive wear below the load at which it becomes severe; K (10⁻⁸ to
# 10⁻³; dry steel on steel some 10⁻⁴) is a measurement on the pair of materials and known to a
# factor of ten at best. Grains keep their size, unless they are told to shrink.


@formula
def rubbing_of(normal: float, slip: float, work: float, mu: float) -> float:
    """Normal load times slipped distance F s [N m]: the work of friction over μ.

    So a contact that sticks does not wear. Normal impulse F Δt [N s] and sliding speed s/Δt [m/s]
    of either sign count where there is no friction; work of friction [J] below 0 counts as 0.
    """
    return max(work, 0.0) / mu if mu > 0.0 else normal * abs(slip)


@formula
def archard_volume(coefficient_over_hardness: float, rubbing: float) -> float:
    """Worn volume ``V = (K/H) F s`` [m³] (Archard 1953); K/H [1/Pa] of the worn body, F s [N m]."""
    return coefficient_over_hardness * rubbing


# ---- Which share β of the heat of friction goes into body i; 1 − β goes into body j.
#
# Formulas and sources: *effusivity* `β = e_i/(e_i + e_j)`, `e = √(λρc)` (F. Charron, Publ. Sci.
# Tech. Min. Air 182 (1943)); *conductivity* `β = λ_i/(λ_i + λ_j)` (steady conduction from one spot,
# J. C. Jaeger, Proc. R. Soc. NSW 76 (1942) 203); *electrothermal*
# `β = ½ [ρ_i/(ρ_i + ρ_j) + λ_i/(λ_i + λ_j)]` with the electrical resistivities ρ (the coefficient
# of Mokrani and Bourouga used by Nguyen et al., J. Mech. Mater. Struct. 4 (2009) 413).
#
# Validity: all take perfect contact of the two surfaces and both bodies at one temperature far from
# the spot. *effusivity* holds for contacts shorter than the diffusion time over the spot (both
# bodies semi-infinite): sliding, impacts. *conductivity* holds for lasting contacts, steady on the
# scale of the spot. *electrothermal* describes the heat of an electric current through the
# interface; it has no meaning for friction. It equals ½ for one material, as do the others, and is
# offered to repeat published results.

Partition = Literal["effusivity", "conductivity", "half", "electrothermal"]


def effusivity(k: float, rho: float, c: float) -> float:
    """Thermal effusivity ``e = √(λ ρ c)`` [W s^½/(m² K)]; λ [W/(m K)], ρ [kg/m³], c [J/(kg K)]."""
    return sqrt(k * rho * c)


def first_share(first: float, second: float) -> float:
    """Share of body i ``e_i/(e_i + e_j)`` from the effusivities (Charron), or as well from λ."""
    return first / (first + second)


def electrothermal_share(
    k_i: float, resistivity_i: float, k_j: float, resistivity_j: float
) -> float:
    """Share of body i ``½ [ρ_i/(ρ_i + ρ_j) + λ_i/(λ_i + λ_j)]`` (Mokrani & Bourouga).

    It is that of the heat of a *current*, not of friction. Resistivities ρ [Ω m], λ [W/(m K)].
    """
    return 0.5 * (resistivity_i / (resistivity_i + resistivity_j) + k_i / (k_i + k_j))


def _by_effusivity(
    k_i: float, rho_i: float, c_i: float, k_j: float, rho_j: float, c_j: float
) -> float:
    return first_share(effusivity(k_i, rho_i, c_i), effusivity(k_j, rho_j, c_j))


SHARES: dict[Partition, tuple[Callable[..., float], tuple[str, ...]]] = {
    "effusivity": (_by_effusivity, ("conductivity", "density", "heat_capacity")),
    "conductivity": (first_share, ("conductivity",)),
    "half": (lambda: 0.5, ()),
    "electrothermal": (electrothermal_share, ("conductivity", "resistivity")),
}
"""Share of the first body, from these properties of the first body and then of the second."""


@subroutine
def share_out(
    scene: Scene, i: Ints, j: Ints, rows: Ints, heat: Floats, share: Floats,
    takes_heat: NDArray[np.bool_], generated: Floats, source: Floats, wall_source: Floats,
) -> None:  # fmt: skip
    """Give the heat of contacts to their two bodies; walls that take none leave it to the grain.

    ``rows`` are the contacts with heat. ``heat`` of friction and impacts [J] has shape ``(c, 2)``,
    ``share`` of the first body ``(c,)``, ``takes_heat`` of the walls ``(w,)``. **Modifies**
    ``generated``, all heat of each contact [J], and adds to ``source`` of grains and
    ``wall_source`` [J].
    """
    grains = scene.radius.size
    for c in rows:
        total = generated[c] = heat[c, FRICTION] + heat[c, IMPACT]
        mine = share[c] * total
        if j[c] < grains:
            source[i[c]] += mine
            source[j[c]] += total - mine
        elif takes_heat[scene.wall[j[c] - grains]]:
            source[i[c]] += mine
            wall_source[scene.wall[j[c] - grains]] += total - mine
        else:
            source[i[c]] += total


@subroutine
def wear_off(
    scene: Scene, i: Ints, j: Ints, rows: Ints, rubbing: Floats, laws: HeatLaws,
    wear: Floats, wall_wear: Floats,
) -> None:  # fmt: skip
    """Add the volumes worn off the bodies of contacts to ``wear`` and ``wall_wear`` [m³].

    ``rubbing``, force times slipped distance [N m], has shape ``(c,)``; ``rows`` as in `share_out`.
    """
    grains = scene.radius.size
    for c in rows:
        a, b = scene.material[i[c]], scene.material[j[c]]
        wear[i[c]] += archard_volume(laws.wear[a, b], rubbing[c])
        worn = archard_volume(laws.wear[b, a], rubbing[c])
        if j[c] < grains:
            wear[j[c]] += worn
        else:
            wall_wear[scene.wall[j[c] - grains]] += worn


# ---- Heat conducted during one elastic impact.
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


# ---- Heat of sliding friction and of impacts

FrictionRule = Literal["energy", "sliding", "none"]

NO_FRICTION, ENERGY, SLIDING = 0, 1, 2
"""Rules of the heat of friction."""


@formula
def sliding_power(mu: float, normal_force: float, slip_speed: float) -> float:
    """Power of sliding friction ``Q = μ F_n |u_t|`` [W]; F_n [N], u_t [m/s] of either sign."""
    return mu * abs(slip_speed) * normal_force


class Solved(NamedTuple):
    """The contacts of a step that has been taken; ``c`` of them.

    Attributes:
        i: Grains, shape ``(c,)``.
        j: Grains or wall shapes, shape ``(c,)``.
        contacts: Their table, in which those of two discs are missing if ``is_plain``.
        lane: Lane of each, negative of those in none, shape ``(c,)``; this and the next four are
            those of the `Schedule`.
        branch: Branch vectors in a cell, likewise.
        after: Velocities v⁺, shape ``(bodies, 4)``.
        is_plain: Whether none adheres or resists rolling.
    """

    i: Ints
    j: Ints
    contacts: Contacts
    lane: Ints
    frame: Floats
    impulse: Floats
    before: Floats
    branch: Floats
    after: Floats
    is_plain: bool


@kernel
def loaded_rows(grains: int, solved: Solved, normal: Floats) -> Ints:
    """Contacts that bear; **modifies** ``normal``, q_n of all of them [N s], shape ``(c,)``."""
    rows, found = np.empty(normal.size, np.int32), 0
    for c in range(normal.size):
        lane = solved.lane[c]
        if solved.j[c] < grains and lane >= 0:
            normal[c] = solved.impulse[lane // LANES, NORMAL, lane % LANES]
        else:
            normal[c] = solved.contacts[c].p_n
        rows[found] = c  # without a branch: which contacts bear is hard to guess
        found += normal[c] > 0.0
    return rows[:found]


@parallel_kernel
def generated_heat(
    scene: Scene, solved: Solved, rows: Ints, rule: int, has_impact: bool, heat: Floats,
    rubbing: Floats,
) -> None:  # fmt: skip
    """Heat generated in contacts of a step, and force times slipped distance, which wears.

    ``"energy"``: −p_t ½(u_t⁻+u_t⁺), exact and signed; ``"sliding"``: μ|u_t⁺| p_n (the paper's E_f);
    impacts: −p_n ½(u_n⁻+u_n⁺). Couples of rolling resistance add −p_r ½(u_r⁻+u_r⁺), or |p_r u_r⁺|,
    to friction. With adhesion q_n = p_n + F_a Δt takes the place of p_n in Coulomb's law. Rubbing
    is the work of friction over μ: p_n times the slipped distance where a contact slides, less
    where it sticks.

    The scene is that at q_m. **Modifies** ``heat`` of friction and impacts [J], shape ``(c, 2)``,
    and ``rubbing`` [N m], shape ``(c,)``, of the contacts ``rows``.
    """
    i, j, contacts, lane, frame, impulse, before, branch, after, is_plain = solved
    grains = scene.radius.size
    for chunk in prange((rows.size + CHUNK - 1) // CHUNK):
        for r in range(chunk * CHUNK, min(rows.size, (chunk + 1) * CHUNK)):
            c = rows[r]
            if j[c] < grains and lane[c] >= 0:
                q, k = lane[c] // LANES, lane[c] % LANES
                nx, ny, mu = frame[q, NX, k], frame[q, NY, k], frame[q, MU, k]
                q_n, p_t = impulse[q, NORMAL, k], impulse[q, TANGENTIAL, k]
                was_n, was_t = before[q, NORMAL, k], before[q, TANGENTIAL, k]
                u_n, u_t = relative_velocity(after, i[c], j[c], nx, ny, False, 0.0, 0.0)
                if scene.height > 0.0:
                    more_n, more_t = stretch_along(
                        after, grains, branch[q, X, k], branch[q, Y, k], nx, ny
                    )
                    u_n, u_t = u_n + more_n, u_t + more_t
            else:
                contact = contacts[c]
                q_n, p_t, mu = contact.p_n, contact.p_t, contact.mu
                was_n, was_t = contact.u_n, contact.u_t
                u_n, u_t = contact_after(c, scene, contacts, after)
            slip, friction = 0.5 * (was_t + u_t), 0.0
            work = -p_t * slip
            if rule == ENERGY:
                friction = work if is_plain else work + rolling_loss(c, scene, contacts, after)
            elif rule == SLIDING:
                friction = sliding_power(mu, q_n, u_t)
                friction += 0.0 if is_plain else rolled_loss(c, scene, contacts, after)
            heat[c, FRICTION], rubbing[c] = friction, rubbing_of(q_n, slip, work, mu)
            if has_impact:
                heat[c, IMPACT] = -q_n * 0.5 * (was_n + u_n)


@kernel
def sliding_heat(scene: Scene, solved: Solved, rule: int, heat: Floats) -> Floats:
    """Heat of friction without that of couples [J], shape ``(c,)``: what slides makes a flash."""
    sliding = heat[:, FRICTION].copy()
    for c in range(sliding.size):
        if sliding[c] == 0.0:
            continue
        if rule == ENERGY:
            sliding[c] -= rolling_loss(c, scene, solved.contacts, solved.after)
        else:
            sliding[c] -= rolled_loss(c, scene, solved.contacts, solved.after)
    return sliding


@parallel_kernel
def generate(
    scene: Scene, solved: Solved, rule: int, has_impact: bool, laws: HeatLaws, share: Floats,
    takes_heat: NDArray[np.bool_], normal: Floats, heat: Floats, rubbing: Floats,
    generated: Floats, source: Floats, wall_source: Floats, wear: Floats, wall_wear: Floats,
) -> Floats:  # fmt: skip
    """`generated_heat`, `share_out` and `wear_off`; returns the heat of friction and impacts [J].

    **Modifies** ``normal``, impulses q_n of the contacts [N s], shape ``(c,)``, too. ``heat`` of
    contacts that do not bear is to be 0.
    """
    i, j, rows = solved.i, solved.j, loaded_rows(scene.radius.size, solved, normal)
    generated_heat(scene, solved, rows, rule, has_impact, heat, rubbing)
    share_out(scene, i, j, rows, heat, share, takes_heat, generated, source, wall_source)
    if laws.wear.max() > 0.0:
        wear_off(scene, i, j, rows, rubbing, laws, wear, wall_wear)
    return column_totals(heat)
