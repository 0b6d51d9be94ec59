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
from typing import Literal

from multicor_cli.engine.heat.hertz import contact_volume, rough_conductance
from multicor_cli.engine.jit.arrays import CHUNK, cube_roots
from multicor_cli.engine.jit.compile import kernel, parallel_kernel, prange
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.model import Floats

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
def biot_number(conductance: float, inner: float) -> float:
    """Biot number ``Bi = H/(λ a)``, to be ≪ 1: H [W/K], and ``inner`` λ a of a grain [W/K]."""
    return conductance / inner


@parallel_kernel
def hertz_spots(
    force: Floats, radius: Floats, modulus: Floats, harmonic: Floats, spot: Floats,
    conductance: Floats,
) -> None:  # fmt: skip
    """Spots of smooth contacts under given normal forces [N], and their conductances.

    a*, E* and λ_h of the contacts as in `Touching`. **Modifies** ``spot``, radii a_c [m], and
    ``conductance`` H_c [W/K]; all of shape ``(c,)``.
    """
    count = force.size
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        first, last = chunk * CHUNK, min(count, (chunk + 1) * CHUNK)
        for c in range(first, last):
            spot[c] = contact_volume(force[c], radius[c], modulus[c])
        cube_roots(spot[first:last])
        for c in range(first, last):
            conductance[c] = hertz_conductance(harmonic[c], spot[c])


@kernel
def roughen(
    force: Floats, radius: Floats, modulus: Floats, harmonic: Floats, roughness: Floats,
    slope: Floats, microhardness: Floats, spot: Floats, conductance: Floats,
) -> None:  # fmt: skip
    """Conductances of rough contacts with these spots; arguments as `hertz_spots`, `HeatLaws`."""
    for c in range(force.size):
        conductance[c] = rough_conductance(
            force[c], spot[c], modulus[c], radius[c], harmonic[c], roughness[c], slope[c],
            microhardness[c],
        )  # fmt: skip


@kernel
def largest_biot(conductance: Floats, weakest: Floats) -> float:
    """Largest Biot number H/(λ a) of the grains at some links; 0 without any.

    ``conductance`` is that of the place of each link, ``weakest`` the smaller λ a of its grains
    [W/K], both of shape ``(e,)``.
    """
    most = 0.0
    for k in range(conductance.size):
        most = max(most, biot_number(conductance[k], weakest[k]))
    return most
