"""Heat that contacts generate: sliding friction, its share in each body, wear, and impacts.

Formulas: the energy lost in a step, ``−p_t ½(u_t⁻ + u_t⁺)`` and ``−p_n ½(u_n⁻ + u_n⁺)``, or
``Q = μ F_n |u_t|`` (both derived: the work of Coulomb's law).

Validity: the power is that of a contact that slides with the velocity u_t all through the step.
Temperatures are those of grains; the spot itself may be much hotter for an instant. The law of
friction is elsewhere: `contact/law.py`, and μ in `contact/contacts.py`.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.contacts import (
    Contacts,
    contact_after,
    relative_velocity,
    stretch_along,
)
from multicor_cli.engine.contact.rolling import rolled_loss, rolling_loss
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.heat.mechanism import HeatLaws
from multicor_cli.engine.jit.arrays import CHUNK, column_totals
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange, subroutine
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.engine.jit.vectors import LANES
from multicor_cli.model.columns import FRICTION, IMPACT, MU, NORMAL, NX, NY, TANGENTIAL, X, Y
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
