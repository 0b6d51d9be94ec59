"""What can be chosen about heat, and what it needs to know of the materials and their pairs.

The choices of each mechanism are with its formulas.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from operator import mul
from typing import Any, Literal

import numpy as np

from multicor_cli.arithmetic import hypot
from multicor_cli.engine.heat.convection import Ambient
from multicor_cli.engine.heat.friction import SHARES, FrictionRule, Partition
from multicor_cli.engine.heat.gas import Gas
from multicor_cli.engine.heat.hertz import contact_modulus, harmonic_mean
from multicor_cli.engine.heat.integration import Integration
from multicor_cli.engine.heat.mechanism import HeatLaws, Mechanism
from multicor_cli.engine.heat.radiation import Radiation, emission_factor
from multicor_cli.model.model import Floats

MECHANISMS: dict[str, type[Mechanism]] = {"gas": Gas, "ambient": Ambient, "radiation": Radiation}
"""Mechanisms that a run may have, by the key of ``[heat]`` that switches them on."""

Conduction = Literal["hertz", "rough", "none"]


@dataclass(frozen=True)
class ContactForce:
    """Which normal force makes the Hertz contact radius.

    ``"step"``: that of the step p_n/Δt; ``"average"``: a running average over ``value`` [s];
    ``"prescribed"``: ``value`` [N] for all contacts that carry a force.
    """

    kind: Literal["step", "average", "prescribed"] = "step"
    value: float = 0.0


_STEP = ContactForce()


@dataclass(frozen=True)
class HeatSettings(Integration):
    """Choices about heat, named as the keys of ``[heat]``; only conduction and friction are on.

    Attributes:
        conduction: Conductance of a contact: smooth spheres (Hertz), rough ones, or none.
        force: Force of the Hertz contact radius.
        friction: Rule of the heat of friction.
        impact: Whether the energy lost in impacts becomes heat too.
        collisional: Whether a contact that is new in a step conducts by the formula for impacts.
        mechanisms: What carries heat beside the contact spots.
    """

    laws: HeatLaws
    conduction: Conduction = "hertz"
    force: ContactForce = _STEP
    friction: FrictionRule = "energy"
    impact: bool = False
    collisional: bool = False
    mechanisms: tuple[Mechanism, ...] = ()

    @property
    def reach(self) -> float:
        """Largest gap that a mechanism crosses, over the smaller radius; 0 if none does."""
        return max((mechanism.reach for mechanism in self.mechanisms), default=0.0)


# ---- Properties of materials and of their pairs: one record, for kernels and for all other code

UNUSED_STIFFNESS = 1.0
"""Modulus and microhardness [Pa] of pairs without: never used, and fit to divide by."""

Properties = Mapping[str, Any]
"""Properties of a material by name; None, or left out: not given."""


def heat_laws(materials: Sequence[Properties], partition: Partition, wear: Floats) -> HeatLaws:
    """Thermal properties of materials and of their pairs.

    Properties that a material does not give are not needed in this run (loading the scenario has
    checked that). They are 0 in these arrays, except the modulus and the microhardness of such
    pairs, which are 1 Pa, and their shares, which are ½. ``partition`` shares the heat of friction;
    ``wear`` is Archard's coefficient of each pair, 0 without wear, shape ``(k, k)``.
    """

    def of_each(formula: Callable[..., float], *names: str) -> Floats:
        return np.array([_value(formula, names, 0.0, one) for one in materials], float)

    def of_pairs(formula: Callable[..., float], *names: str, missing: float = 0.0) -> Floats:
        return np.array(
            [[_value(formula, names, missing, a, b) for b in materials] for a in materials], float
        )

    hardness = np.array([[one.get("hardness") or inf] for one in materials])
    formula, names = SHARES[partition]
    share = of_pairs(formula, *names, missing=0.5)
    lower = np.tril_indices(len(share), -1)
    share[lower] = 1.0 - share.T[lower]  # what the first body leaves: rounding loses nothing
    np.fill_diagonal(share, 0.5)
    return HeatLaws(
        conductivity=of_each(float, "conductivity"),
        volumetric=of_each(mul, "density", "heat_capacity"),
        modulus=of_pairs(contact_modulus, "young", "poisson", missing=UNUSED_STIFFNESS),
        harmonic=of_pairs(harmonic_mean, "conductivity"),
        share=share,
        emissivity=of_each(float, "emissivity"), emission=of_pairs(emission_factor, "emissivity"),
        roughness=of_pairs(hypot, "roughness"), slope=of_pairs(hypot, "asperity_slope"),
        microhardness=of_pairs(harmonic_mean, "microhardness", missing=UNUSED_STIFFNESS),
        wear=wear / hardness,
    )  # fmt: skip


def knows_flash(laws: HeatLaws) -> bool:
    """Whether materials give what flash temperatures take: elasticity, λ and ρc, all of them."""
    is_elastic = bool((laws.modulus != UNUSED_STIFFNESS).all())
    return is_elastic and bool((laws.conductivity > 0.0).all() and (laws.volumetric > 0.0).all())


def _value(
    formula: Callable[..., float], names: Sequence[str], missing: float, *bodies: Properties
) -> float:
    """The formula of the properties of one body, or of two; ``missing`` if one is not given."""
    values = [body.get(name) for body in bodies for name in names]
    return missing if None in values else formula(*values)
