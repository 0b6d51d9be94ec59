"""What each contact of a step does to heat: the heat it generates, the spot through which it conducts, and who gets what."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.detection import Contacts, Scene
from multicor_cli.engine.energy.account import contact_after
from multicor_cli.engine.heat.collision import impact_exchange
from multicor_cli.engine.heat.conduction import biot_number, contact_radius, effective_radius, hertz_conductance
from multicor_cli.engine.heat.friction import sliding_power
from multicor_cli.engine.heat.rough import rough_conductance
from multicor_cli.engine.heat.wear import archard_volume, rubbing_of
from multicor_cli.engine.jit.chunks import CHUNK
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.model.model import Floats, Ints

NO_FRICTION, ENERGY, SLIDING = 0, 1, 2
"""Rules of the heat of friction."""


class Thermals(NamedTuple):
    """`multicor_cli.engine.heat.settings.HeatLaws` as the kernels see it, with what depends on the shapes.

    Attributes:
        conductivity: λ by material [W/(m K)].
        volumetric: ρ c_p by material [J/(m³ K)].
        modulus: E* by pair of materials [Pa].
        harmonic: λ_h by pair [W/(m K)].
        share: β of the first of a pair.
        emission: Emission factor of radiation by pair.
        roughness: σ by pair [m].
        slope: Mean slope of the asperities by pair.
        microhardness: By pair [Pa].
        wear: K/H of the first of a pair [1/Pa].
        shape_radius: Radius of the wall shapes that are discs, 0 for lines and circles [m], shape ``(m,)``.
    """

    conductivity: Floats
    volumetric: Floats
    modulus: Floats
    harmonic: Floats
    share: Floats
    emission: Floats
    roughness: Floats
    slope: Floats
    microhardness: Floats
    wear: Floats
    shape_radius: Floats


@kernel
def pair_radius(scene: Scene, laws: Thermals, i: int, j: int) -> float:
    """a* of a pair [m]; a* = a_i at lines and circles."""
    count = scene.radius.size
    a = scene.radius[i]
    b = scene.radius[j] if j < count else laws.shape_radius[j - count]
    return effective_radius(a, b) if b > 0.0 else a


@parallel_kernel
def generated_heat(
    scene: Scene, contacts: Contacts, after: Floats, rule: int, has_impact: bool, heat: Floats, rubbing: Floats
) -> None:
    """Heat generated in each contact of a step, and the product of force and slipped distance that wears.

    ``"energy"``: −p_t ½(u_t⁻+u_t⁺), exact and signed; ``"sliding"``: μ|u_t⁺| p_n (the paper's E_f); impacts: −p_n ½(u_n⁻+u_n⁺).
    Rubbing is the work of friction over μ: p_n times the slipped distance where a contact slides, less where it sticks.

    Args:
        scene: Shapes at q_m.
        contacts: Contacts with their impulses.
        after: Body velocities v⁺, shape ``(bodies, 4)``.
        rule: Rule of the heat of friction.
        has_impact: Whether the energy of impacts counts.
        heat: Heat of friction, heat of impacts [J], shape ``(c, 2)``. **Modified.**
        rubbing: Force times distance [N m], shape ``(c,)``. **Modified.**
    """
    count = contacts.i.size
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        for c in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            heat[c, 0], heat[c, 1], rubbing[c] = 0.0, 0.0, 0.0
            p_n, p_t = contacts.impulse[c, 0], contacts.impulse[c, 1]
            if p_n > 0.0:
                u_n, u_t = contact_after(c, scene, contacts, after)
                mu, slip = contacts.frame[c, 4], 0.5 * (contacts.before[c, 1] + u_t)
                work = -p_t * slip
                if rule == ENERGY:
                    heat[c, 0] = work
                elif rule == SLIDING:
                    heat[c, 0] = sliding_power(mu, p_n, u_t)
                if has_impact:
                    heat[c, 1] = -p_n * 0.5 * (contacts.before[c, 0] + u_n)
                rubbing[c] = rubbing_of(p_n, slip, work, mu)


@parallel_kernel
def contact_spots(
    scene: Scene, i: Ints, j: Ints, force: Floats, laws: Thermals, is_rough: bool, spot: Floats, conductance: Floats
) -> None:
    """Hertz radius and conductance of contacts under given normal forces.

    Args:
        scene: Shapes.
        i: Grains, shape ``(c,)``.
        j: Grains or wall shapes, shape ``(c,)``.
        force: Normal forces [N], shape ``(c,)``.
        laws: Properties of materials.
        is_rough: Whether micro-contacts add their resistance.
        spot: Contact radii a_c [m], shape ``(c,)``. **Modified.**
        conductance: H_c [W/K], shape ``(c,)``. **Modified.**
    """
    count = i.size
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        for c in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            spot[c], conductance[c] = 0.0, 0.0
            if force[c] > 0.0:
                a, b = scene.material[i[c]], scene.material[j[c]]
                curvature, modulus, harmonic = pair_radius(scene, laws, i[c], j[c]), laws.modulus[a, b], laws.harmonic[a, b]
                radius = contact_radius(force[c], curvature, modulus)
                h = hertz_conductance(harmonic, radius)
                if is_rough:
                    sigma, slope, hardness = laws.roughness[a, b], laws.slope[a, b], laws.microhardness[a, b]
                    h = rough_conductance(force[c], radius, modulus, curvature, harmonic, sigma, slope, hardness)
                spot[c], conductance[c] = radius, h


@kernel
def largest_biot(scene: Scene, i: Ints, j: Ints, conductance: Floats, laws: Thermals) -> float:
    """Largest Biot number H/(λ a) of the grains at some links; arguments as `contact_spots`; 0 if there are none."""
    grains, most = scene.radius.size, 0.0
    for k in range(i.size):
        if conductance[k] > 0.0:
            most = max(most, biot_number(conductance[k], laws.conductivity[scene.material[i[k]]], scene.radius[i[k]]))
            if j[k] < grains:
                most = max(most, biot_number(conductance[k], laws.conductivity[scene.material[j[k]]], scene.radius[j[k]]))
    return most


@kernel
def collide(
    scene: Scene, mass: Floats, contacts: Contacts, is_known: NDArray[np.bool_], laws: Thermals, dt: float, conductance: Floats
) -> None:
    """Replace the conductance of contacts that are new in this step by that of an impact, spread over the step (Sun & Chen).

    Args:
        scene: Shapes.
        mass: Masses of the grains [kg], shape ``(n,)``.
        contacts: Contacts with their impulses.
        is_known: Whether a contact carried an impulse in the step before, shape ``(c,)``.
        laws: Properties of materials.
        dt: Time step [s].
        conductance: [W/K], shape ``(c,)``. **Modified.**
    """
    grains = scene.radius.size
    for c in range(contacts.i.size):
        speed = -contacts.before[c, 0]
        if contacts.impulse[c, 0] > 0.0 and speed > 0.0 and not is_known[c]:
            i, j = contacts.i[c], contacts.j[c]
            a, b = scene.material[i], scene.material[j]
            m = mass[i] * mass[j] / (mass[i] + mass[j]) if j < grains else mass[i]
            exchange = impact_exchange(
                m, pair_radius(scene, laws, i, j), laws.modulus[a, b], speed, laws.conductivity[a], laws.volumetric[a],
                laws.conductivity[b], laws.volumetric[b],
            )  # fmt: skip
            conductance[c] = exchange / dt


@kernel
def share_out(
    scene: Scene,
    i: Ints,
    j: Ints,
    heat: Floats,
    rubbing: Floats,
    laws: Thermals,
    takes_heat: NDArray[np.bool_],
    source: Floats,
    wall_source: Floats,
    wear: Floats,
    wall_wear: Floats,
) -> None:
    """Give the heat of each contact to its two bodies; a wall that takes none leaves it all to the grain.

    Args:
        scene: Shapes.
        i: Grains, shape ``(c,)``.
        j: Grains or wall shapes, shape ``(c,)``.
        heat: Heat of friction and of impacts [J], shape ``(c, 2)``.
        rubbing: Force times slipped distance [N m], shape ``(c,)``.
        laws: Properties of materials.
        takes_heat: Whether a wall takes its share, shape ``(w,)``.
        source: Heat received by the grains in this step [J], shape ``(n,)``. **Modified** (added to).
        wall_source: The same for the walls, shape ``(w,)``. **Modified.**
        wear: Volume worn off the grains [m³], shape ``(n,)``. **Modified.**
        wall_wear: The same for the walls, shape ``(w,)``. **Modified.**
    """
    grains = scene.radius.size
    for c in range(i.size):
        a, b = scene.material[i[c]], scene.material[j[c]]
        total = heat[c, 0] + heat[c, 1]
        mine = laws.share[a, b] * total
        wear[i[c]] += archard_volume(laws.wear[a, b], rubbing[c])
        if j[c] < grains:
            source[i[c]] += mine
            source[j[c]] += total - mine
            wear[j[c]] += archard_volume(laws.wear[b, a], rubbing[c])
        else:
            wall = scene.wall[j[c] - grains]
            wall_wear[wall] += archard_volume(laws.wear[b, a], rubbing[c])
            if takes_heat[wall]:
                source[i[c]] += mine
                wall_source[wall] += total - mine
            else:
                source[i[c]] += total


@kernel
def look_up(row: NDArray[np.int64], known_j: Ints, values: Floats, i: Ints, j: Ints, found: Floats) -> None:
    """Values of pairs in a table sorted by (i, j); 0 for pairs that are not in it.

    Args:
        row: First row of each grain in the table, shape ``(n + 1,)``.
        known_j: Second shapes in the table.
        values: Values in the table.
        i: First shapes of the pairs asked for, shape ``(c,)``.
        j: Second shapes, shape ``(c,)``.
        found: Values, shape ``(c,)``. **Modified.**
    """
    for c in range(i.size):
        found[c] = 0.0
        for k in range(row[i[c]], row[i[c] + 1]):
            if known_j[k] == j[c]:
                found[c] = values[k]
