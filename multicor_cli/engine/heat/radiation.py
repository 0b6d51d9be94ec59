"""Thermal radiation between neighboring grains, and to surroundings.

Formula: ``Q = σ X (T_j⁴ − T_i⁴)`` with an area factor X [m²]. Two surfaces that see only each
other: ``X = A/(1/ε_i + 1/ε_j − 1)``. Two spheres are given the area ``A = π a²`` of the smaller
one's cross-section, as parallel plates.

This is an upper estimate: six neighbors take 1.5 times what a grain radiates, and none hides
another or the surroundings. A grain in black surroundings has ``X = ε · surface``.

Source: Stefan–Boltzmann; M. F. Modest, Radiative Heat Transfer (parallel plates, crossed strings
for cylinders).

Validity: gray, diffuse, opaque surfaces, large against the wavelength (grains above 0.1 mm at room
temperature), a gas that does not absorb. The exchange of neighbors takes no account of what other
grains hide or reflect. For steel of emissivity 0.3 at 310 K it is some percent of the conduction of
one lightly loaded contact; it counts at high temperature and for poor conductors.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np

from multicor_cli.arithmetic import acos
from multicor_cli.engine.geometry.radii import other_radius
from multicor_cli.engine.geometry.scene import Scene
from multicor_cli.engine.heat.mechanism import HeatLaws, Mechanism, NearPairs, Outside, PairTransfer
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.model import SHAPE_FACTOR, Floats, Ints, Model

STEFAN_BOLTZMANN = 5.670374419e-8
"""Stefan–Boltzmann constant σ [W/(m² K⁴)] (exact in SI)."""


@dataclass(frozen=True)
class Radiation(Mechanism):
    """Thermal radiation, of black surroundings [K] if there are any, and between near bodies.

    These exchange it across gaps up to ``reach`` times the smaller radius; 0: they do not.
    """

    surroundings: float | None = None
    reach: float = 0.0

    def between(self, near: NearPairs, scene: Scene, laws: HeatLaws, model: Model) -> PairTransfer:
        assert model.thermal is not None
        is_sphere = model.shape_factor == SHAPE_FACTOR["sphere"]
        area = radiating_areas(
            scene, laws, model.thermal.surface, is_sphere, near.i, near.j, near.gap
        )
        if near.outlines is not None:
            near.outlines.put_views(laws, near.i, near.j, near.gap, area)
        return PairTransfer(area=area)

    def outside(self, velocity: Floats, laws: HeatLaws, model: Model) -> Outside | None:
        """The surroundings; the area factor is the emissivity times the surface of each grain."""
        if self.surroundings is None:
            return None
        assert model.thermal is not None
        area = laws.emissivity[model.grains.material] * model.thermal.surface
        return Outside("from_surroundings", self.surroundings, area=area)


def emission_factor(e_i: float, e_j: float) -> float:
    """``1/(1/ε_i + 1/ε_j − 1)`` of surfaces that see only each other (Modest); 0 if an ε is 0."""
    if e_i <= 0.0 or e_j <= 0.0:
        return 0.0
    return 1.0 / (1.0 / e_i + 1.0 / e_j - 1.0)


@formula
def sphere_area_factor(emission: float, radius_i: float, radius_j: float) -> float:
    """Area factor of two spheres ``X = π a²·emission`` [m²]; a the smaller radius [m]."""
    a = radius_i if radius_i < radius_j else radius_j
    return pi * a * a * emission


@formula
def linear_coefficient(area_factor: float, T_i: float, T_j: float) -> float:
    """Conductance ``σ X (T_i² + T_j²)(T_i + T_j)`` [W/K], a factor of T_j − T_i; X [m²], T [K]."""
    return STEFAN_BOLTZMANN * area_factor * (T_i * T_i + T_j * T_j) * (T_i + T_j)


@formula
def cylinder_view_factor(radius_i: float, radius_j: float, gap: float) -> float:
    """Share of what a long cylinder i radiates that falls on a parallel cylinder j.

    Crossed strings (Modest, appendix D), gap h [m] of which an overlap counts as 0, radii r [m]:
    ``F = [π + √(A²−(B+1)²) − √(A²−(B−1)²) + (B−1) acos((B−1)/A) − (B+1) acos((B+1)/A)]/2π``,
    ``B = r_j/r_i``, ``A = 1 + B + h/r_i``.
    """
    b = radius_j / radius_i
    opening = gap / radius_i if gap > 0.0 else 0.0
    a = 1.0 + b + opening
    outer = sqrt(opening * (a + b + 1.0))
    inner = sqrt((a - b + 1.0) * (a + b - 1.0))
    return (
        pi + outer - inner + (b - 1.0) * acos((b - 1.0) / a) - (b + 1.0) * acos((b + 1.0) / a)
    ) / (2.0 * pi)


@kernel
def radiating_areas(
    scene: Scene, laws: HeatLaws, surface: Floats, is_sphere: bool, i: Ints, j: Ints, gap: Floats
) -> Floats:
    """Area factors of radiation between near bodies [m²], shape ``(e,)``.

    Spheres: the smaller cross-section π a² times the emission factor. Discs: the view factor of two
    parallel cylinders times the surface [m²] of the first and the emission factor; a line or circle
    of a wall counts as a sphere or cylinder of the grain's radius.
    """
    area = np.empty(i.size)
    for k in range(i.size):
        emission = laws.emission[scene.material[i[k]], scene.material[j[k]]]
        radius, other = scene.radius[i[k]], other_radius(scene, j[k])
        other = other if other > 0.0 else radius
        if is_sphere:
            area[k] = sphere_area_factor(emission, radius, other)
        else:
            view = cylinder_view_factor(radius, other, max(gap[k], 0.0))
            area[k] = emission * view * surface[i[k]]
    return area
