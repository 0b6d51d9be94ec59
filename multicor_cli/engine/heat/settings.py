"""What can be chosen about heat. Names and units; the formulas are in `multicor_cli.physics.thermal`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from multicor_cli.engine.motion.drives import Constant, Signal
from multicor_cli.model.model import Floats

FrictionRule = Literal["energy", "sliding", "none"]
Conduction = Literal["hertz", "rough", "none"]
GasModel = Literal["parallel", "batchelor", "vargas"]
Correlation = Literal["constant", "ranz-marshall", "whitaker", "gunn", "li-mason"]
Integrator = Literal["auto", "explicit", "implicit"]


@dataclass(frozen=True)
class HeatLaws:
    """Thermal properties of ``k`` materials, and of their pairs.

    Attributes:
        conductivity: λ [W/(m K)], shape ``(k,)``.
        volumetric: ρ c_p [J/(m³ K)], shape ``(k,)``.
        modulus: Contact modulus E* with 1/E* = (1−ν_i²)/E_i + (1−ν_j²)/E_j [Pa], shape ``(k, k)``.
        harmonic: λ_h = 2 λ_i λ_j/(λ_i+λ_j) [W/(m K)], shape ``(k, k)``.
        share: β, the share of the heat of friction that goes into the first body, shape ``(k, k)``; ``β_ij + β_ji = 1``.
        emissivity: ε, shape ``(k,)``; 0 where not given.
        roughness: σ, root of the sum of the squared roughnesses of the two surfaces [m], shape ``(k, k)``; 0 where not given.
        slope: Root of the sum of the squared mean slopes of the asperities, shape ``(k, k)``.
        microhardness: Harmonic mean of the microhardnesses [Pa], shape ``(k, k)``.
        wear: Archard's coefficient over the hardness of the first material K/H_i [1/Pa], shape ``(k, k)``; 0: no wear.
    """

    conductivity: Floats
    volumetric: Floats
    modulus: Floats
    harmonic: Floats
    share: Floats
    emissivity: Floats
    roughness: Floats
    slope: Floats
    microhardness: Floats
    wear: Floats


@dataclass(frozen=True)
class ContactForce:
    """Which normal force makes the Hertz contact radius.

    Attributes:
        kind: ``"step"``: that of the step p_n/Δt; ``"average"``: a running average; ``"prescribed"``: the same for all contacts
            that carry a force.
        value: Averaging time [s], or the prescribed force [N].
    """

    kind: Literal["step", "average", "prescribed"] = "step"
    value: float = 0.0


@dataclass(frozen=True)
class Gas:
    """Stagnant gas in the gaps.

    Attributes:
        conductivity: λ_f [W/(m K)].
        model: Formula of the gap conductance.
        reach: Largest gap that conducts, over the smaller radius.
    """

    conductivity: float
    model: GasModel = "parallel"
    reach: float = 0.4


@dataclass(frozen=True)
class Ambient:
    """Convection to a fluid around the grains, at one temperature.

    Attributes:
        temperature: T_f [K].
        correlation: Formula of the Nusselt number, or a constant coefficient.
        coefficient: h [W/(m² K)] for ``"constant"``.
        conductivity: λ_f of the fluid [W/(m K)].
        viscosity: Kinematic viscosity ν_f [m²/s].
        prandtl: Prandtl number.
        porosity: Volume fraction of the fluid, for Gunn and Li & Mason.
        velocity: Velocity of the fluid (x, y) [m/s]; the Reynolds number takes the grain's velocity relative to it.
    """

    temperature: float
    correlation: Correlation = "constant"
    coefficient: float = 0.0
    conductivity: float = 0.0
    viscosity: float = 1.0
    prandtl: float = 1.0
    porosity: float = 1.0
    velocity: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Radiation:
    """Thermal radiation.

    Attributes:
        surroundings: Temperature of the surroundings, a black body [K], or None: none.
        neighbors: Whether grains and walls within ``reach`` radiate at each other.
        reach: Largest gap across which they do, over the smaller radius.
    """

    surroundings: float | None = None
    neighbors: bool = False
    reach: float = 0.4


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
    force: ContactForce = ContactForce()
    friction: FrictionRule = "energy"
    has_impact: bool = False
    is_collisional: bool = False
    gas: Gas | None = None
    ambient: Ambient | None = None
    radiation: Radiation | None = None
    integrator: Integrator = "auto"
    sub_step: float = 1.0
    tolerance: float = 1e-4


_ZERO = Constant(0.0)


@dataclass(frozen=True)
class WallHeat:
    """Thermal condition of one wall during a stage.

    Attributes:
        kind: ``"insulated"``; ``"temperature"``: prescribed [K]; ``"flow"``: heat flow into the grains that touch it [W], shared
            in proportion to their conductances.
        signal: The prescribed value as a function of the time since the start of the stage.
    """

    kind: Literal["insulated", "temperature", "flow"] = "insulated"
    signal: Signal = _ZERO
