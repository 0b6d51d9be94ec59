"""Which share of the heat of friction goes into each of the two bodies: β into body i, 1 − β into body j.

Formulas and sources: *effusivity* ``β = e_i/(e_i + e_j)``, ``e = √(λρc)`` (F. Charron, Publ. Sci. Tech. Min. Air 182 (1943));
*conductivity* ``β = λ_i/(λ_i + λ_j)`` (steady conduction from one spot, J. C. Jaeger, Proc. R. Soc. NSW 76 (1942) 203);
*electrothermal* ``β = ½ [ρ_i/(ρ_i + ρ_j) + λ_i/(λ_i + λ_j)]`` with the electrical resistivities ρ (the coefficient of Mokrani
and Bourouga used by Nguyen et al., J. Mech. Mater. Struct. 4 (2009) 413).

Validity: all take perfect contact of the two surfaces and both bodies at one temperature far from the spot. *effusivity* holds
for contacts shorter than the diffusion time over the spot (both bodies semi-infinite): sliding, impacts. *conductivity* holds
for lasting contacts, steady on the scale of the spot. *electrothermal* describes the heat of an electric current through the
interface; it has no meaning for friction. It equals ½ for one material, as do the others, and is offered to repeat published
results.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.heat.wear import archard_volume
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.model.columns import FRICTION, IMPACT
from multicor_cli.model.model import Floats, Ints

if TYPE_CHECKING:
    from multicor_cli.engine.heat.laws import HeatLaws

Partition = Literal["effusivity", "conductivity", "half", "electrothermal"]


def effusivity(k: float, rho: float, c: float) -> float:
    """Thermal effusivity ``e = √(λ ρ c)`` [W s^½/(m² K)]; λ [W/(m K)], ρ [kg/m³], c [J/(kg K)]."""
    return sqrt(k * rho * c)


def effusivity_share(e_i: float, e_j: float) -> float:
    """Share of body i ``e_i/(e_i + e_j)`` from the effusivities (Charron 1943)."""
    return e_i / (e_i + e_j)


def conductivity_share(k_i: float, k_j: float) -> float:
    """Share of body i ``λ_i/(λ_i + λ_j)`` from the conductivities [W/(m K)] (Jaeger 1942, steady)."""
    return k_i / (k_i + k_j)


def electrothermal_share(resistivity_i: float, resistivity_j: float, k_i: float, k_j: float) -> float:
    """Share of body i ``½ [ρ_i/(ρ_i + ρ_j) + λ_i/(λ_i + λ_j)]`` (Mokrani & Bourouga): of the heat of a *current*, not of friction.

    Args:
        resistivity_i: Electrical resistivity ρ_i [Ω m].
        resistivity_j: Electrical resistivity ρ_j [Ω m].
        k_i: Thermal conductivity λ_i [W/(m K)].
        k_j: Thermal conductivity λ_j [W/(m K)].
    """
    return 0.5 * (resistivity_i / (resistivity_i + resistivity_j) + k_i / (k_i + k_j))


def _by_effusivity(k_i: float, rho_i: float, c_i: float, k_j: float, rho_j: float, c_j: float) -> float:
    return effusivity_share(effusivity(k_i, rho_i, c_i), effusivity(k_j, rho_j, c_j))


def _by_electrothermal(k_i: float, resistivity_i: float, k_j: float, resistivity_j: float) -> float:
    return electrothermal_share(resistivity_i, resistivity_j, k_i, k_j)


SHARES: dict[Partition, tuple[Callable[..., float], tuple[str, ...]]] = {
    "effusivity": (_by_effusivity, ("conductivity", "density", "heat_capacity")),
    "conductivity": (conductivity_share, ("conductivity",)),
    "half": (lambda: 0.5, ()),
    "electrothermal": (_by_electrothermal, ("conductivity", "resistivity")),
}
"""Share of the first body, from these properties of the first body and then of the second."""


@kernel
def share_out(
    scene: Scene,
    i: Ints,
    j: Ints,
    heat: Floats,
    rubbing: Floats,
    laws: HeatLaws,
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
        total = heat[c, FRICTION] + heat[c, IMPACT]
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
