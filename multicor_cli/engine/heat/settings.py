"""What can be chosen about heat; the choices of each mechanism are with its formulas."""

from __future__ import annotations

from dataclasses import dataclass

from multicor_cli.engine.heat.conduction import Conduction, ContactForce
from multicor_cli.engine.heat.convection import Ambient
from multicor_cli.engine.heat.friction import FrictionRule
from multicor_cli.engine.heat.gas import Gas
from multicor_cli.engine.heat.integration import Integration
from multicor_cli.engine.heat.mechanism import HeatLaws, Mechanism
from multicor_cli.engine.heat.radiation import Radiation

MECHANISMS: dict[str, type[Mechanism]] = {"gas": Gas, "ambient": Ambient, "radiation": Radiation}
"""Mechanisms that a run may have, by the key of ``[heat]`` that switches them on."""

_STEP = ContactForce()


@dataclass(frozen=True)
class HeatSettings(Integration):
    """Choices about heat, named as the keys of ``[heat]``; everything beyond conduction and friction is off by default.

    Attributes:
        laws: Properties of the materials.
        conduction: Conductance of a contact: smooth spheres (Hertz), rough ones, or none.
        force: Force of the Hertz contact radius.
        friction: Rule of the heat of friction.
        impact: Whether the energy lost in impacts becomes heat too.
        collisional: Whether a contact that is new in a step conducts by the formula for impacts instead.
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
