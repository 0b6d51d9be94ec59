"""Conduction through stagnant gas in the gap between two grains, or a grain and a plane wall.

Formulas and sources:

* *parallel*: heat flows along straight lines parallel to the line of centers, through the local gap
  width; the integral ``H = 2π λ_f ∫_s^a ρ dρ/(h + 2a − 2√(a²−ρ²))`` in closed form (derived; the
  assumption is that of D. Rong & M. Horio, CFD in the Minerals and Process Industries (1999) 65).
* *batchelor*: asymptotics of the boundary-value problem for nearly touching spheres, G. K.
  Batchelor & R. W. O'Brien, Proc. R. Soc. Lond. A 355 (1977) 313.
* *vargas*: closed form for touching spheres of one size, W. L. Vargas & J. J. McCarthy, Int. J.
  Heat Mass Transf. 45 (2002) 4847.

Validity: stagnant gas without convection in the pores, a continuum (gaps wide against the mean free
path), and grains nearly isothermal inside. *parallel* and *vargas* take the surfaces as isothermal,
that is ``λ_s ≫ λ_f``, and add to the conductance of the contact spot; *batchelor* needs
``λ_s/λ_f ≫ 1`` (10 at least) and counts the gradient in the solid near the spot. All reach to the
rim of the smaller sphere, so shares of neighboring gaps may overlap: an upper estimate. A circle of
radius R counts as a plane, which it is along the axis of a drum: the film there conducts 1/√(1 −
a/R) times as much to leading order, and a polygon that stands for the circle is flat too. Gas may
be left out only if ``λ_s s/(λ_f a) ≫ 1`` (`solid_to_gas_ratio`), which fails in air for steel
grains of millimeters under their own weight.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from multicor_cli.arithmetic import log
from multicor_cli.engine.geometry.radii import effective_radius, other_radius, pair_radius
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.heat.mechanism import HeatLaws, Mechanism, NearPairs, PairTransfer
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.model import Floats, Ints, Model

GasModel = Literal["parallel", "batchelor", "vargas"]

PARALLEL, BATCHELOR, VARGAS = 0, 1, 2
"""Formulas of the gas in a gap."""

_NUMBER: dict[GasModel, int] = {"parallel": PARALLEL, "batchelor": BATCHELOR, "vargas": VARGAS}

CORE = 0.1
"""Largest radius, over the grain's, within which the solid is taken to resist more than the gas."""

SMALLEST_SPOT = 1e-9
"""Smallest spot of touching spheres [m]: atoms end the continuum, and the log would diverge."""


@dataclass(frozen=True)
class Gas(Mechanism):
    """Stagnant gas of conductivity λ_f [W/(m K)] in gaps up to ``reach`` smaller radii."""

    conductivity: float
    model: GasModel = "parallel"
    reach: float = 0.4

    def between(self, near: NearPairs, scene: Scene, laws: HeatLaws, model: Model) -> PairTransfer:
        conductance = np.zeros(near.i.size)
        outlines = near.outlines
        counts = np.ones(near.i.size, np.bool_) if outlines is None else outlines.is_of_discs()
        ratio = gas_conductances(
            scene, laws, _NUMBER[self.model], self.conductivity, counts, near.i, near.j, near.gap,
            near.spot, conductance,
        )  # fmt: skip
        if outlines is not None:
            outlines.add_films(
                laws, self.conductivity, self.reach, near.i, near.j, near.spot, conductance
            )
        return PairTransfer(conductance, gas_ratio=ratio)


