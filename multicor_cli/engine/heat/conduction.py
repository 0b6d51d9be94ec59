"""Conduction through the contact spot of two smooth elastic spheres.

Formula: Hertz' contact radius ``a_c = (3 F a*/4E*)^⅓`` and the constriction of the heat flow on
both sides of an isothermal spot between half-spaces in series, ``H = 2 λ_h a_c`` with
``λ_h = 2 λ_i λ_j/(λ_i + λ_j)``.

Source: K. L. Johnson, Contact Mechanics (1985), eq. 4.22–4.24 (radius, approach, pressure); R.
Holm, Electric Contacts (1967), and G. K. Batchelor & R. W. O'Brien, Proc. R. Soc. Lond. A 355
(1977) 313 (constriction); W. L. Vargas & J. J. McCarthy, AIChE J. 47 (2001) 1052 (use for grains).

Validity: smooth, elastic, non-adhesive spheres with ``a_c ≪ a`` in vacuum; the grains must be
nearly isothermal inside, which the Biot number ``H/(λ a) ≪ 1`` measures. Steel of 215 MPa yields
first at the center of the spot where ``p_0 ≈ 1.6 σ_y``, already at 0.011 N for grains of 3 mm; the
spot is then larger than computed. Contacts in parallel on one grain do not disturb each other.
Pieces of walls that a grain touches in one place (`engine/geometry/places.py`) have one spot, which
the sum of their forces makes, and share its conductance in proportion to their forces. Inside a
circle of radius R ``1/a* = 1/a − 1/R``. Discs and circles are treated as spheres of their radius: a
line contact in two dimensions has no conductance that is independent of the size of the bodies (its
constriction resistance is logarithmic).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from multicor_cli.engine.geometry.places import totals_of_places
from multicor_cli.engine.geometry.radii import hertz_radius
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.heat.hertz import contact_radius, rough_conductance
from multicor_cli.engine.jit.chunks import CHUNK
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.model import Floats, Ints

if TYPE_CHECKING:
    from multicor_cli.engine.heat.mechanism import HeatLaws

Conduction = Literal["hertz", "rough", "none"]


@dataclass(frozen=True)
class ContactForce:
    """Which normal force makes the Hertz contact radius.

    ``"step"``: that of the step p_n/Δt; ``"average"``: a running average over ``value`` [s];
    ``"prescribed"``: ``value`` [N] for all contacts that carry a force.
    """

    kind: Literal["step", "average", "prescribed"] = "step"
    value: float = 0.0


def harmonic_mean(first: float, second: float) -> float:
    """Harmonic mean ``λ_h = 2 λ_i λ_j/(λ_i + λ_j)`` [W/(m K)]: half-spaces in series (Holm)."""
    return 2.0 * first * second / (first + second)


@formula
def hertz_conductance(harmonic: float, contact_radius: float) -> float:
    """``H = 2 λ_h a_c`` of a spot [W/K]; λ_h [W/(m K)], a_c [m] (Holm; Batchelor & O'Brien)."""
    return 2.0 * harmonic * contact_radius


@formula
def biot_number(conductance: float, conductivity: float, radius: float) -> float:
    """Biot number ``Bi = H/(λ a)``, to be ≪ 1: H [W/K], λ [W/(m K)], radius a [m] of a grain."""
    return conductance / (conductivity * radius)


@parallel_kernel
def contact_spots(
    scene: Scene,
    i: Ints,
    j: Ints,
    force: Floats,
    total: Floats,
    laws: HeatLaws,
    is_rough: bool,
    spot: Floats,
    conductance: Floats,
) -> None:
    """Hertz radius of the spots, and conductance of contacts under given normal forces.

    ``force`` is that of each contact, ``total`` that of its place [N]; ``is_rough``: micro-contacts
    add their resistance. **Modifies** ``spot``, radii a_c of the places [m], and ``conductance``,
    the H_c of a place shared as the forces [W/K], of shape ``(c,)`` as all of these.
    """
    count = i.size
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        for c in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            spot[c], conductance[c] = 0.0, 0.0
            if force[c] > 0.0:
                a, b = scene.material[i[c]], scene.material[j[c]]
                curvature, modulus, harmonic = (
                    hertz_radius(scene, i[c], j[c]),
                    laws.modulus[a, b],
                    laws.harmonic[a, b],
                )
                radius = contact_radius(total[c], curvature, modulus)
                h = hertz_conductance(harmonic, radius)
                if is_rough:
                    sigma, slope, hardness = (
                        laws.roughness[a, b],
                        laws.slope[a, b],
                        laws.microhardness[a, b],
                    )
                    h = rough_conductance(
                        total[c], radius, modulus, curvature, harmonic, sigma, slope, hardness
                    )
                spot[c], conductance[c] = radius, h * (force[c] / total[c])


@kernel
def largest_biot(
    scene: Scene, i: Ints, j: Ints, place: Ints, conductance: Floats, laws: HeatLaws
) -> float:
    """Largest Biot number H/(λ a) of the grains at some links, of whole places; 0 without any.

    Arguments as `contact_spots`; ``place`` of each link is as `find_places` has it.
    """
    grains, most = scene.radius.size, 0.0
    total = totals_of_places(place, conductance)
    for k in range(i.size):
        if conductance[k] > 0.0:
            most = max(
                most,
                biot_number(total[k], laws.conductivity[scene.material[i[k]]], scene.radius[i[k]]),
            )
            if j[k] < grains:
                most = max(
                    most,
                    biot_number(
                        total[k], laws.conductivity[scene.material[j[k]]], scene.radius[j[k]]
                    ),
                )
    return most
