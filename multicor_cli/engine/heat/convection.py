"""Convection between a grain and the fluid around it: Nusselt numbers from correlations.

Formula: ``Q = h A (T_f − T)``, ``h = Nu λ_f/d``, ``Re = |v − v_f| d/ν_f``.

Sources: W. E. Ranz & W. R. Marshall, Chem. Eng. Prog. 48 (1952) 141; S. Whitaker, AIChE J. 18
(1972) 361; D. J. Gunn, Int. J. Heat Mass Transf. 21 (1978) 467; J. Li & D. J. Mason, Powder
Technol. 112 (2000) 273.

Validity: *Ranz & Marshall* one sphere, measured for Re < 200, used up to 5·10⁴, 0.6 < Pr < 380;
*Whitaker* one sphere, 3.5 < Re < 7.6·10⁴, 0.7 < Pr < 380, here without the ratio of viscosities at
fluid and surface temperature (valid for gases and small differences); *Gunn* beds of porosity 0.35
to 1, Re < 10⁵; *Li & Mason* dilute (exponent 3.5) and dense (4.75) suspensions. The fluid has one
temperature and one velocity: what the grains do to it is not computed. Nu = 2 at Re = 0 is
diffusion into an infinite fluid, which grains in a bed do not have around them.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Literal

import numpy as np

from multicor_cli.arithmetic import cbrt, power
from multicor_cli.engine.heat.mechanism import HeatLaws, Mechanism, Outside
from multicor_cli.engine.jit.arrays import hypot
from multicor_cli.engine.jit.compile import kernel
from multicor_cli.engine.jit.formulas import formula
from multicor_cli.model.columns import X, Y
from multicor_cli.model.model import Floats, Model

Correlation = Literal["constant", "ranz-marshall", "whitaker", "gunn", "li-mason"]

RANZ_MARSHALL, WHITAKER, GUNN, LI_MASON = 0, 1, 2, 3
"""Correlations of the Nusselt number."""

_NUMBER = {"ranz-marshall": RANZ_MARSHALL, "whitaker": WHITAKER, "gunn": GUNN, "li-mason": LI_MASON}

DENSE = 4.75
"""Exponent of the porosity in the correlation of Li & Mason for dense beds."""


@dataclass(frozen=True)
class Ambient(Mechanism):
    """Convection to a fluid around the grains, at one temperature T_f [K].

    Correlations are those of spheres; of other shapes the diameter is that of the disc of equal
    area.

    Attributes:
        correlation: Formula of the Nusselt number, or a constant ``coefficient`` h [W/(m² K)].
        conductivity: λ_f of the fluid [W/(m K)].
        viscosity: Kinematic viscosity ν_f [m²/s].
        prandtl: Prandtl number.
        porosity: Volume fraction of the fluid, for Gunn and Li & Mason.
        velocity: Of the fluid (x, y) [m/s]; Re takes the grain's velocity relative to it.
    """

    temperature: float
    correlation: Correlation = "constant"
    coefficient: float = 0.0
    conductivity: float = 0.0
    viscosity: float = 1.0
    prandtl: float = 1.0
    porosity: float = 1.0
    velocity: tuple[float, float] = (0.0, 0.0)

    def outside(self, velocity: Floats, laws: HeatLaws, model: Model) -> Outside:
        """The fluid; the conductance is the coefficient of convection times a grain's surface."""
        assert model.thermal is not None
        return Outside(
            "from_ambient",
            self.temperature,
            self._coefficient(velocity, model) * model.thermal.surface,
        )

    def _coefficient(self, velocity: Floats, model: Model) -> Floats | float:
        if self.correlation == "constant":
            return self.coefficient
        slip = velocity - np.array(self.velocity)
        coefficient = np.empty(len(velocity))
        convection_coefficients(
            _NUMBER[self.correlation], hypot(slip[:, X], slip[:, Y]), model.disc_radius,
            self.conductivity, self.viscosity,
            self.prandtl, self.porosity, coefficient,
        )  # fmt: skip
        return coefficient


@formula
def reynolds(speed: float, diameter: float, viscosity: float) -> float:
    """Reynolds number ``Re = |v| d/ν_f``; |v| relative to the fluid [m/s], d [m], ν_f [m²/s]."""
    return abs(speed) * diameter / viscosity


@formula
def ranz_marshall(re: float, pr: float) -> float:
    """Nusselt number ``2 + 0.6 Re^½ Pr^⅓`` (Ranz & Marshall 1952)."""
    return 2.0 + 0.6 * sqrt(re) * cbrt(pr)


@formula
def whitaker(re: float, pr: float) -> float:
    """Nusselt number ``2 + (0.4 Re^½ + 0.06 Re^⅔) Pr^0.4`` (Whitaker 1972; one temperature)."""
    root = cbrt(re)
    return 2.0 + (0.4 * sqrt(re) + 0.06 * root * root) * power(pr, 0.4)


@formula
def gunn(re: float, pr: float, porosity: float) -> float:
    """Nusselt number ``(7 − 10ε + 5ε²)(1 + 0.7 Re^0.2 Pr^⅓) + (1.33 − 2.4ε + 1.2ε²) Re^0.7 Pr^⅓``,
    porosity ε (Gunn 1978).
    """
    p = porosity
    root = cbrt(pr)
    low = (7.0 - 10.0 * p + 5.0 * p * p) * (1.0 + 0.7 * power(re, 0.2) * root)
    high = (1.33 - 2.4 * p + 1.2 * p * p) * power(re, 0.7) * root
    return low + high


@formula
def li_mason(re: float, pr: float, porosity: float, exponent: float) -> float:
    """Nusselt number in suspensions (Li & Mason 2000); porosity ε; n = 3.5 dilute, 4.75 dense.

    ``2 + 0.6 ε^n Re^½ Pr^⅓`` for Re < 200; ``2 + ε^n (0.5 Re^½ + 0.02 Re^0.8) Pr^⅓`` for 200 ≤ Re <
    1500; ``2 + 4.5·10⁻⁵ ε^n Re^1.8`` above. The branches do not join: Nu − 2 falls by 0.33 % at Re
    = 200, and at Re = 1500 it changes by the factor 0.891 Pr^−⅓, as the last branch does not depend
    on Pr (+0.4 % for Pr = 0.7, −11 % for Pr = 1).
    """
    screen = power(porosity, exponent)
    if re < 200.0:
        return 2.0 + 0.6 * screen * sqrt(re) * cbrt(pr)
    if re < 1500.0:
        return 2.0 + screen * (0.5 * sqrt(re) + 0.02 * power(re, 0.8)) * cbrt(pr)
    return 2.0 + 4.5e-5 * screen * power(re, 1.8)


@formula
def coefficient_of(nusselt: float, conductivity: float, diameter: float) -> float:
    """Coefficient of heat transfer ``h = Nu λ_f/d`` [W/(m² K)]; λ_f [W/(m K)], diameter d [m]."""
    return nusselt * conductivity / diameter


@kernel
def convection_coefficients(
    correlation: int, speed: Floats, radius: Floats, conductivity: float, viscosity: float,
    prandtl: float, porosity: float, coefficient: Floats,
) -> None:  # fmt: skip
    """Coefficients of convection from a correlation [W/(m² K)]; **modifies** ``coefficient``.

    Speeds relative to the fluid [m/s] and radii [m] have shape ``(n,)``, as the coefficients; of
    the fluid λ_f [W/(m K)], kinematic viscosity [m²/s], Pr, and its volume fraction ``porosity``.
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
        coefficient[k] = coefficient_of(nusselt, conductivity, 2.0 * radius[k])
