"""Heat across gaps: which pairs are near enough, what the gas between them conducts, and how they radiate at each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.contact.detection import Scene, pair_geometry
from multicor_cli.engine.heat.contact_loops import Thermals, effective_radius, pair_radius
from multicor_cli.engine.heat.convection import coefficient as convective_coefficient
from multicor_cli.engine.heat.convection import gunn, li_mason, ranz_marshall, reynolds, whitaker
from multicor_cli.engine.heat.gap import (
    batchelor_conductance,
    parallel_conductance,
    parallel_conductance_wall,
    solid_to_gas_ratio,
    vargas_conductance,
)
from multicor_cli.engine.heat.radiation import cylinder_view_factor, sphere_area_factor
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.model.model import Floats, Ints

PARALLEL, BATCHELOR, VARGAS = 0, 1, 2
"""Formulas of the gas in a gap."""

CORE = 0.1
"""Largest radius, over that of the grain, within which the solid is taken to resist more than the gas."""


@kernel
def _smaller_radius(scene: Scene, laws: Thermals, i: int, j: int) -> float:
    count = scene.radius.size
    a = scene.radius[i]
    b = scene.radius[j] if j < count else laws.shape_radius[j - count]
    return min(a, b) if b > 0.0 else a


@kernel
def near_pairs(scene: Scene, laws: Thermals, row: NDArray[np.int64], partner: Ints, reach: float) -> tuple[Ints, Ints, Floats]:
    """Pairs whose gap does not exceed ``reach`` times the smaller radius: i, j and gap [m], sorted by (i, j).

    Args:
        scene: Shapes.
        laws: Radii of the wall shapes.
        row: Rows of a neighbor list, shape ``(n + 1,)``.
        partner: Partners in the list, ascending within a row.
        reach: Largest gap over the smaller radius.
    """
    room = partner.size
    i_of, j_of, gap_of = np.empty(room, np.int32), np.empty(room, np.int32), np.empty(room)
    found = 0
    for i in range(row.size - 1):
        for p in range(row[i], row[i + 1]):
            gap = pair_geometry(scene, i, partner[p])[0]
            if gap <= reach * _smaller_radius(scene, laws, i, partner[p]):
                i_of[found], j_of[found], gap_of[found] = i, partner[p], gap
                found += 1
    return i_of[:found].copy(), j_of[:found].copy(), gap_of[:found].copy()


@kernel
def gas_conductances(
    scene: Scene, laws: Thermals, model: int, gas_conductivity: float, i: Ints, j: Ints, gap: Floats, spot: Floats, out: Floats
) -> tuple[float, float]:
    """Conductance of the gas around each contact and in each gap [W/K], added to ``out``.

    Args:
        scene: Shapes.
        laws: Properties of materials.
        model: Formula.
        gas_conductivity: λ_f [W/(m K)].
        i: Grains, shape ``(e,)``.
        j: Grains or wall shapes, shape ``(e,)``.
        gap: Gaps [m], shape ``(e,)``.
        spot: Radii of the contacts [m]; 0 where there is none, shape ``(e,)``.
        out: [W/K], shape ``(e,)``. **Modified.**

    Returns:
        Smallest and largest λ_s s/(λ_f a) of the contacts; 0 if there are none.
    """
    count = scene.radius.size
    least, most = np.inf, 0.0
    for k in range(i.size):
        a, b = scene.material[i[k]], scene.material[j[k]]
        radius = scene.radius[i[k]]
        other = scene.radius[j[k]] if j[k] < count else laws.shape_radius[j[k] - count]
        open_gap = max(gap[k], 0.0)
        mean_radius = 2.0 * effective_radius(radius, other) if other > 0.0 else radius
        # Nearer to the axis than this the solid resists more than the gas, whose flux would grow without bound.
        core = max(spot[k], mean_radius * min(CORE, gas_conductivity / laws.harmonic[a, b]))
        if model == PARALLEL and other > 0.0:
            out[k] += parallel_conductance(gas_conductivity, radius, other, core, open_gap)
        elif model == PARALLEL:
            out[k] += parallel_conductance_wall(gas_conductivity, radius, core, open_gap)
        elif model == BATCHELOR:
            out[k] += batchelor_conductance(
                gas_conductivity, laws.harmonic[a, b], pair_radius(scene, laws, i[k], j[k]), spot[k], open_gap
            )
        elif spot[k] > 0.0 or gap[k] <= 0.0:  # a formula for spheres that touch
            out[k] += vargas_conductance(gas_conductivity, mean_radius, spot[k])
        if spot[k] > 0.0:
            ratio = solid_to_gas_ratio(laws.harmonic[a, b], spot[k], gas_conductivity, mean_radius)
            least, most = min(least, ratio), max(most, ratio)
    return (least, most) if most > 0.0 else (0.0, 0.0)


@kernel
def radiating_areas(scene: Scene, laws: Thermals, surface: Floats, is_sphere: bool, i: Ints, j: Ints, gap: Floats) -> Floats:
    """Area factors of radiation between near bodies [m²], shape ``(e,)``.

    Spheres: the smaller cross-section π a² times the emission factor. Discs: the view factor of two parallel cylinders times the
    surface of the first and the emission factor; a plane counts as a sphere or cylinder of the grain's own radius.

    Args:
        scene: Shapes.
        laws: Properties of materials.
        surface: Surfaces of the grains [m²], shape ``(n,)``.
        is_sphere: Whether grains are spheres.
        i: Grains, shape ``(e,)``.
        j: Grains or wall shapes, shape ``(e,)``.
        gap: Gaps [m], shape ``(e,)``.
    """
    count = scene.radius.size
    area = np.empty(i.size)
    for k in range(i.size):
        emission = laws.emission[scene.material[i[k]], scene.material[j[k]]]
        radius = scene.radius[i[k]]
        other = scene.radius[j[k]] if j[k] < count else laws.shape_radius[j[k] - count]
        other = other if other > 0.0 else radius
        if is_sphere:
            area[k] = sphere_area_factor(emission, radius, other)
        else:
            view = cylinder_view_factor(radius, other, max(gap[k], 0.0))
            area[k] = emission * view * surface[i[k]]
    return area


@kernel
def resting_contacts(scene: Scene, i: Ints, j: Ints, gap: Floats, normal: Floats) -> None:
    """Gaps [m] and normals of pairs in a state at rest, shapes ``(c,)`` and ``(c, 2)``; the last two are **modified**."""
    for k in range(i.size):
        gap[k], normal[k, 0], normal[k, 1] = pair_geometry(scene, i[k], j[k])


RANZ_MARSHALL, WHITAKER, GUNN, LI_MASON = 0, 1, 2, 3
"""Correlations of the Nusselt number."""

DENSE = 4.75
"""Exponent of the porosity in the correlation of Li & Mason for dense beds."""


@kernel
def convection_coefficients(
    correlation: int,
    speed: Floats,
    radius: Floats,
    conductivity: float,
    viscosity: float,
    prandtl: float,
    porosity: float,
    coefficient: Floats,
) -> None:
    """Coefficient of convection of every grain from a correlation of the Nusselt number [W/(m² K)].

    Args:
        correlation: Which one.
        speed: Speed relative to the fluid [m/s], shape ``(n,)``.
        radius: Radii [m], shape ``(n,)``.
        conductivity: λ_f [W/(m K)].
        viscosity: Kinematic viscosity [m²/s].
        prandtl: Prandtl number.
        porosity: Volume fraction of the fluid.
        coefficient: [W/(m² K)], shape ``(n,)``. **Modified.**
    """
    for k in range(radius.size):
        re = reynolds(speed[k], 2.0 * radius[k], viscosity)
        if correlation == RANZ_MARSHALL:
            nusselt = ranz_marshall(re, prandtl)
        elif correlation == WHITAKER:
            nusselt = whitaker(re, prandtl)
        elif correlation == GUNN:
            nusselt = gunn(re, prandtl, porosity)
        else:
            nusselt = li_mason(re, prandtl, porosity, DENSE)
        coefficient[k] = convective_coefficient(nusselt, conductivity, 2.0 * radius[k])