@formula
def parallel_conductance(
    gas_conductivity: float, radius_i: float, radius_j: float, spot: float, gap: float
) -> float:
    """Parallel-flux conductance of the gas between two spheres
    ``H = π λ_f [D ln((D−y)/(D−z)) − (z − y)]`` [W/K].

    ``z = √(a²−s²)``, ``y = √(a²−r²)``, ``D = a + h/2``, ``a = 2a*``, r the smaller radius. For
    equal spheres y = 0 and it is the exact integral, touching (h = 0) or not. Unequal ones have the
    gap of equal ones of the same a*, right near the axis where most heat passes, up to the rim r of
    the smaller. This is too large by at most 1.6 % at a size ratio of 1.5, 2.8 % at 2, 4.2 % at 3
    and 8 % at any, for gaps up to 0.4 r, and by half of that or less where they touch and s is
    below r/100.

    λ_f [W/(m K)], radii [m]; spot radius s [m], `SMALLEST_SPOT` at least, from r on no gap is left:
    0; gap h [m], of which an overlap counts as 0.
    """
    small = radius_i if radius_i < radius_j else radius_j
    large = radius_j if radius_i < radius_j else radius_i
    a = 2.0 * small * large / (small + large)
    s = spot if spot > SMALLEST_SPOT else SMALLEST_SPOT
    if s >= small:
        return 0.0
    half = 0.5 * gap if gap > 0.0 else 0.0
    z = sqrt(a * a - s * s)
    # Both without cancellation: a² − r², exactly 0 for equal spheres, and a − z = s²/(a + z).
    y = small * sqrt((large - small) * (3.0 * large + small)) / (small + large)
    width = a + half
    return pi * gas_conductivity * (width * log((width - y) / (half + s * s / (a + z))) - (z - y))


@formula
def parallel_conductance_wall(
    gas_conductivity: float, radius: float, spot: float, gap: float
) -> float:
    """Parallel-flux conductance of the gas between a sphere and a plane
    ``H = 2π λ_f [D ln(D/(D−z)) − z]`` [W/K], exact.

    ``z = √(a²−s²)`` and ``D = a + h``; at the same spot and h = 0 twice the conductance between two
    such spheres. Arguments as `parallel_conductance`; 0 from s = a on.
    """
    s = spot if spot > SMALLEST_SPOT else SMALLEST_SPOT
    if s >= radius:
        return 0.0
    opening = gap if gap > 0.0 else 0.0
    z = sqrt(radius * radius - s * s)
    width = radius + opening
    return 2.0 * pi * gas_conductivity * (width * log(width / (opening + s * s / (radius + z))) - z)


@formula
def parallel_between(
    gas_conductivity: float, mean_radius: float, near: float, far: float, half_gap: float
) -> float:  # fmt: skip
    """As `parallel_conductance`, of what is farther from the axis than ``near``, up to ``far``.

    ``mean_radius`` is 2a*, at least ``far``; half of the gap, all [m]; with the radius and the
    whole gap half of `parallel_conductance_wall`.
    """
    a = mean_radius
    z, y = sqrt((a - near) * (a + near)), sqrt((a - far) * (a + far))
    narrow, wide = half_gap + near * near / (a + z), half_gap + far * far / (a + y)
    return pi * gas_conductivity * ((a + half_gap) * log(wide / narrow) - (z - y))


@formula
def batchelor_conductance(
    gas_conductivity: float, solid_conductivity: float, effective_radius: float, spot: float,
    gap: float,
) -> float:  # fmt: skip
    """What the gas adds to the conductance 2λ_s s of the spot, after Batchelor & O'Brien [W/K].

    With κ = λ_s/λ_f the total is ``2π a* λ_f (ln κ² + f)``:

    * touching, ``η = κ s/(2a*)``: f = 0.17 η² for η ≤ 1, f = 2η/π − 2 ln η for η ≥ 100. Between,
      the smaller of the two is taken; they cross once, at η = 1.313, so H is continuous. (The
      second is lowest at η = π: the total then lies 0.29/ln κ², 2 % for steel in air, below that of
      η = 0, which is the error of the asymptotics.)
    * separated, ``Λ = κ² h/(2a*)``: f = 0 for small Λ, ``ln κ² + f = ln(1 + R²/(2a* h))`` for large
      Λ with R = 2a*, which is the radius for which it joins the expansion of the inner problem.
      Again the smaller is taken; they cross at Λ = 1, nearly.

    A spot of radius 0 at h = 0 belongs to both cases with the same value.

    λ_f and λ_s (λ_h of two, at least 10 λ_f) [W/(m K)]; a*, on a plane wall the radius [m]; spot
    radius s [m], above 0 the bodies touch and the gap h [m] does not count, from 2a* on: 0.
    """
    ratio = solid_conductivity / gas_conductivity
    scale = 2.0 * pi * effective_radius * gas_conductivity
    near = 2.0 * log(ratio)
    if spot >= 2.0 * effective_radius:
        return 0.0
    if spot > 0.0:
        eta = ratio * spot / (2.0 * effective_radius)
        spot_part = 2.0 * eta / pi
        low = 0.17 * eta * eta - spot_part
        high = -2.0 * log(eta)
        return scale * (near + (low if low < high else high))
    if gap <= 0.0:
        return scale * near
    far = log(1.0 + 2.0 * effective_radius / gap)
    return scale * (far if far < near else near)


