"""What can be chosen about heat; the choices of each mechanism are with its formulas."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from multicor_cli.engine.heat.conduction import Conduction, ContactForce
from multicor_cli.engine.heat.convection import Ambient
from multicor_cli.engine.heat.friction import FrictionRule
from multicor_cli.engine.heat.gas import Gas
from multicor_cli.engine.heat.laws import HeatLaws
from multicor_cli.engine.heat.radiation import Radiation
from multicor_cli.engine.motion.drives import Constant, Signal

Integrator = Literal["auto", "explicit", "implicit"]

_STEP = ContactForce()
_INSULATED = Constant(0.0)


@dataclass(frozen=True)
class HeatSettings:
    """Choices about heat; everything beyond conduction and friction is off by default.

    Attributes:
        laws: Properties of the materials.
        conduction: Conductance of a contact: smooth spheres (Hertz), rough ones, or none.
        force: Force of the Hertz contact radius.
        friction: Rule of the heat of friction.
        has_impact: Whether the energy lost in impacts becomes heat too.
        is_collisional: Whether a contact that is new in a step conducts by the formula for impacts instead.
        gas: Gas in the gaps, or None.
        ambient: Convection, or None.
        radiation: Radiation, or None.
        integrator: ``"auto"``: implicit in frozen stages, explicit while grains move.
        sub_step: Largest sub-step of the explicit integrator, as Δt ΣH/C.
        tolerance: Largest error of an implicit sub-step over the spread of the temperatures.
    """

    laws: HeatLaws
    conduction: Conduction = "hertz"
    force: ContactForce = _STEP
    friction: FrictionRule = "energy"
    has_impact: bool = False
    is_collisional: bool = False
    gas: Gas | None = None
    ambient: Ambient | None = None
    radiation: Radiation | None = None
    integrator: Integrator = "auto"
    sub_step: float = 1.0
    tolerance: float = 1e-4


@dataclass(frozen=True)
class WallHeat:
    """Thermal condition of one wall during a stage.

    Attributes:
        kind: ``"insulated"``; ``"temperature"``: prescribed [K]; ``"flow"``: heat flow into the grains that touch it [W], shared
            in proportion to their conductances.
        signal: The prescribed value as a function of the time since the start of the stage.
    """

    kind: Literal["insulated", "temperature", "flow"] = "insulated"
    signal: Signal = _INSULATED