@formula
def vargas_conductance(gas_conductivity: float, radius: float, spot: float) -> float:
    """Gas between touching spheres of one size ``H = 2π λ_f (1 − ½(s/a)²)(a − s)/(1 − π/4)`` [W/K].

    Vargas & McCarthy 2002. λ_f [W/(m K)]; radii of spheres a and spot s [m], 0 for s ≥ a.
    """
    if spot >= radius:
        return 0.0
    share = spot / radius
    return (
        2.0
        * pi
        * gas_conductivity
        * (1.0 - 0.5 * share * share)
        * (radius - spot)
        / (1.0 - 0.25 * pi)
    )


@formula
def solid_to_gas_ratio(solid: float, spot: float, gas: float, radius: float) -> float:
    """``λ_s s/(λ_f a)``, ≫ 1 where gas may be left out (Batchelor & O'Brien 1977)."""
    return solid * spot / (gas * radius)


@kernel
def gas_conductances(
    scene: Scene, laws: HeatLaws, model: int, gas_conductivity: float, counts: NDArray[np.bool_],
    i: Ints, j: Ints, gap: Floats, spot: Floats, out: Floats,
) -> tuple[float, float]:  # fmt: skip
    """Add the conductance of the gas around each contact and in each gap to ``out`` [W/K].

    Only that of pairs that ``counts`` (those of discs), shape ``(e,)``. Radii of spots [m] are 0
    where there is no contact. Returns the smallest and the largest
    λ_s s/(λ_f a) of the contacts; 0 if there are none. Shapes are ``(e,)``.
    """
    least, most = np.inf, 0.0
    for k in range(i.size):
        a, b = scene.material[i[k]], scene.material[j[k]]
        radius, other = scene.radius[i[k]], other_radius(scene, j[k])
        open_gap = max(gap[k], 0.0)
        mean_radius = 2.0 * effective_radius(radius, other) if other > 0.0 else radius
        # Nearer to the axis than this the solid resists more than the gas, whose flux would grow
        # without bound.
        core = max(spot[k], mean_radius * min(CORE, gas_conductivity / laws.harmonic[a, b]))
        if not counts[k]:
            pass
        elif model == PARALLEL and other > 0.0:
            out[k] += parallel_conductance(gas_conductivity, radius, other, core, open_gap)
        elif model == PARALLEL:
            out[k] += parallel_conductance_wall(gas_conductivity, radius, core, open_gap)
        elif model == BATCHELOR:
            out[k] += batchelor_conductance(
                gas_conductivity, laws.harmonic[a, b], pair_radius(scene, i[k], j[k]), spot[k],
                open_gap,
            )  # fmt: skip
        elif spot[k] > 0.0 or gap[k] <= 0.0:  # a formula for spheres that touch
            out[k] += vargas_conductance(gas_conductivity, mean_radius, spot[k])
        if spot[k] > 0.0:
            ratio = solid_to_gas_ratio(laws.harmonic[a, b], spot[k], gas_conductivity, mean_radius)
            least, most = min(least, ratio), max(most, ratio)
    return (least, most) if most > 0.0 else (0.0, 0.0)
